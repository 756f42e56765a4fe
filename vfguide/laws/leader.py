"""What a law by which the leader follows its path is made of, and vfguide's own: the field around the path.

A law says which course it wants. What every leader needs is done around it, once: late autopilots are
compensated for, the airspeed gives way to slots that need another, other vehicles are kept clear of, and the
course is turned into setpoints through the wind triangle and within the vehicle's limits.
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
"""`@leader_law("name")` makes a class known as the law `leader.law: name`."""


class LeaderView(NamedState, frozen=True, kw_only=True):
    """What a leader's law is told in one step.

    North and east in metres from the mission's origin, angles in radians clockwise from north, speeds in m/s.
    """

    state: VehicleState
    """State of the leader: position, course, ground speed, heading, airspeed, wind, the wind's rates."""
    path: Path
    """The mission's path: `at` and `length` look ahead along it."""
    point: PathPoint[float]
    """The point of the path nearest to the leader: course, curvature, progress, and the cross-track error."""
    path_gains: PathGains
    """The mission's `path.gain`, and the angle at which its field comes from far away."""
    airspeed: float
    """Cruise of the mission, m/s."""
    period: float
    """Since the step before and until the next, s."""


class LeaderMotion(NamedState, frozen=True, kw_only=True):
    """The motion that a leader's law wants."""

    course: float
    """chi_d over the ground, rad; what the course differs from it is the law's course error."""
    course_rate: float
    """dchi/dt that is asked of the vehicle now, rad/s, positive to the right."""
    ground_speed: float
    """V_g that the law flew by, m/s: the measured one, or an estimate where none is measured."""


class LeaderLaw(ABC):
    """A law by which the leader follows its path.

    A subclass with `@leader_law("name")` is known as `leader.law: name`, with the fields of its `Gains` in
    the mission's `leader.gains`.
    """

    name: ClassVar[str]
    """What a mission calls it; set by `@leader_law`."""

    Gains: ClassVar[type[Section]] = Section
    """The law's gains: fields with their units, bounds and defaults."""

    def __init__(self, gains: Any, settings: GuidanceSettings, airframe: Airframe) -> None:  # noqa: ANN401
        """Make the law of one leader.

        Args:
            gains: an instance of `Gains`.
            settings: what the mission sets for every law, slowed for an autopilot that answers late.
            airframe: response and limits of the vehicle.
        """
        self.gains = gains
        self.settings = settings
        self.airframe = airframe

    def start(self, view: LeaderView) -> Any:  # noqa: ANN401
        """What the law remembers before its first step."""
        del view

    @abstractmethod
    def step(
        self,
        view: LeaderView,
        memory: Any,  # noqa: ANN401 - each law has its own
    ) -> tuple[LeaderMotion, Any]:
        """(motion, memory): what the law wants now, and what it remembers until the next step."""

    def follow(self, view: LeaderView, *, course: float, course_rate: float) -> LeaderMotion:
        """The motion that drives the course to a wanted one as fast as the vehicle's own hold can.

        Args:
            view: of this step.
            course: wanted over the ground, rad.
            course_rate: at which that turns, rad/s.
        """
        return LeaderMotion(
            course=course,
            course_rate=sliding_course_rate(
                wrap_angle(view.state.course - course),
                course_rate,
                self.settings.sliding.kappa,
                self.settings.sliding.layer_in(
                    view.state,
                    self.airframe,
                    view.period,
                    self.settings.sliding.course_bandwidth,
                ),
            ),
            ground_speed=view.state.ground_speed,
        )


def steepest_gain(course_bandwidth: float, gains: PathGains, airspeed: float) -> float:
    """Return the gain (1/m) of a path's field that is as steep as the course law beneath it.

    Args:
        course_bandwidth: of that law, 1/s.
        gains: of the field.
        airspeed: m/s.
    """
    return course_bandwidth / (2.0 / math.pi * gains.approach_angle * airspeed)


@leader_law("field")
class PathField(LeaderLaw):
    """The vector field around the path, of the article; its ground speed may be an adaptive estimate."""

    def step(self, view: LeaderView, memory: float | None) -> tuple[LeaderMotion, float]:
        """Along the field; the memory is V^_g, m/s, None before the first step."""
        state, angle = view.state, view.path_gains.approach_angle
        # No faster than the course law beneath it, even at the middle of the field.
        steepest = steepest_gain(
            self.settings.sliding.course_bandwidth, view.path_gains, view.airspeed
        )
        gains = (min(view.path_gains.gain, steepest), angle)
        course = desired_course(view.point, *gains)
        regressor = desired_course_rate_per_speed(view.point, state.course, *gains)
        ground_speed = state.ground_speed
        if self.settings.speed_source == "observer":
            before = state.airspeed if memory is None else memory
            # V_ref is the airspeed, since nothing was measured.
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
    """What a leader flies, and for whom."""

    path: Path
    """The path."""
    path_gains: PathGains
    """The field around it."""
    airspeed: float
    """Cruise, m/s."""
    followers: Sequence[SlotLimits]
    """Slots, and what their vehicles can do."""
    height: float = 0.0
    """The mission's flying height, from which the path's heights count, m above the origin."""
    least_radius: float = 0.0
    """It turns no tighter onto its path, m; 0 where that is left to the field."""
    law: type[LeaderLaw] = PathField
    """The law by which the leader follows the path."""
    gains: Section = msgspec.field(default_factory=Section)
    """The gains of that law."""


class LeaderGuidance(msgspec.Struct, frozen=True, kw_only=True):
    """Result of one step."""

    setpoint: Setpoint
    """For the autopilot."""
    memory: Any
    """The law's memory, handed to the next step."""
    point: PathPoint[float]
    """The point of the path nearest to the leader."""
    cross_track_error: float
    """m, positive right of the path."""
    course_error: float
    """chi~, rad."""


FIRST = object()
"""In place of a memory: the law has none yet."""


def leader_step(
    state: VehicleState,
    law: LeaderLaw,
    task: LeaderTask,
    *,
    period: float,
    memory: Any = FIRST,  # noqa: ANN401 - each law has its own
) -> LeaderGuidance:
    """Setpoint of the leader.

    Args:
        state: navigated state.
        law: of the task, with the vehicle's settings and limits.
        task: path, cruise airspeed, slots.
        period: since the step before, s.
        memory: of the law, after the step before; absent in the first.
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
    # Everything below flies by the ground speed that the law flew by.
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
