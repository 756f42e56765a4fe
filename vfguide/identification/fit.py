"""What a vehicle would have done with some response, and the response that fits what it did.

The models are those of `vfguide.guidance.airframe`, on arrays.

Bandwidth, dead time and lag are found by least squares over all of the flight, with their confidence.
SciPy's trust-region method within bounds; the intervals are those of linear regression at the solution,
with as many independent samples as the residuals' correlation leaves (Ljung, System Identification, 1999,
chapter 9).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import GRAVITY, coordinated_turn_rate, first_order_lag
from vfguide.state import Airframe

SETTLED_S = 1.0
"""At the beginning of a stretch the vehicle has settled for at least this long."""

LOWEST = np.array([0.02, 0.0, 0.02])

HIGHEST = np.array([20.0, 5.0, 5.0])

SETTLED = 1e-6
"""A step that lowers the sum of squares by less than this share was the last."""

STEP = 1e-4
"""Of the parameters, relative: models interpolate between reports, and are not smooth below this."""

LEAST_LAG = 0.08
"""s: less cannot be told from a dead time."""

LAG_GAIN = 0.85
"""A lag is believed where it brings the residuals down to less than this of what they are without."""

NORMAL_95 = 1.96


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """One stretch of a flight. All arrays but the setpoints' have one entry for each report."""

    time_s: FloatArray
    """Times of the reports, s."""
    direction: FloatArray
    """What the turn rate turns, heading or course, unwrapped, rad."""
    speed: FloatArray
    """The speed that is held, m/s."""
    wind_north: FloatArray
    """Wind toward north, m/s; nothing where ground speed and course are held."""
    wind_east: FloatArray
    """Wind toward east, m/s."""
    setpoint_s: FloatArray
    """When setpoints went out, s; the first before the first report."""
    setpoint: FloatArray
    """The setpoints: course, unwrapped, rad, or speed, m/s."""


def mean_setpoint(samples: Samples, dead_time: float) -> FloatArray:
    """Mean setpoint that acts between each report and the next, after a dead time (s).

    Exact for setpoints that are held until the next, and smooth in the dead time, so that it can be fitted.
    """
    knots = np.append(samples.setpoint_s, max(samples.time_s[-1], samples.setpoint_s[-1]) + 1.0)
    total = np.concatenate(([0.0], np.cumsum(samples.setpoint * np.diff(knots))))
    # Before the first setpoint that is known there was another like it.
    first, early = knots[0], np.minimum(samples.time_s - dead_time - knots[0], 0.0)
    until = np.interp(np.maximum(samples.time_s - dead_time, first), knots, total)
    area = until + early * samples.setpoint[0]
    mean: FloatArray = np.diff(area) / np.diff(samples.time_s)
    return mean


Parameters = tuple[float, float, float]
"""Bandwidth (1/s), dead time (s), lag (s)."""


class TurningVehicle(NamedTuple):
    """One vehicle that turns; a tuple, since thousands are made for each trial."""

    alpha: float
    """1/s."""
    lag: float
    """s."""
    speed: float
    """m/s."""
    wind_north: float
    """m/s."""
    wind_east: float
    """m/s."""
    airframe: Airframe
    """Limits of the vehicle."""


def course_response(samples: Samples, parameters: Parameters, airframe: Airframe) -> FloatArray:
    """Direction (rad) at each report, as the model turns from the first one on."""
    alpha, dead_time, lag = parameters
    setpoint = mean_setpoint(samples, dead_time).tolist()
    times, speeds = samples.time_s.tolist(), between(samples.speed)
    north, east = between(samples.wind_north), between(samples.wind_east)
    direction, bank = settled(samples.time_s, samples.direction), 0.0
    directions = [direction]
    for number, target in enumerate(setpoint):
        vehicle = TurningVehicle(
            alpha, lag, max(speeds[number], 1.0), north[number], east[number], airframe
        )
        period = times[number + 1] - times[number]
        direction, bank = turned(direction, bank, target, vehicle, period)
        directions.append(direction)
    return np.array(directions)


def between(values: FloatArray) -> list[float]:
    """Means of neighbours: what holds from one report to the next, where the values change evenly."""
    means: list[float] = (0.5 * (values[:-1] + values[1:])).tolist()
    return means


def settled(time_s: FloatArray, values: FloatArray) -> float:
    """Mean over the first moments, in which nothing happens yet: one report alone is as noisy as any."""
    return float(np.mean(values[time_s <= time_s[0] + SETTLED_S]))


def turned(
    direction: float, bank: float, target: float, vehicle: TurningVehicle, period: float
) -> tuple[float, float]:
    """(direction, bank) after a period, by a midpoint step; the roll is exact."""
    half = 0.5 * period
    if vehicle.lag <= 0.0:
        middle = direction + half * turn_rate(direction, target, vehicle)
        return direction + period * turn_rate(middle, target, vehicle), 0.0
    rolled = first_order_lag(bank, bank_wanted(direction, target, vehicle), half, vehicle.lag)
    middle = direction + half * coordinated_turn_rate(0.5 * (bank + rolled), vehicle.speed)
    wanted = bank_wanted(middle, target, vehicle)
    rolled = first_order_lag(bank, wanted, half, vehicle.lag)
    direction += period * coordinated_turn_rate(rolled, vehicle.speed)
    return direction, first_order_lag(bank, wanted, period, vehicle.lag)


def turn_rate(direction: float, target: float, vehicle: TurningVehicle) -> float:
    """Turn rate of the ideal first-order hold, rad/s, within the bank limit."""
    limit = coordinated_turn_rate(vehicle.airframe.max_bank, vehicle.speed)
    rate = vehicle.alpha * course_error(direction, target, vehicle)
    return min(max(rate, -limit), limit)


def bank_wanted(direction: float, target: float, vehicle: TurningVehicle) -> float:
    """Bank of a hold by bank, rad, within the limit."""
    gain = vehicle.alpha * vehicle.airframe.cruise / GRAVITY
    bank = gain * course_error(direction, target, vehicle)
    return min(max(bank, -vehicle.airframe.max_bank), vehicle.airframe.max_bank)


def course_error(direction: float, target: float, vehicle: TurningVehicle) -> float:
    """Setpoint minus course (rad); the course is the direction and the drift in the wind."""
    ahead, aside = math.cos(direction), math.sin(direction)
    along = vehicle.wind_north * ahead + vehicle.wind_east * aside
    across = vehicle.wind_east * ahead - vehicle.wind_north * aside
    drift = math.atan2(across, max(vehicle.speed + along, 0.1))
    return math.remainder(target - direction - drift, math.tau)


def speed_response(samples: Samples, parameters: Parameters, airframe: Airframe) -> FloatArray:
    """Speed (m/s) at each report, as the model accelerates from the first one on."""
    beta, dead_time, lag = parameters
    setpoint = mean_setpoint(samples, dead_time).tolist()
    times = samples.time_s.tolist()
    speed, acceleration = settled(samples.time_s, samples.speed), 0.0
    limit = airframe.max_acceleration
    speeds = [speed]
    for number, target in enumerate(setpoint):
        period = times[number + 1] - times[number]
        # The middle of the period, as far as the present acceleration tells.
        ahead = speed + 0.5 * period * acceleration if lag > 0.0 else speed
        wanted = min(max(beta * (target - ahead), -limit), limit)
        if lag > 0.0:
            middle = first_order_lag(acceleration, wanted, 0.5 * period, lag)
            acceleration = first_order_lag(acceleration, wanted, period, lag)
            speed += period * middle
        elif abs(wanted) < limit:
            speed = target + (speed - target) * math.exp(-beta * period)
        else:
            speed += period * wanted
        speeds.append(speed)
    return np.array(speeds)


Model = Callable[[Parameters], FloatArray]
"""What would have been seen with some response."""

STARTS: tuple[Parameters, ...] = ((1.0, 0.1, 0.2), (0.5, 0.5, 0.5))


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value that was measured."""

    value: float
    """The most likely."""
    half_width: float
    """Half width of the interval that holds the true value in 95 % of all cases, if the model is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """How a loop answers."""

    bandwidth: Estimate
    """alpha or beta, 1/s."""
    dead_time: Estimate
    """s."""
    lag: Estimate
    """s; 0 where none can be told."""
    residual: float
    """Root mean square of what the model leaves, rad or m/s."""
    modelled: FloatArray
    """What the model would have shown."""


def fit_response(model: Model, seen: FloatArray) -> Response:
    """The response that explains best what was seen; a lag only where it is needed."""
    plain = best_of(model, seen, free=(0, 1))
    lagging = best_of(model, seen, free=(0, 1, 2))
    needed = lagging.residual < LAG_GAIN * plain.residual and lagging.values[2] > LEAST_LAG
    best, free = (lagging, (0, 1, 2)) if needed else (plain, (0, 1))
    values, widths = best.values, half_widths(best, free)
    bandwidth, dead_time, lag = (
        Estimate(value=float(value), half_width=width)
        for value, width in zip(values, widths, strict=True)
    )
    return Response(
        bandwidth=bandwidth,
        dead_time=dead_time,
        lag=lag,
        residual=best.residual,
        modelled=model(as_parameters(values)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """The parameters that leave least."""

    values: FloatArray
    """All three; a lag that is not free is 0."""
    rest: FloatArray
    """What they leave of each sample."""
    slope: FloatArray
    """Derivatives of that by the free parameters."""

    @property
    def residual(self) -> float:
        """Root mean square of what they leave."""
        return math.sqrt(float(self.rest @ self.rest) / len(self.rest))


def best_of(model: Model, seen: FloatArray, free: tuple[int, ...]) -> Fit:
    """The best fit from all starts."""
    return min((fit(model, seen, start, free) for start in STARTS), key=lambda one: one.residual)


def fit(model: Model, seen: FloatArray, start: Parameters, free: tuple[int, ...]) -> Fit:
    """The fit that lies below a start."""
    from scipy.optimize import least_squares

    chosen = list(free)

    def values_of(part: FloatArray) -> FloatArray:
        values = np.zeros(3)
        values[chosen] = part
        return values

    found = least_squares(
        lambda part: seen - model(as_parameters(values_of(part))),
        np.array(start)[chosen],
        jac="3-point",
        bounds=(LOWEST[chosen], HIGHEST[chosen]),
        diff_step=STEP,
        ftol=SETTLED,
    )
    return Fit(values=values_of(found.x), rest=found.fun, slope=found.jac)


def half_widths(best: Fit, free: tuple[int, ...]) -> tuple[float, float, float]:
    """Half widths of the 95 % intervals; 0 for what was not fitted."""
    rest = best.rest
    degrees = max(len(rest) - len(free), 1)
    variance = float(rest @ rest) / degrees * correlation_factor(rest)
    covariance = variance * np.linalg.pinv(best.slope.T @ best.slope)
    widths = [0.0, 0.0, 0.0]
    for place, index in enumerate(free):
        widths[index] = NORMAL_95 * math.sqrt(max(float(covariance[place, place]), 0.0))
    return widths[0], widths[1], widths[2]


def smoothed(time_s: FloatArray, values: FloatArray, width_s: float) -> FloatArray:
    """Running mean over some seconds, as wide to either side as there is room."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    half = 0.5 * width_s
    low = np.searchsorted(time_s, time_s - half, side="left")
    high = np.searchsorted(time_s, time_s + half, side="right")
    mean: FloatArray = (total[high] - total[low]) / (high - low)
    return mean


def correlation_factor(rest: FloatArray) -> float:
    """How many times fewer samples there are than it seems, from the correlation of neighbours."""
    power = float(rest @ rest)
    if power == 0.0:
        return 1.0
    correlation = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.99)
    return (1.0 + correlation) / (1.0 - correlation)


def as_parameters(values: FloatArray) -> Parameters:
    """The array as what models take."""
    bandwidth, dead_time, lag = values.tolist()
    return bandwidth, dead_time, lag
