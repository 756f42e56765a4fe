"""One guidance step of a follower: onto its slot by the dual field."""

from dataclasses import dataclass, replace
from typing import Generic

from vfguide.angles import wrap_angle
from vfguide.elementwise import BoolArray, Number, like
from vfguide.guidance.course_law import sliding_course_rate
from vfguide.guidance.formation import (
    FieldGains,
    FormationError,
    Slot,
    SlotMotion,
    arc_tangent_field,
    article_motion,
    formation_error,
    lyapunov,
    predict_leader,
    slot_motion,
)
from vfguide.guidance.setpoint import setpoint_for
from vfguide.guidance.settings import GuidanceSettings
from vfguide.guidance.slot_integral import Offset, aimed_error, learned
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


@dataclass(frozen=True, slots=True, kw_only=True)
class DesiredMotion(Generic[Number]):
    """Course and speed over ground that the dual field asks for, and their rates."""

    course: Number
    """rad."""
    course_rate: Number
    """rad/s."""
    speed: Number
    """m/s."""
    acceleration: Number
    """m/s²."""


def follower_step(
    state: VehicleState[Number],
    leader: LeaderState[Number],
    slot: Slot[Number],
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
    offset: Offset[Number] | None = None,
) -> FollowerGuidance[Number]:
    """Setpoint of a follower; it remembers nothing between steps.

    Args:
        state: navigated state of the follower.
        leader: newest leader state, as old as it may be.
        slot: its place in the formation.
        settings: the mission's gains and switches.
        airframe: response and limits.
        period: since the step before, s.
        offset: b, what the field's integral has learned; nothing if absent.
    """
    if settings.predict_leader:
        leader = predict_leader(leader, state.time_s)
    motion_of = slot_motion if settings.field_type == "slot" else article_motion
    motion = motion_of(leader, slot)
    error = formation_error(motion, state)
    if not settings.rate_feedforward:
        still = like(0.0, motion.speed)
        motion = replace(motion, turn_rate=still, acceleration=still)
    gains, sliding = settings.field, settings.sliding
    aimed = error if offset is None else aimed_error(error, offset, gains)
    desired = field_motion(motion, aimed, gains)
    course_error = wrap_angle(state.course - desired.course)
    speed_error = state.ground_speed - desired.speed
    layer = sliding.layer(period)
    course_rate = sliding_course_rate(course_error, desired.course_rate, sliding.kappa, layer)
    if not settings.answers_course_error:
        course_rate = motion.turn_rate
    acceleration = sliding_acceleration(
        speed_error,
        aimed.along_track,
        desired.acceleration,
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
            hold=period,
        ),
        error=error,
        course_error=course_error,
        speed_error=speed_error,
        lyapunov=lyapunov(error, course_error, speed_error, sliding.rho),
    )


def learning_step(
    state: VehicleState[Number],
    leader: LeaderState[Number],
    slot: Slot[Number],
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
    offset: Offset[Number],
    held: bool | BoolArray = False,
) -> tuple[FollowerGuidance[Number], Offset[Number]]:
    """(guidance, offset for the next step) of a follower whose field learns; the rest as `follower_step`.

    Nothing is learned while `held`, when something else than the guidance is flown, nor at a limit.
    """
    guidance = follower_step(
        state,
        leader,
        slot,
        settings,
        airframe,
        period=period,
        offset=offset,
    )
    after = learned(
        offset,
        guidance.error,
        settings.field,
        period=period,
        held=held | guidance.setpoint.limited,
    )
    return guidance, after


def field_motion(
    motion: SlotMotion[Number], error: FormationError[Number], gains: FieldGains
) -> DesiredMotion[Number]:
    """What the dual field asks of a follower that is this far from its slot."""
    turn, turn_rate = arc_tangent_field(
        error.cross_track, error.cross_track_rate, gains.k_y, gains.chi_inf
    )
    push, push_rate = arc_tangent_field(
        error.along_track, error.along_track_rate, gains.k_x, gains.v_inf
    )
    return DesiredMotion(
        course=motion.course + turn,
        course_rate=motion.turn_rate + turn_rate,
        speed=motion.speed + push,
        acceleration=motion.acceleration + push_rate,
    )
