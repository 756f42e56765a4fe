"""Formation keeping by two PID controllers: what the fields are measured against.

Each holds its axis in the frame of the slot's motion and answers with a correction of the course, or of the
ground speed, on top of the slot's own: the slot's velocity and its rates are fed forward, so that nothing is
left for the integrals but what nobody knows. The derivative is the error's rate by the measured velocities,
low-passed. An integral stands still while its correction is at its limit and the error would push it
further, while the vehicle's own limits cut the setpoint of the step before, and far from the slot, as the
field's does (conditional integration: Astrom and Hagglund, Advanced PID Control, 2006, chapter 3).
"""

from dataclasses import dataclass
from typing import Generic

from vfguide.angles import wrap_angle
from vfguide.elementwise import BoolArray, Number, clip, where
from vfguide.guidance.follower import FollowerGuidance
from vfguide.guidance.formation import FormationError, SlotMotion, lyapunov
from vfguide.guidance.low_pass import low_pass
from vfguide.guidance.setpoint import setpoint_for
from vfguide.guidance.settings import AxisGains, PidGains
from vfguide.guidance.slot_integral import nearness
from vfguide.state import Airframe, VehicleState


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisMemory(Generic[Number]):
    """What one controller remembers."""

    integral: Number
    """The integral's share of the correction, rad or m/s."""
    rate: Number
    """Low-passed rate of the error, m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PidMemory(Generic[Number]):
    """What both remember from one step to the next."""

    lateral: AxisMemory[Number]
    """Of the course."""
    longitudinal: AxisMemory[Number]
    """Of the speed."""
    limited: bool | BoolArray
    """Whether the vehicle's limits cut the setpoint."""


def first_memory(error: FormationError[Number]) -> PidMemory[Number]:
    """Before the first step: empty integrals, and rates that need not settle."""
    still = error.along_track * 0.0
    return PidMemory(
        lateral=AxisMemory(integral=still, rate=error.cross_track_rate),
        longitudinal=AxisMemory(integral=still, rate=error.along_track_rate),
        limited=still > 0.0,
    )


def axis_step(
    error: Number,
    error_rate: Number,
    memory: AxisMemory[Number],
    gains: AxisGains[Number],
    *,
    period: float,
    share: Number,
    held: bool | BoolArray,
) -> tuple[Number, AxisMemory[Number]]:
    """(correction, memory) of one controller: P e + integral of I e + D de/dt, within its limit.

    Args:
        error: distance to the slot on this axis, m.
        error_rate: its rate, m/s.
        memory: of the step before.
        gains: of this axis.
        period: since the step before, s.
        share: of the error that is integrated, 0 to 1.
        held: whether the vehicle itself is at a limit, so that integrating would only wind up.
    """
    rate = low_pass(memory.rate, error_rate, period, gains.derivative_filter_s)
    growth = gains.integral * share * error * period
    wanted = gains.proportional * error + memory.integral + growth + gains.derivative * rate
    correction = clip(wanted, -gains.greatest, gains.greatest)
    pushes_on = (wanted != correction) & (wanted * growth > 0.0)
    integral = memory.integral + where(pushes_on | held, growth * 0.0, growth)
    return correction, AxisMemory(
        integral=clip(integral, -gains.greatest, gains.greatest), rate=rate
    )


def pid_step(
    state: VehicleState[Number],
    motion: SlotMotion[Number],
    error: FormationError[Number],
    memory: PidMemory[Number],
    *,
    gains: PidGains[Number],
    airframe: Airframe,
    period: float,
    wind_feedforward: bool,
    rho: float,
) -> tuple[FollowerGuidance[Number], PidMemory[Number]]:
    """Setpoint of a follower, and what to remember.

    The corrected course and speed are what the vehicle's first-order holds are asked for: held at alpha and
    beta they turn into the wanted rates, which go through the same wind triangle and the same limits as
    those of the fields.

    Args:
        state: navigated state of the follower.
        motion: of its slot, at the same time.
        error: where the slot is, at the same time.
        memory: of the step before.
        gains: of both controllers.
        airframe: response and limits.
        period: since the step before, s.
        wind_feedforward: whether the wind's rate of change is taken off.
        rho: weight of the Lyapunov function that is reported, s².
    """
    share = nearness(error)
    turn, lateral = axis_step(
        error.cross_track,
        error.cross_track_rate,
        memory.lateral,
        gains.lateral,
        period=period,
        share=share,
        held=memory.limited,
    )
    push, longitudinal = axis_step(
        error.along_track,
        error.along_track_rate,
        memory.longitudinal,
        gains.longitudinal,
        period=period,
        share=share,
        held=memory.limited,
    )
    course_error = wrap_angle(state.course - (motion.course + turn))
    speed_error = state.ground_speed - (motion.speed + push)
    setpoint = setpoint_for(
        state,
        motion.acceleration - airframe.beta * speed_error,
        motion.turn_rate - airframe.alpha * course_error,
        airframe,
        wind_feedforward=wind_feedforward,
        hold=period,
    )
    guidance = FollowerGuidance(
        setpoint=setpoint,
        error=error,
        course_error=course_error,
        speed_error=speed_error,
        lyapunov=lyapunov(error, course_error, speed_error, rho),
    )
    remembered = PidMemory(lateral=lateral, longitudinal=longitudinal, limited=setpoint.limited)
    return guidance, remembered
