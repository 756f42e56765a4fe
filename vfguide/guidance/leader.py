"""One guidance step of the leader: along its path, at its airspeed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic

from vfguide.angles import wrap_angle
from vfguide.elementwise import Number
from vfguide.guidance.give_way import SlotLimits, airspeed_that_gives_way
from vfguide.guidance.observer import speed_estimate_rate
from vfguide.guidance.path import Path
from vfguide.guidance.path_field import desired_course, desired_course_rate_per_speed
from vfguide.guidance.setpoint import cruise_setpoint
from vfguide.guidance.settings import GuidanceSettings, PathGains
from vfguide.guidance.sliding_laws import sliding_course_rate
from vfguide.state import Airframe, Setpoint, VehicleState


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderTask:
    """What a leader flies, and for whom."""

    path: Path
    """The path."""
    path_gains: PathGains
    """The field around it."""
    airspeed: float
    """Cruise, m/s."""
    followers: Sequence[SlotLimits]
    """Slots, and what their vehicles can do."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LeaderGuidance(Generic[Number]):
    """Result of one step."""

    setpoint: Setpoint[Number]
    """For the autopilot."""
    speed_estimate: Number
    """V^_g, m/s: the ground speed that the law used, handed to the next step."""
    cross_track_error: Number
    """m, positive right of the path."""
    course_error: Number
    """chi~, rad."""


def leader_step(
    state: VehicleState[Number],
    task: LeaderTask,
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
    speed_estimate: Number | None = None,
) -> LeaderGuidance[Number]:
    """Setpoint of the leader.

    Args:
        state: navigated state.
        task: path, field, cruise airspeed, slots.
        settings: the mission's gains and switches.
        airframe: response and limits.
        period: since the step before, s.
        speed_estimate: V^_g of the step before; None in the first.
    """
    point = task.path.nearest(state.north, state.east, state.course)
    field = (task.path_gains.gain, task.path_gains.approach_angle)
    course_error = wrap_angle(state.course - desired_course(point, *field))
    regressor = desired_course_rate_per_speed(point, state.course, *field)
    ground_speed = state.ground_speed
    if settings.speed_source == "observer":
        before = state.airspeed if speed_estimate is None else speed_estimate
        ground_speed = before + period * speed_estimate_rate(
            before, state.airspeed, course_error, regressor, settings.observer
        )
        # Everything below flies on the estimate alone; V_ref is the airspeed, since nothing was measured.
        state = replace(state, ground_speed=ground_speed)
    course_rate = sliding_course_rate(
        course_error,
        ground_speed * regressor,
        settings.sliding.kappa,
        settings.sliding.layer(period),
    )
    airspeed = state.airspeed * 0.0 + task.airspeed
    if settings.give_way:
        turn_rate = point.curvature * state.ground_speed
        airspeed = airspeed_that_gives_way(
            task.airspeed, state, turn_rate, task.followers, airframe
        )
    return LeaderGuidance(
        setpoint=cruise_setpoint(
            state,
            airspeed,
            course_rate,
            airframe,
            wind_feedforward=settings.wind_feedforward,
            hold=period,
        ),
        speed_estimate=ground_speed,
        cross_track_error=point.cross_track_error,
        course_error=course_error,
    )
