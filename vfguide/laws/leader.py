"""Interface of a leader's law, and the field around the path.

A law returns the course that it wants. Around it, once for every leader, delays are compensated, the airspeed
yields to slots and other vehicles are avoided. Setpoints follow through wind triangle and limits.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, wrap_angle
from vfguide.guidance.formation import SlotLimits, airspeed_that_gives_way
from vfguide.guidance.path import (
    Path,
    PathPoint,
    desired_course,
    desired_course_rate_per_speed,
    joining_turn_rate,
)
from vfguide.guidance.sliding_laws import (
    GuidanceSettings,
    PathGains,
    cruise_setpoint,
    sliding_course_rate,
    speed_estimate_rate,
)
from vfguide.mission.quantity import Section
from vfguide.registry import leader_laws
from vfguide.state import Airframe, NamedState, Setpoint, VehicleState

leader_law = leader_laws.register
"""Decorator `@leader_law("name")`: registers a class as the law `leader.law: name`."""


class LeaderView(NamedState, frozen=True, kw_only=True):
    """Input of a leader's law in one step.

    North and east in metres from the mission's origin, angles in radians clockwise from north, speeds in m/s.
    """

    state: VehicleState
    """State of the leader: position, course, ground speed, heading, airspeed, wind and its rates."""
    path: Path
    """Path of the mission: `at` and `length` look ahead along it."""
    point: PathPoint[float]
    """Path point nearest to the leader: course, curvature, progress and cross-track error."""
    path_gains: PathGains
    """`path.gain` of the mission, and the field's approach angle far from the path."""
    airspeed: float
    """Cruise airspeed of the mission, m/s."""
    period: float
    """Time since the previous step and until the next, s."""


class LeaderMotion(NamedState, frozen=True, kw_only=True):
    """Motion that a leader's law wants."""

    course: float
    """chi_d over ground, rad; the course minus chi_d is the law's course error."""
    course_rate: float
    """Demanded dchi/dt, rad/s, positive right."""
    ground_speed: float
    """V_g used by the law, m/s: measured, or an estimate without measurement."""


class LeaderLaw(ABC):
    """Law that makes the leader follow its path.

    A subclass with `@leader_law("name")` is `leader.law: name`, and its `Gains` are `leader.gains`.
    """

    name: ClassVar[str]
    """Name in a mission; set by `@leader_law`."""

    Gains: ClassVar[type[Section]] = Section
    """Gains of the law, with units, bounds and defaults."""

    def __init__(self, gains: Any, settings: GuidanceSettings, airframe: Airframe) -> None:  # noqa: ANN401
        """Create the law of one leader; `gains` is an instance of `Gains`.

        `settings` are the mission's for all laws, slowed for an autopilot with delay.
        """
        self.gains = gains
        self.settings = settings
        self.airframe = airframe

    def start(self, view: LeaderView) -> Any:  # noqa: ANN401
        """Return the memory before the first step."""
        del view

    @abstractmethod
    def step(
        self,
        view: LeaderView,
        memory: Any,  # noqa: ANN401 - each law has its own
    ) -> tuple[LeaderMotion, Any]:
        """Return the wanted motion, and the memory for the next step."""

    def follow(self, view: LeaderView, *, course: float, course_rate: float) -> LeaderMotion:
        """Return the motion that brings the course to a wanted one (rad, over ground) as fast as possible.

        The wanted course turns at `course_rate` (rad/s).
        """
        return LeaderMotion(
            course=course,
            course_rate=sliding_course_rate(
                wrap_angle(view.state.course - course),
                course_rate,
                self.settings.sliding.kappa,
                self.settings.sliding.layer_in(
                    view.state, self.airframe, view.period, self.settings.sliding.course_bandwidth
                ),
            ),
            ground_speed=view.state.ground_speed,
        )


def steepest_gain(course_bandwidth: float, gains: PathGains, airspeed: float) -> float:
    """Return the gain (1/m) at which a path's field is as steep as the course law beneath it (1/s)."""
    return course_bandwidth / (2.0 / math.pi * gains.approach_angle * airspeed)


@leader_law("field")
class PathField(LeaderLaw):
    """Vector field around the path, from the article; its ground speed may be an adaptive estimate."""

    def step(self, view: LeaderView, memory: float | None) -> tuple[LeaderMotion, float]:
        """Return the motion along the field; the memory is V^_g, m/s, None before the first step."""
        state, angle = view.state, view.path_gains.approach_angle
        # Keep the field no steeper than the course law beneath it, even at its middle.
        steepest = steepest_gain(
            self.settings.sliding.course_bandwidth, view.path_gains, view.airspeed
        )
        gains = (min(view.path_gains.gain, steepest), angle)
        course = desired_course(view.point, *gains)
        regressor = desired_course_rate_per_speed(view.point, state.course, *gains)
        ground_speed = state.ground_speed
        if self.settings.speed_source == "observer":
            before = state.airspeed if memory is None else memory
            # V_ref is the airspeed: no ground speed is measured.
            ground_speed = before + view.period * speed_estimate_rate(
                before,
                state.airspeed,
                wrap_angle(state.course - course),
                regressor,
                self.settings.observer,
            )
        motion = self.follow(view, course=course, course_rate=ground_speed * regressor)
        return replace(motion, ground_speed=ground_speed), ground_speed


class LeaderTask(msgspec.Struct, frozen=True, kw_only=True):
    """Task of a leader and its followers."""

    path: Path
    """Path to follow."""
    path_gains: PathGains
    """Gains of the field around the path."""
    airspeed: float
    """Cruise airspeed, m/s."""
    followers: Sequence[SlotLimits]
    """Slots and the airspeed ranges of their vehicles."""
    height: float = 0.0
    """Flying height of the mission, the zero of the path's heights, m above the origin."""
    least_radius: float = 0.0
    """Smallest turn radius while joining the path, m; 0 leaves it to the field."""
    law: type[LeaderLaw] = PathField
    """Law for following the path."""
    gains: Section = msgspec.field(default_factory=Section)
    """Gains of the law."""


class LeaderGuidance(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one step."""

    setpoint: Setpoint
    """Setpoint for the autopilot."""
    memory: Any
    """Memory of the law for the next step."""
    point: PathPoint[float]
    """Path point nearest to the leader."""
    cross_track_error: float
    """m, positive right of the path."""
    course_error: float
    """chi~, rad."""


FIRST = object()
"""Placeholder for the memory before the first step."""


def leader_step(
    state: VehicleState,
    law: LeaderLaw,
    task: LeaderTask,
    *,
    period: float,
    memory: Any = FIRST,  # noqa: ANN401 - each law has its own
) -> LeaderGuidance:
    """Return the guidance of the leader, `period` seconds after the previous step.

    `law` is that of the task, with the vehicle's settings and limits. `memory` is absent in the first step.
    """
    settings, airframe = law.settings, law.airframe
    point = task.path.nearest_in_space(
        state.north, state.east, state.course, state.height - task.height
    )
    view = LeaderView(
        state=state,
        path=task.path,
        point=point,
        path_gains=task.path_gains,
        airspeed=task.airspeed,
        period=period,
    )
    motion, memory = law.step(view, law.start(view) if memory is FIRST else memory)
    if task.least_radius > 0.0:
        limit = joining_turn_rate(point, motion.ground_speed, task.least_radius)
        motion = replace(motion, course_rate=clip(motion.course_rate, -limit, limit))
    # The setpoint uses the law's ground speed.
    state = replace(state, ground_speed=motion.ground_speed)
    airspeed = task.airspeed
    if settings.give_way:
        turn_rate = point.curvature * state.ground_speed
        airspeed = airspeed_that_gives_way(
            task.airspeed, state, turn_rate, task.followers, airframe
        )
    return LeaderGuidance(
        setpoint=cruise_setpoint(
            state,
            airspeed,
            motion.course_rate,
            airframe,
            wind_feedforward=settings.wind_feedforward,
            hold=period,
        ),
        memory=memory,
        point=point,
        cross_track_error=point.cross_track_error,
        course_error=wrap_angle(state.course - motion.course),
    )
