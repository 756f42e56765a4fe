"""Model of a fixed-wing aircraft: wind triangle, limits, response to setpoints, and learned bank limit.

**Wind triangle.** Ground velocity = air velocity + wind, and the accelerations that go with it (Beard and
McLain, Small Unmanned Aircraft: Theory and Practice, chapter 2; article, model equations).

**Response to setpoints.** An autopilot responds after a dead time, with a lag; the model runs forward and
inverse. A course error commands a bank, the roll follows with a lag, and the bank turns the aircraft. Without
a declared lag the hold is the ideal first-order one, dpsi/dt = alpha (chi^c - chi). With one it is
ArduPlane's: bank is proportional to the course error, and alpha is that of small errors at the cruise
airspeed. Speed: dV/dt = beta (V^c - V), within the vehicle's acceleration, with a lag where one is declared.

**Bank limit**, learned in flight. An aircraft whose bank hardly moves for `PLATEAU_S` is on a plateau. Below
its limit the bank is proportional to the course error, whatever alpha is: plateaus of smaller banks show the
usual ratio. The aircraft saturates where every error of the plateau, and of the response delay before it,
exceeds `MORE` times that ratio. The limit is a bank, never exceeded, of several such plateaus or a long one.
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
    """Return the components (along, right) of a horizontal vector in the frame of a direction (rad)."""
    ahead, aside = cosine_and_sine(direction)
    return north * ahead + east * aside, east * ahead - north * aside


def compose(along: Number, right: Number, direction: Number) -> tuple[Number, Number]:
    """Return (north, east) of a vector given by its components along and right of a direction (rad)."""
    ahead, aside = cosine_and_sine(direction)
    return along * ahead - right * aside, along * aside + right * ahead


def polar(length: Number, direction: Number) -> tuple[Number, Number]:
    """Return (north, east) of a vector given by its length and direction (rad)."""
    ahead, aside = cosine_and_sine(direction)
    return length * ahead, length * aside


def ground_speed_on_course(
    airspeed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Return the ground speed (m/s) of an aircraft on a course at a given airspeed.

    V_g = W_along + sqrt(V_a^2 - W_across^2). Where the crosswind exceeds the airspeed, no heading holds the
    course: the root is then taken as 0, so that the value stays finite.
    """
    tail, cross = resolve(wind_north, wind_east, course)
    return tail + square_root(greater_of(airspeed * airspeed - cross * cross, 0.0))


def airspeed_for_ground_velocity(
    ground_speed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Return the airspeed (m/s) of a ground velocity in a wind: |v_g - w|."""
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
    """Return the (airspeed rate in m/s², heading rate in rad/s) for a wanted change of ground velocity.

    The wanted ground acceleration is (dV_g/dt, V_g dchi/dt) along and right of the course. The wind's own
    acceleration is subtracted; the rest is resolved along and right of the heading, where it is (dV_a/dt, V_a
    dpsi/dt).

    Accelerations and wind rates (of the north and east components) in m/s², course rate in rad/s. Speeds V_g
    and V_a > 0 in m/s, course chi and heading psi in rad.
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
    """Return the heading rate (rad/s) that gives a wanted course rate at constant airspeed.

    Right of the course, V_g dchi/dt = V_a dpsi/dt cos(psi - chi) + dW/dt; arguments as in
    `air_relative_rates`. Drift angles are limited to 70 degrees: nearer to 90, no heading rate turns the
    course.
    """
    _, wind_right = resolve(wind_rate_north, wind_rate_east, course)
    leverage = greater_of(cos(heading - course), 0.34)
    return (ground_speed * course_rate - wind_right) / (airspeed * leverage)


GRAVITY = 9.80665
"""Standard gravity, m/s²."""


GREATEST_LEAD = math.radians(150.0)
"""Largest lead of a course setpoint over the course, rad: beyond 180° an autopilot turns the other way."""


def saturation(value: float) -> float:
    """Return sat(.) of the sliding-mode laws: the value itself inside [-1, 1], its sign outside."""
    return clip(value, -1.0, 1.0)


def bank_limited_turn_rate(max_bank: float, speed: float) -> float:
    """Return the largest rate (rad/s) of a coordinated turn: g tan(phi_max) / V.

    The bank limit is in (0, pi/2), rad; V > 0 is relative to the medium of the turn, m/s.
    """
    return GRAVITY * math.tan(max_bank) / speed


def speed_range(state: VehicleState, airframe: Airframe) -> tuple[float, float]:
    """Return the (slowest, fastest) setpoints of a vehicle's speed hold, m/s.

    For a heading hold this is the airspeed range. For a course hold it is the ground speeds that the airspeed
    range gives on the present course, in the present wind.
    """
    if airframe.hold == "course-hold":
        return ground_speed_range(state.course, state.wind_north, state.wind_east, airframe)
    return airframe.airspeed_min, airframe.airspeed_max


def ground_speed_range(
    course: float, wind_north: float, wind_east: float, airframe: Airframe
) -> tuple[float, float]:
    """Return the (slowest, fastest) ground speed, m/s, on a course (rad) in a wind (m/s, toward)."""
    return (
        ground_speed_on_course(airframe.airspeed_min, course, wind_north, wind_east),
        ground_speed_on_course(airframe.airspeed_max, course, wind_north, wind_east),
    )


class Inner(msgspec.Struct, frozen=True, kw_only=True):
    """State of the autopilot's loops, beside the vehicle's own state."""

    bank: float = 0.0
    """phi, rad, positive right."""
    acceleration: float = 0.0
    """Acceleration of the held speed, m/s²."""


class Bias(msgspec.Struct, frozen=True, kw_only=True):
    """Slow disturbance or model error: motion of the vehicle beyond its model."""

    turn_rate: float = 0.0
    """Additional turn rate, rad/s."""
    acceleration: float = 0.0
    """Additional acceleration, m/s²."""


class ActiveSetpoint(msgspec.Struct, frozen=True, kw_only=True):
    """Setpoint that has reached the loops; None before the first one."""

    course: float | None
    """Course, rad."""
    speed: float | None
    """Speed, m/s."""


def coordinated_turn_rate(bank: float, airspeed: float) -> float:
    """Return the turn rate omega = g tan(phi) / V, rad/s."""
    return GRAVITY * math.tan(bank) / airspeed


def coordinated_bank(turn_rate: float, airspeed: float, max_bank: float) -> float:
    """Return the bank phi = atan(omega V / g), rad, within the limit."""
    bank = math.atan(turn_rate * airspeed / GRAVITY)
    return min(max(bank, -max_bank), max_bank)


def wanted_bank(course_error: float, airspeed: float, airframe: Airframe) -> float:
    """Return the bank (rad) that the autopilot commands for a course error (rad)."""
    if airframe.course_lag == 0.0:
        turn_rate = airframe.alpha * course_error
        return coordinated_bank(turn_rate, airspeed, airframe.max_bank)
    bank = airframe.alpha * airframe.cruise / GRAVITY * course_error
    return min(max(bank, -airframe.max_bank), airframe.max_bank)


def course_error_for(turn_rate: float, airspeed: float, airframe: Airframe) -> float:
    """Return the course error (rad) for a turn rate (rad/s), within `GREATEST_LEAD`: invert `wanted_bank`."""
    bank = coordinated_bank(turn_rate, airspeed, airframe.max_bank)
    if airframe.course_lag == 0.0:
        error = coordinated_turn_rate(bank, airspeed) / airframe.alpha
    else:
        error = bank * GRAVITY / (airframe.alpha * airframe.cruise)
    return min(max(error, -GREATEST_LEAD), GREATEST_LEAD)


def first_order_lag(value: float, target: float, step_s: float, lag_s: float) -> float:
    """Return a first-order lag's value after a step toward a constant target; the target if the lag is 0."""
    return target + (value - target) * (math.exp(-step_s / lag_s) if lag_s > 0.0 else 0.0)


def propagate_inner(
    inner: Inner, state: VehicleState, active: ActiveSetpoint, step_s: float, airframe: Airframe
) -> Inner:
    """Return the state of the autopilot's loops a step later; a loop without a setpoint keeps its value."""
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
    """Return the speed that the autopilot holds, m/s: ground speed or airspeed."""
    return state.ground_speed if airframe.hold == "course-hold" else state.airspeed


def held_direction(state: VehicleState, airframe: Airframe) -> float:
    """Return the direction that the turn rate changes, rad: course or heading."""
    return state.course if airframe.hold == "course-hold" else state.heading


def turning_speed(state: VehicleState, airframe: Airframe) -> float:
    """Return the speed of the turning velocity, m/s, at least 1."""
    return max(held_speed(state, airframe), 1.0)


def propagate(
    state: VehicleState, inner: Inner, bias: Bias, step_s: float, airframe: Airframe
) -> VehicleState:
    """Return the vehicle a step later, at constant bank, acceleration and wind rate."""
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
"""Duration of a plateau, s."""

STEADY = math.radians(3.0)
"""Largest range of the bank on a plateau, rad."""

MORE = 1.3
"""Ratio of the course error to its usual value for the bank, above which the bank is saturated."""

LEAST_BANK, LEAST_LIMIT = math.radians(3.0), math.radians(10.0)
"""Smallest bank to learn from, and smallest plausible limit, rad."""

SMALLER = math.radians(3.0)
"""Difference by which a plateau's bank must be smaller to count for the usual ratio, rad."""

USUAL_S = 3.0
"""Time on smaller banks that the usual ratio requires, s."""

TAKE_S = 0.25
"""Interval of samples on plateaus, s."""

MOST_MOMENTS = 480
"""Number of samples kept."""

SAME = math.radians(2.5)
"""Tolerance of banks at one limit, rad."""

APART_S = 3.0
"""Time between two plateaus at the same bank, s."""

MUCH_MORE = 2.0
"""Value of `MORE` without smaller banks: the error must double at one bank."""

LEAST_S, LONG_S = 4.0, 10.0
"""Evidence required on several plateaus, or on one, s beyond `PLATEAU_S` of each."""


class BankMoment(msgspec.Struct, frozen=True, kw_only=True):
    """Bank and course error of one report."""

    time_s: float
    """Time, s."""
    bank: float
    """rad, positive right."""
    asked: float
    """Course error times V / g, s; times alpha it is the tangent of the commanded bank."""


class PlateauMoment(msgspec.Struct, frozen=True, kw_only=True):
    """Sample on a plateau."""

    level: float
    """Mean bank to either side, rad."""
    usual: float
    """Mean ratio of `BankMoment.asked` to the tangent of the bank, s."""
    least: float
    """Smallest ratio of `BankMoment.asked` to the tangent of the bank, s."""
    number: int
    """Number of the plateau."""


class BankLimit:
    """Estimator of an aircraft's bank limit."""

    def __init__(self) -> None:
        """Start without a limit."""
        self.value: float | None = None
        """Bank limit, rad; None while unknown."""
        self._moments: deque[BankMoment] = deque()
        self._plateaus: deque[PlateauMoment] = deque(maxlen=MOST_MOMENTS)
        self._number = 0
        self._taken_s = -math.inf
        self._level = 0.0
        self._greatest = 0.0

    def interrupt(self) -> None:
        """Forget the latest reports, while the aircraft receives no setpoints."""
        self._moments.clear()

    def observe(self, moment: BankMoment, late: float) -> None:
        """Add a report; `late` is the upper bound of the course hold's dead time and lag, s."""
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
        """Return the mean saturated bank near the largest bank flown; None without enough evidence."""
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
