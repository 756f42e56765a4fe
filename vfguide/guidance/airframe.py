"""A fixed-wing aircraft: its wind triangle, its limits, its answer to setpoints, and its greatest bank.

**Wind triangle.** Ground velocity = air velocity + wind, and the accelerations that go with it (Beard and
McLain, Small Unmanned Aircraft: Theory and Practice, chapter 2; article, model equations).

**Answer to setpoints.** An autopilot answers after a dead time, with a lag; both directions are computed.
A course error asks for a bank, the roll follows with a lag, and the bank turns the aircraft. Without a
declared lag the hold is the ideal first-order one, dpsi/dt = alpha (chi^c - chi). With one it is ArduPlane's:
bank is proportional to the course error, and alpha is that of small errors at the cruise airspeed. Speed:
dV/dt = beta (V^c - V), within the vehicle's acceleration, with a lag where one is declared.

**Greatest bank**, learned in flight. While its bank hardly moves for `PLATEAU_S` the aircraft is on a
plateau. Below its limit the bank is proportional to the course error, whatever alpha is: plateaus of
smaller banks show the error that a bank takes. If every error meanwhile, and before by the aircraft's
delay, is `MORE` times that, more is asked than it gives. The limit is a bank of several such plateaus, or a
long one, never exceeded.
"""

import math
from collections import deque

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import (
    Number,
    clip,
    cos,
    cosine_and_sine,
    greater_of,
    hypot,
    square_root,
    wrap_angle,
)
from vfguide.state import GAP_S, Airframe, VehicleState


def resolve(north: Number, east: Number, direction: Number) -> tuple[Number, Number]:
    """Components of a horizontal vector (along, right of) a direction in radians."""
    ahead, aside = cosine_and_sine(direction)
    return north * ahead + east * aside, east * ahead - north * aside


def compose(along: Number, right: Number, direction: Number) -> tuple[Number, Number]:
    """(north, east) of a vector given by its components along and right of a direction."""
    ahead, aside = cosine_and_sine(direction)
    return along * ahead - right * aside, along * aside + right * ahead


def polar(length: Number, direction: Number) -> tuple[Number, Number]:
    """(north, east) of a vector given by its length and direction."""
    ahead, aside = cosine_and_sine(direction)
    return length * ahead, length * aside


def ground_speed_on_course(
    airspeed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Ground speed (m/s) at which an aircraft flies a course with a given airspeed.

    V_g = W_along + sqrt(V_a^2 - W_across^2). A wind across the course that is faster than the aircraft
    leaves no heading that holds the course: the root is then taken as 0, so that the value stays finite.
    """
    tail, cross = resolve(wind_north, wind_east, course)
    return tail + square_root(greater_of(airspeed * airspeed - cross * cross, 0.0))


def airspeed_for_ground_velocity(
    ground_speed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Airspeed (m/s) that gives a ground speed on a course: |v_g - w|."""
    tail, cross = resolve(wind_north, wind_east, course)
    return hypot(ground_speed - tail, cross)


def air_relative_rates(
    acceleration: Number,
    course_rate: Number,
    *,
    ground_speed: Number,
    course: Number,
    airspeed: Number,
    heading: Number,
    wind_rate_north: Number,
    wind_rate_east: Number,
) -> tuple[Number, Number]:
    """What airspeed and heading have to do for a wanted change of the ground velocity.

    The wanted ground acceleration is (dV_g/dt, V_g dchi/dt) along and right of the course. What the
    wind does by itself is taken off; the rest is resolved along and right of the heading, where it is
    (dV_a/dt, V_a dpsi/dt).

    Args:
        acceleration: wanted dV_g/dt, m/s².
        course_rate: wanted dchi/dt, rad/s.
        ground_speed: V_g, m/s.
        course: chi, rad.
        airspeed: V_a, m/s, positive.
        heading: psi, rad.
        wind_rate_north: rate of change of the wind's north component, m/s².
        wind_rate_east: rate of change of the wind's east component, m/s².

    Returns:
        (airspeed rate in m/s², heading rate in rad/s).
    """
    north, east = compose(acceleration, ground_speed * course_rate, course)
    along, right = resolve(north - wind_rate_north, east - wind_rate_east, heading)
    return along, right / airspeed


def heading_rate_at_constant_airspeed(
    course_rate: Number,
    *,
    ground_speed: Number,
    course: Number,
    airspeed: Number,
    heading: Number,
    wind_rate_north: Number,
    wind_rate_east: Number,
) -> Number:
    """Heading rate (rad/s) that turns the course at a wanted rate while the airspeed stays as it is.

    Right of the course, V_g dchi/dt = V_a dpsi/dt cos(psi - chi) + dW/dt; arguments as in
    `air_relative_rates`. A drift of more than 70 degrees is treated as one of 70: nearer to abeam, no
    heading rate turns the course.
    """
    _, wind_right = resolve(wind_rate_north, wind_rate_east, course)
    leverage = greater_of(cos(heading - course), 0.34)
    return (ground_speed * course_rate - wind_right) / (airspeed * leverage)


GRAVITY = 9.80665
"""Standard gravity, m/s²."""


GREATEST_LEAD = math.radians(150.0)
"""How far a course setpoint may lead the course: half a turn ahead an autopilot turns the other way."""


def saturation(value: float) -> float:
    """sat(.) of the sliding-mode laws: the value itself inside [-1, 1], its sign outside."""
    return clip(value, -1.0, 1.0)


def bank_limited_turn_rate(max_bank: float, speed: float) -> float:
    """Greatest turn rate (rad/s) of a coordinated turn: g tan(phi_max) / V.

    Args:
        max_bank: bank limit phi_max, rad, in (0, pi/2).
        speed: speed V through the medium that is turned in, m/s, positive.
    """
    return GRAVITY * math.tan(max_bank) / speed


def speed_range(state: VehicleState, airframe: Airframe) -> tuple[float, float]:
    """(slowest, fastest) that a vehicle's speed hold may be told, m/s.

    Of a heading hold it is the airspeed range; of a course hold the ground speeds that the airspeed range
    comes to on the present course, in the present wind.
    """
    if airframe.hold == "course-hold":
        return ground_speed_range(state.course, state.wind_north, state.wind_east, airframe)
    return airframe.airspeed_min, airframe.airspeed_max


def ground_speed_range(
    course: float, wind_north: float, wind_east: float, airframe: Airframe
) -> tuple[float, float]:
    """(slowest, fastest) ground speed on a course (rad) in a wind (m/s, toward), m/s: the wind triangle."""
    return (
        ground_speed_on_course(airframe.airspeed_min, course, wind_north, wind_east),
        ground_speed_on_course(airframe.airspeed_max, course, wind_north, wind_east),
    )


class Inner(msgspec.Struct, frozen=True, kw_only=True):
    """What the autopilot's loops are at the moment, beside the vehicle's own state."""

    bank: float = 0.0
    """phi, rad, positive right."""
    acceleration: float = 0.0
    """Acceleration of the speed that is held, m/s²."""


class Bias(msgspec.Struct, frozen=True, kw_only=True):
    """What the vehicle does beyond its model: a slow disturbance, or a model that is not quite right."""

    turn_rate: float = 0.0
    """rad/s."""
    acceleration: float = 0.0
    """m/s²."""


class ActiveSetpoint(msgspec.Struct, frozen=True, kw_only=True):
    """A setpoint that has reached the loops; None where there was none yet."""

    course: float | None
    """rad."""
    speed: float | None
    """m/s."""


def coordinated_turn_rate(bank: float, airspeed: float) -> float:
    """Turn rate omega = g tan(phi) / V, rad/s."""
    return GRAVITY * math.tan(bank) / airspeed


def coordinated_bank(turn_rate: float, airspeed: float, max_bank: float) -> float:
    """Bank phi = atan(omega V / g), rad, within the limit."""
    bank = math.atan(turn_rate * airspeed / GRAVITY)
    return min(max(bank, -max_bank), max_bank)


def wanted_bank(course_error: float, airspeed: float, airframe: Airframe) -> float:
    """Bank (rad) that the autopilot asks for when its course is off by this (rad)."""
    if airframe.course_lag == 0.0:
        turn_rate = airframe.alpha * course_error
        return coordinated_bank(turn_rate, airspeed, airframe.max_bank)
    bank = airframe.alpha * airframe.cruise / GRAVITY * course_error
    return min(max(bank, -airframe.max_bank), airframe.max_bank)


def course_error_for(turn_rate: float, airspeed: float, airframe: Airframe) -> float:
    """Course error (rad) that makes the autopilot turn at this rate (rad/s): `wanted_bank` backwards.

    It is at most `GREATEST_LEAD` to either side.
    """
    bank = coordinated_bank(turn_rate, airspeed, airframe.max_bank)
    if airframe.course_lag == 0.0:
        error = coordinated_turn_rate(bank, airspeed) / airframe.alpha
    else:
        error = bank * GRAVITY / (airframe.alpha * airframe.cruise)
    return min(max(error, -GREATEST_LEAD), GREATEST_LEAD)


def first_order_lag(value: float, target: float, step_s: float, lag_s: float) -> float:
    """What a first-order lag makes of a constant target after a step; at once where there is no lag."""
    return target + (value - target) * (math.exp(-step_s / lag_s) if lag_s > 0.0 else 0.0)


def propagate_inner(
    inner: Inner,
    state: VehicleState,
    active: ActiveSetpoint,
    step_s: float,
    airframe: Airframe,
) -> Inner:
    """The autopilot's loops a step later; without a setpoint they stay as they are."""
    bank, acceleration = inner.bank, inner.acceleration
    if active.course is not None:
        error = wrap_angle(active.course - state.course)
        target = wanted_bank(error, turning_speed(state, airframe), airframe)
        bank = first_order_lag(bank, target, step_s, airframe.course_lag)
    if active.speed is not None:
        target = airframe.beta * (active.speed - held_speed(state, airframe))
        target = min(max(target, -airframe.max_acceleration), airframe.max_acceleration)
        acceleration = first_order_lag(acceleration, target, step_s, airframe.speed_lag)
    return Inner(bank=bank, acceleration=acceleration)


def held_speed(state: VehicleState, airframe: Airframe) -> float:
    """The speed that the autopilot holds, m/s."""
    return state.ground_speed if airframe.hold == "course-hold" else state.airspeed


def held_direction(state: VehicleState, airframe: Airframe) -> float:
    """The direction that its turn rate turns, rad."""
    return state.course if airframe.hold == "course-hold" else state.heading


def turning_speed(state: VehicleState, airframe: Airframe) -> float:
    """Speed of the velocity that turns, m/s, never 0."""
    return max(held_speed(state, airframe), 1.0)


def propagate(
    state: VehicleState, inner: Inner, bias: Bias, step_s: float, airframe: Airframe
) -> VehicleState:
    """The vehicle a step later, its bank and acceleration as they are; the wind changes at its own rate."""
    turn_rate = coordinated_turn_rate(inner.bank, turning_speed(state, airframe)) + bias.turn_rate
    speed = max(
        held_speed(state, airframe) + (inner.acceleration + bias.acceleration) * step_s, 1.0
    )
    direction = held_direction(state, airframe) + turn_rate * step_s
    wind_north = state.wind_north + state.wind_rate_north * step_s
    wind_east = state.wind_east + state.wind_rate_east * step_s
    before_north, before_east = polar(state.ground_speed, state.course)
    after_north, after_east = polar(speed, direction)
    course, ground_speed, heading, airspeed = direction, speed, direction, speed
    if airframe.hold == "course-hold":
        airspeed = airspeed_for_ground_velocity(speed, direction, wind_north, wind_east)
        heading = math.atan2(after_east - wind_east, after_north - wind_north)
    else:
        after_north, after_east = after_north + wind_north, after_east + wind_east
        course, ground_speed = (
            math.atan2(after_east, after_north),
            math.hypot(after_north, after_east),
        )
    return replace(
        state,
        time_s=state.time_s + step_s,
        north=state.north + 0.5 * step_s * (before_north + after_north),
        east=state.east + 0.5 * step_s * (before_east + after_east),
        course=course,
        ground_speed=ground_speed,
        heading=heading,
        airspeed=airspeed,
        wind_north=wind_north,
        wind_east=wind_east,
    )


PLATEAU_S = 2.0
"""So long the bank hardly moves, s."""

STEADY = math.radians(3.0)
"""From the least to the greatest bank of a plateau, rad."""

MORE = 1.3
"""Times the error that a bank usually takes: so much is more than the aircraft gives."""

LEAST_BANK, LEAST_LIMIT = math.radians(3.0), math.radians(10.0)
"""rad; banks that are less tell nothing, and are no limit of any aircraft."""

SMALLER = math.radians(3.0)
"""rad by which a bank has to be smaller to tell what is usual."""

USUAL_S = 3.0
"""s of smaller banks that tell it."""

TAKE_S = 0.25
"""Moments on plateaus are taken so far apart, s."""

MOST_MOMENTS = 480
"""Of them, the newest."""

SAME = math.radians(2.5)
"""Plateaus that differ by less are of one limit; what goes further by more is beyond it, rad."""

APART_S = 3.0
"""Two plateaus at the same bank have so long between them, s."""

MUCH_MORE = 2.0
"""The same where no smaller banks were flown: an aircraft whose error grows twice as great at one bank."""

LEAST_S, LONG_S = 4.0, 10.0
"""Evidence that it takes, s beyond `PLATEAU_S` of each: on several plateaus, or on one."""


class BankMoment(msgspec.Struct, frozen=True, kw_only=True):
    """One report."""

    time_s: float
    """s."""
    bank: float
    """rad, positive right."""
    asked: float
    """Error of the course times V / g, s: times alpha it is the tangent of the bank that is asked for."""


class PlateauMoment(msgspec.Struct, frozen=True, kw_only=True):
    """A moment on a plateau."""

    level: float
    """Its bank to either side, rad."""
    usual: float
    """Mean error of the course over the plateau, over the tangent of the bank, as of `BankMoment`."""
    least: float
    """The least of that."""
    number: int
    """Of the plateau."""


class BankLimit:
    """Learns how far one aircraft banks."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self.value: float | None = None
        """The limit, rad; None while none is known."""
        self._moments: deque[BankMoment] = deque()
        self._plateaus: deque[PlateauMoment] = deque(maxlen=MOST_MOMENTS)
        self._number = 0
        self._taken_s = -math.inf
        self._level = 0.0
        self._greatest = 0.0

    def interrupt(self) -> None:
        """Forget the last moments: nothing is asked of it now."""
        self._moments.clear()

    def observe(self, moment: BankMoment, late: float) -> None:
        """Take a report.

        Args:
            moment: of the report.
            late: dead time and lag of the course at most, s.
        """
        now, moments = moment.time_s, self._moments
        if moments and not 0.0 <= now - moments[-1].time_s <= GAP_S:
            moments.clear()
        moments.append(moment)
        while now - moments[0].time_s > PLATEAU_S + late:
            moments.popleft()
        if now - self._taken_s < TAKE_S or now - moments[0].time_s < 0.9 * (PLATEAU_S + late):
            return
        banks = [one.bank for one in moments if now - one.time_s <= PLATEAU_S]
        level = sum(banks) / len(banks)
        further = abs(level) > self._greatest
        self._greatest = max(self._greatest, abs(level))
        on_plateau = max(banks) - min(banks) <= STEADY and abs(level) >= LEAST_BANK
        if on_plateau:
            tangent = math.tan(level)
            ratios = [one.asked / tangent for one in moments]
            is_same = abs(level - self._level) < SMALLER and now - self._taken_s < APART_S
            self._number += not is_same
            self._taken_s, self._level = now, level
            self._plateaus.append(
                PlateauMoment(
                    level=abs(level),
                    usual=sum(ratios) / len(ratios),
                    least=min(ratios),
                    number=self._number,
                )
            )
        if on_plateau or further:
            self.value = self._limit()

    def _limit(self) -> float | None:
        """Return the bank of all that was most, where more was asked for; None where it was not."""
        if self._greatest < LEAST_LIMIT:
            return None
        smaller = [one.usual for one in self._plateaus if one.level < self._greatest - SMALLER]
        top = [one for one in self._plateaus if one.level >= self._greatest - SAME]
        if len(smaller) * TAKE_S >= USUAL_S:
            enough = MORE * max(sum(smaller) / len(smaller), 0.0)
        else:
            enough = MUCH_MORE * max(min((one.usual for one in top), default=math.inf), 0.0)
        most = [one for one in top if one.least > enough]
        several = len({one.number for one in most}) > 1
        if len(most) * TAKE_S < (LEAST_S if several else LONG_S):
            return None
        return sum(one.level for one in most) / len(most)
