"""What a vehicle would have done with some response: the models of `vfguide.guidance.airframe`, on arrays.

What was told and what was seen, as arrays.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import GRAVITY, coordinated_turn_rate, first_order_lag
from vfguide.state import Airframe


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """One stretch of a flight. All arrays but the setpoints' have one entry for each report."""

    time_s: FloatArray
    """Of the reports, s."""
    direction: FloatArray
    """What the turn rate turns, heading or course, unwrapped, rad."""
    speed: FloatArray
    """The speed that is held, m/s."""
    wind_north: FloatArray
    """Wind toward north, m/s; nothing where ground speed and course are held."""
    wind_east: FloatArray
    """Wind toward east, m/s."""
    told_s: FloatArray
    """When setpoints went out, s; the first before the first report."""
    told: FloatArray
    """The setpoints: course, unwrapped, rad, or speed, m/s."""


def mean_told(samples: Samples, dead_time: float) -> FloatArray:
    """Mean setpoint that acts between each report and the next, after a dead time (s).

    Exact for setpoints that are held until the next, and smooth in the dead time, so that it can be fitted.
    """
    knots = np.append(samples.told_s, max(samples.time_s[-1], samples.told_s[-1]) + 1.0)
    total = np.concatenate(([0.0], np.cumsum(samples.told * np.diff(knots))))
    # Before the first setpoint that is known there was another like it.
    first, early = knots[0], np.minimum(samples.time_s - dead_time - knots[0], 0.0)
    until = np.interp(np.maximum(samples.time_s - dead_time, first), knots, total)
    area = until + early * samples.told[0]
    mean: FloatArray = np.diff(area) / np.diff(samples.time_s)
    return mean


Parameters = tuple[float, float, float]
"""Bandwidth (1/s), dead time (s), lag (s)."""

SETTLED_S = 1.0
"""At the beginning of a stretch the vehicle has settled for at least this long."""


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
    """Its limits."""


def course_response(samples: Samples, parameters: Parameters, airframe: Airframe) -> FloatArray:
    """Direction (rad) at each report, as the model turns from the first one on."""
    alpha, dead_time, lag = parameters
    told = mean_told(samples, dead_time).tolist()
    times, speeds = samples.time_s.tolist(), samples.speed.tolist()
    north, east = samples.wind_north.tolist(), samples.wind_east.tolist()
    direction, bank = settled(samples.time_s, samples.direction), 0.0
    directions = [direction]
    for number, target in enumerate(told):
        vehicle = TurningVehicle(
            alpha, lag, max(speeds[number], 1.0), north[number], east[number], airframe
        )
        period = times[number + 1] - times[number]
        direction, bank = turned(direction, bank, target, vehicle, period)
        directions.append(direction)
    return np.array(directions)


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
    """Of the ideal first-order hold, rad/s, within the bank limit."""
    limit = coordinated_turn_rate(vehicle.airframe.max_bank, vehicle.speed)
    rate = vehicle.alpha * course_error(direction, target, vehicle)
    return min(max(rate, -limit), limit)


def bank_wanted(direction: float, target: float, vehicle: TurningVehicle) -> float:
    """Of a hold by bank, rad, within the limit."""
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
    told = mean_told(samples, dead_time).tolist()
    times = samples.time_s.tolist()
    speed, acceleration = settled(samples.time_s, samples.speed), 0.0
    limit = airframe.max_acceleration
    speeds = [speed]
    for number, target in enumerate(told):
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
