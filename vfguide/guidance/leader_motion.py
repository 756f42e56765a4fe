"""How the leader's motion changes, estimated by the leader itself for those who follow it."""

from vfguide.angles import wrap_angle
from vfguide.elementwise import Number, clip
from vfguide.guidance.limits import bank_limited_turn_rate
from vfguide.state import Airframe, LeaderState, VehicleState


def leader_at_rest(state: VehicleState[Number]) -> LeaderState[Number]:
    """Leader state from one navigated state alone: nothing is known of its changes yet."""
    still = state.course * 0.0
    return LeaderState(
        time_s=state.time_s,
        north=state.north,
        east=state.east,
        course=state.course,
        ground_speed=state.ground_speed,
        acceleration=still,
        turn_rate=still,
        turn_acceleration=still,
    )


def low_pass(previous: Number, target: Number, period: float, time_constant: float) -> Number:
    """First-order low-pass filter, backward Euler."""
    return previous + (period / (time_constant + period)) * (target - previous)


def estimate_leader(
    previous: LeaderState[Number],
    state: VehicleState[Number],
    airframe: Airframe,
    time_constant: float,
) -> LeaderState[Number]:
    """Leader state with dV/dt, omega and its rate, differentiated and low-passed.

    The raw rates are held within what the airframe can do: an outlier in omega turns the whole frame in
    which followers see their slots.

    Args:
        previous: the estimate before.
        state: navigated state of the leader, later than the estimate before.
        airframe: limits of the leader.
        time_constant: of the low-pass filters, s.
    """
    period = state.time_s - previous.time_s
    greatest_turn = bank_limited_turn_rate(airframe.max_bank, airframe.airspeed_min)
    raw_turn_rate = clip(
        wrap_angle(state.course - previous.course) / period, -greatest_turn, greatest_turn
    )
    # The wind accelerates a vehicle over ground as the engine does, so the bound is twice the engine's.
    greatest_acceleration = 2.0 * airframe.max_acceleration
    raw_acceleration = clip(
        (state.ground_speed - previous.ground_speed) / period,
        -greatest_acceleration,
        greatest_acceleration,
    )
    turn_rate = low_pass(previous.turn_rate, raw_turn_rate, period, time_constant)
    turn_acceleration = (turn_rate - previous.turn_rate) / period
    return LeaderState(
        time_s=state.time_s,
        north=state.north,
        east=state.east,
        course=state.course,
        ground_speed=state.ground_speed,
        acceleration=low_pass(previous.acceleration, raw_acceleration, period, time_constant),
        turn_rate=turn_rate,
        turn_acceleration=low_pass(
            previous.turn_acceleration, turn_acceleration, period, time_constant
        ),
    )
