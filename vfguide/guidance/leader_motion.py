"""How a vehicle's motion changes, estimated by itself for those who follow it.

Followers feed dV_g/dt and omega forward, so a late estimate is an error of theirs. A filter that tracks
a rate and how it changes itself is not late where the rate grows steadily, as it does in a wind that
swings; a first-order one is late by its time constant. Fading-memory filters as in `navigation`.
"""

from dataclasses import dataclass
from typing import Generic

from vfguide.angles import wrap_angle
from vfguide.elementwise import Number, clip
from vfguide.guidance.limits import bank_limited_turn_rate
from vfguide.guidance.navigation import fading_memory_2
from vfguide.state import Airframe, LeaderState, VehicleState


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEstimate(Generic[Number]):
    """What is known of a vehicle's motion."""

    told: LeaderState[Number]
    """What the others are told of it."""
    jerk: Number
    """d²V_g/dt², m/s³: no follower needs it, the next estimate does."""


def motion_at_first(state: VehicleState[Number]) -> MotionEstimate[Number]:
    """From one navigated state alone: nothing is known of its changes yet."""
    still = state.course * 0.0
    return MotionEstimate(
        told=_told(state, acceleration=still, turn_rate=still, turn_acceleration=still), jerk=still
    )


def estimated_motion(
    previous: MotionEstimate[Number],
    state: VehicleState[Number],
    airframe: Airframe,
    time_constant: float,
) -> MotionEstimate[Number]:
    """The motion with dV_g/dt, omega and its rate: differences of course and speed, filtered.

    Rates are held within what the airframe can do: an outlier in omega turns the whole frame in which
    followers see their slots.

    Args:
        previous: the estimate before.
        state: navigated state of the vehicle, later than the estimate before.
        airframe: limits of the vehicle.
        time_constant: of the filters, s.
    """
    before = previous.told
    period = state.time_s - before.time_s
    turn_limit = bank_limited_turn_rate(airframe.max_bank, airframe.airspeed_min)
    turn_rate, turn_acceleration = _tracked(
        (before.turn_rate, before.turn_acceleration),
        wrap_angle(state.course - before.course) / period,
        turn_limit,
        period,
        time_constant,
    )
    acceleration, jerk = _tracked(
        (before.acceleration, previous.jerk),
        (state.ground_speed - before.ground_speed) / period,
        # The wind accelerates a vehicle over ground as the engine does, so the bound is twice the engine's.
        2.0 * airframe.max_acceleration,
        period,
        time_constant,
    )
    return MotionEstimate(
        told=_told(
            state,
            acceleration=acceleration,
            turn_rate=turn_rate,
            turn_acceleration=turn_acceleration,
        ),
        jerk=jerk,
    )


def _tracked(
    before: tuple[Number, Number],
    raw: Number,
    limit: float,
    period: float,
    time_constant: float,
) -> tuple[Number, Number]:
    """(rate, its own rate) after a raw rate that may be an outlier; the rate is held within +-limit."""
    gain, rate_gain = fading_memory_2(period, time_constant)
    expected = before[0] + before[1] * period
    surprise = clip(raw, -limit, limit) - expected
    return (
        clip(expected + gain * surprise, -limit, limit),
        before[1] + rate_gain / period * surprise,
    )


def _told(
    state: VehicleState[Number],
    *,
    acceleration: Number,
    turn_rate: Number,
    turn_acceleration: Number,
) -> LeaderState[Number]:
    """A navigated state, and how it changes."""
    return LeaderState(
        time_s=state.time_s,
        north=state.north,
        east=state.east,
        course=state.course,
        ground_speed=state.ground_speed,
        acceleration=acceleration,
        turn_rate=turn_rate,
        turn_acceleration=turn_acceleration,
        height=state.height,
        climb_rate=state.climb_rate,
    )
