"""One guidance step of a follower: onto its slot by the dual field."""

from dataclasses import dataclass
from typing import Generic

from vfguide.angles import wrap_angle
from vfguide.elementwise import Number
from vfguide.guidance.course_law import sliding_course_rate
from vfguide.guidance.formation import (
    FormationError,
    Slot,
    arc_tangent_field,
    article_motion,
    formation_error,
    lyapunov,
    predict_leader,
    slot_motion,
)
from vfguide.guidance.setpoint import setpoint_for
from vfguide.guidance.settings import GuidanceSettings
from vfguide.guidance.speed_law import sliding_acceleration
from vfguide.state import Airframe, LeaderState, Setpoint, VehicleState


@dataclass(frozen=True, slots=True, kw_only=True)
class FollowerGuidance(Generic[Number]):
    """Result of one step."""

    setpoint: Setpoint[Number]
    """For the autopilot."""
    error: FormationError[Number]
    """Where the slot is, as the follower knows it."""
    course_error: Number
    """chi~_f, rad."""
    speed_error: Number
    """V~_f, m/s."""
    lyapunov: Number
    """W, m²."""


def follower_step(
    state: VehicleState[Number],
    leader: LeaderState[Number],
    slot: Slot[Number],
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
) -> FollowerGuidance[Number]:
    """Setpoint of a follower; it remembers nothing between steps.

    Args:
        state: navigated state of the follower.
        leader: newest leader state, as old as it may be.
        slot: its place in the formation.
        settings: the mission's gains and switches.
        airframe: response and limits.
        period: since the step before, s.
    """
    if settings.predict_leader:
        leader = predict_leader(leader, state.time_s)
    motion_of = slot_motion if settings.field_type == "slot" else article_motion
    motion = motion_of(leader, slot)
    error = formation_error(motion, state)
    gains, sliding = settings.field, settings.sliding
    turn, turn_rate = arc_tangent_field(
        error.cross_track, error.cross_track_rate, gains.k_y, gains.chi_inf
    )
    push, push_rate = arc_tangent_field(
        error.along_track, error.along_track_rate, gains.k_x, gains.v_inf
    )
    course_error = wrap_angle(state.course - (motion.course + turn))
    speed_error = state.ground_speed - (motion.speed + push)
    layer = sliding.layer(period)
    course_rate = sliding_course_rate(
        course_error, motion.turn_rate + turn_rate, sliding.kappa, layer
    )
    acceleration = sliding_acceleration(
        speed_error,
        error.along_track,
        motion.acceleration + push_rate,
        gain=sliding.kappa,
        layer=layer,
        rho=sliding.rho,
    )
    return FollowerGuidance(
        setpoint=setpoint_for(
            state,
            acceleration,
            course_rate,
            airframe,
            wind_feedforward=settings.wind_feedforward,
        ),
        error=error,
        course_error=course_error,
        speed_error=speed_error,
        lyapunov=lyapunov(error, course_error, speed_error, sliding.rho),
    )
