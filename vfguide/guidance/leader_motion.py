"""A leader's motion, estimated: by the leader itself, and by followers who only see where it is.

By itself: followers feed dV_g/dt and omega forward, so a late estimate is an error of theirs. A filter
that tracks a rate and how it changes itself is not late where the rate grows steadily, as it does in a
wind that swings; a first-order one is late by its time constant. Fading-memory filters as in
`navigation`.

By followers, of an aircraft that tells only where it is and perhaps its velocity: at one to ten reports a
second the rates matter as much as the place: between two reports a follower flies by them. Third-order
fading-memory filters: a turn that grows steadily leaves no error, and the place is carried along the arc
between reports. With velocities, course and speed are tracked; with positions alone, the place, and what
is left of it in the direction of flight and across it corrects speed and course.
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
    """What is known of a vehicle's motion."""

    state: LeaderState
    """What the others are told of it."""
    jerk: float
    """d²V_g/dt², m/s³: no follower needs it, the next estimate does."""


def motion_at_first(state: VehicleState) -> MotionEstimate:
    """From one navigated state alone: nothing is known of its changes yet."""
    return MotionEstimate(
        state=_leader_state(state, acceleration=0.0, turn_rate=0.0, turn_acceleration=0.0),
        jerk=0.0,
    )


def estimated_motion(
    previous: MotionEstimate,
    state: VehicleState,
    airframe: Airframe,
    time_constant: float,
) -> MotionEstimate:
    """The motion with dV_g/dt, omega and its rate: differences of course and speed, filtered.

    Rates are held within what the airframe can do: an outlier in omega turns the whole frame in which
    followers see their slots.

    Args:
        previous: the estimate before.
        state: navigated state of the vehicle, later than the estimate before.
        airframe: limits of the vehicle.
        time_constant: of the filters, s.
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
        # The wind accelerates a vehicle over ground as the engine does, so the bound is twice the engine's.
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
    before: tuple[float, float],
    raw: float,
    limit: float,
    period: float,
    time_constant: float,
) -> tuple[float, float]:
    """(rate, its own rate) after a raw rate that may be an outlier; the rate is held within +-limit."""
    gain, rate_gain = fading_memory_2(period, time_constant)
    expected = before[0] + before[1] * period
    surprise = clip(raw, -limit, limit) - expected
    return (
        clip(expected + gain * surprise, -limit, limit),
        before[1] + rate_gain / period * surprise,
    )


def _leader_state(
    state: VehicleState,
    *,
    acceleration: float,
    turn_rate: float,
    turn_acceleration: float,
) -> LeaderState:
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


LEAST_SPEED_M_S = 1.0
"""Below this a course is none."""

PERIODS = 0.7
"""Time constants are at least this many times the interval between reports: of less, noise is all."""

POSITION_S = 0.3
"""Memory of the place where velocities are told, s: less than that of any motion, more than of the noise."""


class Observation(msgspec.Struct, frozen=True, kw_only=True):
    """One report in the local frame."""

    time_s: float
    """s, on any clock that runs evenly."""
    north: float
    """m."""
    east: float
    """m."""
    velocity: tuple[float, float] | None = None
    """Over ground (north, east), m/s, if it is told."""


class ObservedMotion(msgspec.Struct, frozen=True, kw_only=True):
    """What is known of the motion."""

    state: LeaderState
    """Place, course, speed and their rates; times are those of the observations."""
    jerk: float = 0.0
    """How the acceleration changes, m/s³."""


class RateLimits(msgspec.Struct, frozen=True, kw_only=True):
    """What an aircraft can do: a report that says more is an outlier."""

    turn_rate: float
    """rad/s."""
    acceleration: float
    """Along the course, m/s²."""


def observed_at_first(seen: Observation, course: float, speed: float) -> ObservedMotion:
    """From one observation and a velocity (rad, m/s): straight on."""
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
    """The motion after an observation that is later than those before.

    Args:
        before: the estimate before.
        seen: the observation.
        limits: of the aircraft.
        time_constant: of the filters, s; longer where reports are rarer.
    """
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
    """Course and speed tracked, the place leaning on the reported one."""
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
    """The place tracked: what is left along and across corrects speed and course, and their rates."""
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
            # Positions show the turn rate by the square of the time: three orders end with it.
            turn_acceleration=0.0,
        )
    )


def _limited(found: ObservedMotion, limits: RateLimits) -> ObservedMotion:
    """Rates within what the aircraft can do; at a limit they do not grow any further."""
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
    """A motion to fly by that is this old: by all its rates for so long, then on the same arc at one speed.

    Args:
        state: as last observed.
        age_s: since then, s.
        trusted_s: how long its changes of speed and turn rate are believed to go on, s.
    """
    if age_s <= trusted_s:
        return state
    later = extrapolate_by_rates(state, state.time_s + trusted_s)
    return replace(later, acceleration=0.0, turn_acceleration=0.0)
