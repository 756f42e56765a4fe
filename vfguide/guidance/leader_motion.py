"""Estimation of a leader's motion, by the leader itself and by followers that only see its position.

**Own motion.** Followers feed dV_g/dt and omega forward, so a late estimate becomes their error. A filter
that tracks a rate and its derivative has no lag where the rate grows steadily, as in a wind that swings. A
first-order one lags by its time constant. Fading-memory filters as in `navigation`.

**Observed motion** of an aircraft that reports only its position and perhaps its velocity, one to ten times a
second. Between reports a follower flies by the rates, so they matter as much as the position. Third-order
fading-memory filters leave no error in a turn that grows steadily, and carry the position along the arc
between reports. With velocities, course and speed are tracked. With positions alone, the position is tracked,
and its residuals along and across the direction of flight correct speed and course.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, resolve
from vfguide.guidance.formation import extrapolate_by_rates
from vfguide.guidance.navigation import fading_memory_2, fading_memory_3
from vfguide.state import Airframe, LeaderState, VehicleState


class MotionEstimate(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of a vehicle's own motion."""

    state: LeaderState
    """State to broadcast."""
    jerk: float
    """d²V_g/dt², m/s³, used only by the next estimate."""


def motion_at_first(state: VehicleState) -> MotionEstimate:
    """Start from one navigated state, with all rates zero."""
    return MotionEstimate(
        state=_leader_state(state, acceleration=0.0, turn_rate=0.0, turn_acceleration=0.0), jerk=0.0
    )


def estimated_motion(
    previous: MotionEstimate, state: VehicleState, airframe: Airframe, time_constant: float
) -> MotionEstimate:
    """Update the motion with dV_g/dt, omega and its rate: filtered differences of course and speed.

    Rates are held within the airframe's limits: an outlier in omega turns the followers' whole slot frame.
    `state` is later than the previous estimate; `time_constant` is that of the filters, s.
    """
    before = previous.state
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
        # Wind accelerates a vehicle over ground as its engine does: twice the engine's limit.
        2.0 * airframe.max_acceleration,
        period,
        time_constant,
    )
    return MotionEstimate(
        state=_leader_state(
            state,
            acceleration=acceleration,
            turn_rate=turn_rate,
            turn_acceleration=turn_acceleration,
        ),
        jerk=jerk,
    )


def _tracked(
    before: tuple[float, float], raw: float, limit: float, period: float, time_constant: float
) -> tuple[float, float]:
    """Update (rate, its derivative) with a raw rate, possibly an outlier; the rate stays within ±limit."""
    gain, rate_gain = fading_memory_2(period, time_constant)
    expected = before[0] + before[1] * period
    surprise = clip(raw, -limit, limit) - expected
    return (
        clip(expected + gain * surprise, -limit, limit),
        before[1] + rate_gain / period * surprise,
    )


def _leader_state(
    state: VehicleState, *, acceleration: float, turn_rate: float, turn_acceleration: float
) -> LeaderState:
    """Return a navigated state with its rates."""
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


LEAST_SPEED_M_S = 1.0
"""Ground speed below which a course is meaningless, m/s."""

PERIODS = 0.7
"""Smallest time constant in intervals between reports: shorter ones pass only noise."""

POSITION_S = 0.3
"""Time constant of positions where velocities are reported, s: below a motion's, above the noise's."""


class Observation(msgspec.Struct, frozen=True, kw_only=True):
    """Position report in the local frame."""

    time_s: float
    """Time on any clock that runs evenly, s."""
    north: float
    """North coordinate, m."""
    east: float
    """East coordinate, m."""
    velocity: tuple[float, float] | None = None
    """Velocity over ground (north, east), m/s, or None where not reported."""


class ObservedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of an observed motion."""

    state: LeaderState
    """Position, course, speed and their rates, on the clock of the observations."""
    jerk: float = 0.0
    """Rate of the acceleration, m/s³."""


class RateLimits(msgspec.Struct, frozen=True, kw_only=True):
    """Rates that an aircraft can reach: a report beyond them is an outlier."""

    turn_rate: float
    """Largest turn rate, rad/s."""
    acceleration: float
    """Largest acceleration along the course, m/s²."""


def observed_at_first(seen: Observation, course: float, speed: float) -> ObservedMotion:
    """Start in straight flight from one observation, a course (rad) and a speed (m/s)."""
    return ObservedMotion(
        state=LeaderState(
            time_s=seen.time_s,
            north=seen.north,
            east=seen.east,
            course=course,
            ground_speed=speed,
            acceleration=0.0,
            turn_rate=0.0,
            turn_acceleration=0.0,
        )
    )


def observed_motion(
    before: ObservedMotion, seen: Observation, limits: RateLimits, time_constant: float
) -> ObservedMotion:
    """Update the motion with a later observation; `time_constant` (s) is longer where reports are rarer."""
    period = seen.time_s - before.state.time_s
    tau = max(time_constant, PERIODS * period)
    carried = extrapolate_by_rates(before.state, seen.time_s)
    if seen.velocity is None:
        found = _by_place(before, carried, seen, tau)
    else:
        found = _by_velocity(before, carried, seen, seen.velocity, tau)
    return _limited(found, limits)


def _by_velocity(
    before: ObservedMotion,
    carried: LeaderState,
    seen: Observation,
    velocity: tuple[float, float],
    tau: float,
) -> ObservedMotion:
    """Track course and speed; low-pass the position toward the reported one."""
    period = seen.time_s - before.state.time_s
    gain, rate_gain, second_gain = fading_memory_3(period, tau)
    speed = math.hypot(*velocity)
    slow = speed < LEAST_SPEED_M_S
    turned = 0.0 if slow else wrap_angle(math.atan2(velocity[1], velocity[0]) - carried.course)
    faster = speed - carried.ground_speed
    lean = period / (POSITION_S + period)
    state = replace(
        carried,
        north=carried.north + lean * (seen.north - carried.north),
        east=carried.east + lean * (seen.east - carried.east),
        course=carried.course + gain * turned,
        ground_speed=max(carried.ground_speed + gain * faster, 0.0),
        acceleration=carried.acceleration + before.jerk * period + rate_gain / period * faster,
        turn_rate=carried.turn_rate + rate_gain / period * turned,
        turn_acceleration=carried.turn_acceleration + 2.0 * second_gain / period**2 * turned,
    )
    jerk = before.jerk + 2.0 * second_gain / period**2 * faster
    return ObservedMotion(state=state, jerk=jerk)


def _by_place(
    before: ObservedMotion, carried: LeaderState, seen: Observation, tau: float
) -> ObservedMotion:
    """Track the position; its residuals along and across correct speed, course and their rates."""
    period = seen.time_s - before.state.time_s
    gain, rate_gain, second_gain = fading_memory_3(period, tau)
    north, east = seen.north - carried.north, seen.east - carried.east
    along, right = resolve(north, east, carried.course)
    speed = max(carried.ground_speed, LEAST_SPEED_M_S)
    jerk_gain = 2.0 * second_gain / period**2
    return ObservedMotion(
        state=replace(
            carried,
            north=carried.north + gain * north,
            east=carried.east + gain * east,
            course=carried.course + rate_gain / period * right / speed,
            ground_speed=max(carried.ground_speed + rate_gain / period * along, 0.0),
            acceleration=carried.acceleration + jerk_gain * along,
            turn_rate=carried.turn_rate + jerk_gain * right / speed,
            # Positions show the turn rate through the square of time: a third-order filter ends there.
            turn_acceleration=0.0,
        )
    )


def _limited(found: ObservedMotion, limits: RateLimits) -> ObservedMotion:
    """Clip rates to the aircraft's limits; at a limit they do not grow further."""
    state = found.state
    turn_rate = min(max(state.turn_rate, -limits.turn_rate), limits.turn_rate)
    acceleration = min(max(state.acceleration, -limits.acceleration), limits.acceleration)
    within_turn, within = turn_rate == state.turn_rate, acceleration == state.acceleration
    limited = replace(
        state,
        turn_rate=turn_rate,
        acceleration=acceleration,
        turn_acceleration=state.turn_acceleration if within_turn else 0.0,
    )
    return ObservedMotion(state=limited, jerk=found.jerk if within else 0.0)


def carried_on(state: LeaderState, age_s: float, trusted_s: float) -> LeaderState:
    """Return a motion to extrapolate from: after `trusted_s` at constant speed and turn rate.

    `age_s` is its age, s; until `trusted_s` its changes of speed and turn rate are extrapolated.
    """
    if age_s <= trusted_s:
        return state
    later = extrapolate_by_rates(state, state.time_s + trusted_s)
    return replace(later, acceleration=0.0, turn_acceleration=0.0)
