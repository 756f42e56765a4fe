"""How the true airspeed compares with the one that is reported and commanded: from flying various directions.

    ground velocity = reported airspeed * (scale along the heading - slip * turn rate right of it) + wind

On a straight flight a wrong scale and a head wind look the same; on a turn the wind stays and the aircraft
turns. A Kalman filter of scale and wind tells them apart. While the wind itself changes it learns little.

Source: Cho, Kim, Lee and Kee, "Wind estimation and airspeed calibration using a UAV with a single-antenna GPS
receiver and pitot tube", IEEE Transactions on Aerospace and Electronic Systems 47(1), 2011.
"""

import math

import msgspec

from vfguide.elementwise import clip, low_pass

LEAST_SCALE, GREATEST_SCALE = 0.85, 1.25
"""Indicated against true airspeed at 3000 m is 1.16; the rest is the sensor's."""

SCALE_DEVIATION = 0.05
"""What is not known of the scale at first."""

WIND_DEVIATION = 10.0
"""The same of the wind, m/s."""

NOISE = 0.2
"""Standard deviation of a ground velocity against air velocity and wind, m/s: gusts, and slipping."""

STEADY_WIND_RATE = 0.1
"""m/s²: a wind that seems to change no faster may be a steady one, with the sensors' noise."""

CHANGE_S = 60.0
"""How much of a faster change counts as noise of the velocity, s: nothing can be learnt from it, since a wind
that turns with the aircraft, or on a straight flight any change at all, is taken for a wrong scale."""

SETTLED_SCALE, SETTLED_WIND = 0.02, 0.7
"""Standard deviations of scale and wind (m/s) below which they are used instead of a heading that slips."""

STEADY, STEADY_MEMORY_S = 0.75, 10.0
"""Root mean square of what the model leaves of a velocity, m/s, above which the wind is too unsteady for it,
and the memory, s. Real ArduPlanes leave 0.06 in smooth air and 0.3 to 0.7 in turbulence."""

SCALE_DRIFT = 3e-4
"""How much the scale changes, 1/sqrt(s): with altitude and temperature."""

LEAST_WIND_DRIFT = 0.05
"""How much a steady wind changes, m/s/sqrt(s)."""

SLIP_DEVIATION = 1.0
"""What is not known of the slip of a vehicle that does slip, s."""

Vector = tuple[float, float, float, float]
Matrix = tuple[Vector, Vector, Vector, Vector]


class Calibration(msgspec.Struct, frozen=True, kw_only=True):
    """What is known so far."""

    estimate: Vector = (1.0, 0.0, 0.0, 0.0)
    """Scale, wind toward north and toward east (m/s), slip (s): angle that the nose leads for each rad/s."""
    covariance: Matrix = (
        (SCALE_DEVIATION**2, 0.0, 0.0, 0.0),
        (0.0, WIND_DEVIATION**2, 0.0, 0.0),
        (0.0, 0.0, WIND_DEVIATION**2, 0.0),
        (0.0, 0.0, 0.0, 0.0),
    )
    """Covariance of the estimate; without a doubt of the slip it stays 0."""

    surprise: float = 4.0
    """Mean square of what the model leaves of a velocity, (m/s)²; great until it has shown to be small."""

    @property
    def scale(self) -> float:
        """True airspeed over the reported one, within what is possible."""
        return clip(self.estimate[0], LEAST_SCALE, GREATEST_SCALE)

    @property
    def is_settled(self) -> bool:
        """Whether scale and wind are known well enough to be flown by, and the wind is steady."""
        is_known = self.deviation < SETTLED_SCALE and self.covariance[1][1] < SETTLED_WIND**2
        return is_known and self.surprise < STEADY**2

    @property
    def deviation(self) -> float:
        """Standard deviation of the scale."""
        return math.sqrt(max(self.covariance[0][0], 0.0))


def calibration_of(*, slips: bool) -> Calibration:
    """Before the first report, of a vehicle whose nose leaves its direction in turns, or does not."""
    known = Calibration()
    last = (0.0, 0.0, 0.0, SLIP_DEVIATION**2 if slips else 0.0)
    return Calibration(covariance=(*known.covariance[:3], last))


def calibrated(
    before: Calibration,
    *,
    reported_airspeed: float,
    heading: float,
    turn_rate: float,
    velocity_north: float,
    velocity_east: float,
    wind_rate: float,
    period: float,
) -> Calibration:
    """The calibration after a report.

    Args:
        before: after the report before.
        reported_airspeed: m/s.
        heading: rad.
        turn_rate: of the heading, rad/s.
        velocity_north: over ground, m/s.
        velocity_east: over ground, m/s.
        wind_rate: how fast the wind seems to change, m/s², its amount.
        period: since the report before, s.
    """
    drift = max(wind_rate, LEAST_WIND_DRIFT) ** 2 * period
    spread = _with_added(before.covariance, (SCALE_DRIFT**2 * period, drift, drift, 0.0))
    ahead, aside = reported_airspeed * math.cos(heading), reported_airspeed * math.sin(heading)
    # A nose that leads to the right leaves the air velocity on its left.
    north = (ahead, 1.0, 0.0, turn_rate * aside)
    east = (aside, 0.0, 1.0, -turn_rate * ahead)
    estimate = before.estimate
    # One velocity is averaged over the reports of a second: their errors are not independent.
    unsteady = CHANGE_S * max(wind_rate - STEADY_WIND_RATE, 0.0)
    changing = max(before.surprise - STEADY**2, 0.0) * STEADY_MEMORY_S
    variance = (NOISE**2 + unsteady * unsteady + changing) / max(min(period, 1.0), 1e-3)
    surprise = before.surprise
    for row, seen in ((north, velocity_north), (east, velocity_east)):
        left = seen - _dot(row, before.estimate)
        surprise = low_pass(surprise, left * left, 0.5 * period, STEADY_MEMORY_S)
        estimate, spread = _updated(estimate, spread, row, seen, variance)
    return Calibration(estimate=estimate, covariance=spread, surprise=surprise)


def _with_added(matrix: Matrix, diagonal: Vector) -> Matrix:
    first, second, third, fourth = matrix
    return (
        (first[0] + diagonal[0], *first[1:]),
        (second[0], second[1] + diagonal[1], *second[2:]),
        (*third[:2], third[2] + diagonal[2], third[3]),
        (*fourth[:3], fourth[3] + diagonal[3]),
    )


def _updated(
    estimate: Vector, spread: Matrix, row: Vector, seen: float, noise: float
) -> tuple[Vector, Matrix]:
    """One scalar measurement: seen = row . estimate."""
    first, second, third, fourth = spread
    across = (_dot(first, row), _dot(second, row), _dot(third, row), _dot(fourth, row))
    surprise = seen - _dot(row, estimate)
    total = _dot(row, across) + noise
    return _less(estimate, -surprise / total, across), (
        _less(first, across[0] / total, across),
        _less(second, across[1] / total, across),
        _less(third, across[2] / total, across),
        _less(fourth, across[3] / total, across),
    )


def _less(line: Vector, gain: float, across: Vector) -> Vector:
    return (
        line[0] - gain * across[0],
        line[1] - gain * across[1],
        line[2] - gain * across[2],
        line[3] - gain * across[3],
    )


def _dot(first: Vector, second: Vector) -> float:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2] + first[3] * second[3]
