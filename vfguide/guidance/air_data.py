"""Flight estimates of a vehicle's airspeed calibration, turn efficiency and airspeed trim.

**Airspeed calibration.** A Kalman filter estimates scale, slip and wind from flight in various directions:

    ground velocity = reported airspeed * (scale along the heading - slip * turn rate right of it) + wind

In straight flight a wrong scale and a head wind look the same. In a turn the wind stays and the aircraft
turns, which tells them apart. While the wind itself changes, the filter learns little.

Source: Cho, Kim, Lee and Kee, "Wind estimation and airspeed calibration using a UAV with a single-antenna GPS
receiver and pitot tube", IEEE Transactions on Aerospace and Electronic Systems 47(1), 2011.

**Turn efficiency.** A scalar Kalman filter; 1 is a coordinated turn, less is a slipping turn:

    turn rate = turn efficiency * g tan(bank) / V

Two sources give the turn rate: the heading, which a changing wind also turns, and the acceleration over
ground, which gusts disturb. Where they disagree, the estimate becomes uncertain. Straight flight shows
nothing. ArduPilot's simulated plane has 0.745 to 0.85, by its place on a circle in wind: only the slow mean
is learned.

**Creeping airspeed hold.** Where FW_THR_ASPD_MIN and FW_THR_ASPD_MAX are not set, PX4 flies every airspeed
with the throttle FW_THR_TRIM. Part of a speed change comes within 2 s; its integrator brings the rest within
a minute. A setpoint that exaggerates the change by the missing part yields the wanted airspeed.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.airframe import GRAVITY
from vfguide.state import GAP_S

LEAST_SCALE, GREATEST_SCALE = 0.85, 1.25
"""Bounds of the scale: true over indicated airspeed is 1.16 at 3000 m; the rest is sensor error."""

SCALE_DEVIATION = 0.05
"""Initial standard deviation of the scale."""

WIND_DEVIATION = 10.0
"""Initial standard deviation of each wind component, m/s."""

VELOCITY_NOISE = 0.2
"""Standard deviation of ground velocity against air velocity plus wind, m/s: gusts and slip."""

STEADY_WIND_RATE = 0.1
"""Apparent change of the wind that sensor noise alone may cause in a steady wind, m/s²."""

CHANGE_S = 60.0
"""Velocity noise for each m/s² of faster wind change, s: a wind that turns with the aircraft, or any change
in straight flight, would be taken for a wrong scale."""

SETTLED_SCALE, SETTLED_WIND = 0.02, 0.7
"""Standard deviations of scale and wind (m/s) below which they replace a heading that slips."""

STEADY, STEADY_MEMORY_S = 0.75, 10.0
"""Largest RMS velocity residual (m/s) at which the wind counts as steady, and its time constant, s. Real
ArduPlanes leave 0.06 in smooth air and 0.3 to 0.7 in turbulence."""

SCALE_DRIFT = 3e-4
"""Random walk of the scale, 1/sqrt(s): altitude and temperature."""

LEAST_WIND_DRIFT = 0.05
"""Random walk of a steady wind, m/s/sqrt(s)."""

SLIP_DEVIATION = 1.0
"""Initial standard deviation of the slip of a vehicle that slips, s."""

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]


class Calibration(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of airspeed scale, wind and slip."""

    estimate: Vector = (1.0, 0.0, 0.0, 0.0)
    """Scale, wind toward north and east (m/s), slip (s): the nose's lead angle for each rad/s of turn."""
    covariance: Matrix = (
        (SCALE_DEVIATION**2, 0.0, 0.0, 0.0),
        (0.0, WIND_DEVIATION**2, 0.0, 0.0),
        (0.0, 0.0, WIND_DEVIATION**2, 0.0),
        (0.0, 0.0, 0.0, 0.0),
    )
    """Covariance of the estimate; the slip's stays 0 for a vehicle that does not slip."""

    surprise: float = 4.0
    """Mean square velocity residual, (m/s)²; starts large, so that the wind must first prove steady."""

    @property
    def scale(self) -> float:
        """True over reported airspeed, within its bounds."""
        return clip(self.estimate[0], LEAST_SCALE, GREATEST_SCALE)

    @property
    def is_settled(self) -> bool:
        """Whether scale and wind are known well enough for guidance, and the wind is steady."""
        is_known = self.deviation < SETTLED_SCALE and self.covariance[1][1] < SETTLED_WIND**2
        return is_known and self.surprise < STEADY**2

    @property
    def deviation(self) -> float:
        """Standard deviation of the scale."""
        return math.sqrt(max(self.covariance[0][0], 0.0))


def calibration_of(*, slips: bool) -> Calibration:
    """Return the initial calibration of a vehicle that slips in turns, or does not."""
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
    """Update the calibration with a report.

    Angles in rad, rates in rad/s, speeds in m/s, velocities over ground. `wind_rate` is the magnitude of the
    wind's apparent change, m/s²; `period` is the time since the previous report, s.
    """
    drift = max(wind_rate, LEAST_WIND_DRIFT) ** 2 * period
    spread = _with_added(before.covariance, (SCALE_DRIFT**2 * period, drift, drift, 0.0))
    ahead, aside = reported_airspeed * math.cos(heading), reported_airspeed * math.sin(heading)
    # A nose that leads to the right has the air velocity on its left.
    north = (ahead, 1.0, 0.0, turn_rate * aside)
    east = (aside, 0.0, 1.0, -turn_rate * ahead)
    estimate = before.estimate
    # Errors of reports within a second are correlated: together they count as one velocity.
    unsteady = CHANGE_S * max(wind_rate - STEADY_WIND_RATE, 0.0)
    changing = max(before.surprise - STEADY**2, 0.0) * STEADY_MEMORY_S
    variance = (VELOCITY_NOISE**2 + unsteady * unsteady + changing) / max(min(period, 1.0), 1e-3)
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
    """Update with one scalar measurement, seen = row . estimate."""
    a, b, c, d = row
    across = [a * k + b * m + c * n + d * o for k, m, n, o in spread]
    p, q, r, s = across
    total = a * p + b * q + c * r + d * s + noise
    gains = [-(seen - _dot(row, estimate)) / total, *[one / total for one in across]]
    updated, *smaller = [
        (k - gain * p, m - gain * q, n - gain * r, o - gain * s)
        for gain, (k, m, n, o) in zip(gains, (estimate, *spread), strict=True)
    ]
    return updated, tuple(smaller)


def _dot(first: Vector, second: Vector) -> float:
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2] + first[3] * second[3]


LEAST, GREATEST = 0.5, 1.1
"""Bounds of the turn efficiency of any vehicle."""

PRIOR, PRIOR_DEVIATION = 0.9, 0.15
"""Initial efficiency, half way between slipping and coordinated vehicles, and its standard deviation."""

SMOOTHED_S = 1.0
"""Time constant for both bank and turn rate: a yaw oscillation at 0.9 Hz is reduced to a sixth."""

LEAST_BANK = math.radians(5.0)
"""Smallest bank to learn from, rad: below it, trim and noise dominate."""

TURN_NOISE = 0.02
"""Standard deviation of the smoothed turn rate against its value from the smoothed bank, rad/s."""

NOISE_S = 2.0
"""Correlation time of the turn rate's error, s: gusts and residual oscillation."""

DRIFT = 0.005
"""Random walk of the efficiency, 1/sqrt(s): a memory of one minute in a turn of 0.1 rad/s."""

GREATEST_TURN_RATE = 10.0
"""Limit of plausible turn rates, rad/s."""

KNOWN = 0.05
"""Standard deviation below which the efficiency is known."""

SLIPS_BELOW, COORDINATED_ABOVE = 0.88, 0.92
"""Hysteresis: a vehicle slips below the first and is coordinated above the second efficiency."""


class TurnEfficiency(msgspec.Struct, frozen=True, kw_only=True):
    """Estimate of the turn efficiency."""

    value: float = PRIOR
    """Turn rate over g tan(bank) / V."""
    variance: float = PRIOR_DEVIATION**2
    """Variance of the efficiency."""
    by_bank: float = 0.0
    """Smoothed g tan(bank) / V, rad/s."""
    turn_rate: float = 0.0
    """Smoothed turn rate, rad/s."""
    seen_s: float = 0.0
    """Duration of smoothing without a gap, s."""

    @property
    def is_known(self) -> bool:
        """Whether the efficiency is known well enough for guidance."""
        return math.sqrt(self.variance) < KNOWN

    def slips(self, *, before: bool) -> bool:
        """Check whether the vehicle slips; the previous answer stays where nothing else is known."""
        if not self.is_known:
            return before
        return self.value < (COORDINATED_ABOVE if before else SLIPS_BELOW)


def agreed(first: TurnEfficiency, second: TurnEfficiency) -> TurnEfficiency:
    """Combine the estimates of two sources; their disagreement adds to the variance."""
    apart = first.value - second.value
    return replace(
        first,
        value=0.5 * (first.value + second.value),
        variance=max(first.variance, second.variance) + 0.25 * apart * apart,
    )


def learned(
    before: TurnEfficiency, *, bank: float, airspeed: float, turn_rate: float, period: float
) -> TurnEfficiency:
    """Update the efficiency with a report; one with a missing or impossible number changes nothing.

    Bank in rad, positive right; true airspeed in m/s; mean turn rate over `period` (s) in rad/s.
    """
    if not math.isfinite(bank + airspeed + turn_rate + period):
        return before
    possible = abs(bank) < 0.5 * math.pi and abs(turn_rate) < GREATEST_TURN_RATE
    if not (airspeed > 1.0 and possible):
        return before
    if not 0.0 < period <= GAP_S:
        return replace(before, seen_s=0.0)
    by_bank = GRAVITY * math.tan(bank) / airspeed
    if before.seen_s == 0.0:
        seen = replace(before, by_bank=by_bank, turn_rate=turn_rate, seen_s=period)
    else:
        seen = replace(
            before,
            by_bank=low_pass(before.by_bank, by_bank, period, SMOOTHED_S),
            turn_rate=low_pass(before.turn_rate, turn_rate, period, SMOOTHED_S),
            seen_s=before.seen_s + period,
        )
    banked = abs(seen.by_bank) * airspeed > GRAVITY * math.tan(LEAST_BANK)
    if not banked or seen.seen_s < NOISE_S:
        return seen
    variance = seen.variance + DRIFT * DRIFT * period
    # Errors within NOISE_S are correlated: together they count as one measurement.
    noise = TURN_NOISE * TURN_NOISE * NOISE_S / period
    gain = variance * seen.by_bank / (variance * seen.by_bank**2 + noise)
    value = seen.value + gain * (seen.turn_rate - seen.value * seen.by_bank)
    return replace(
        seen, value=clip(value, LEAST, GREATEST), variance=(1.0 - gain * seen.by_bank) * variance
    )


class CreepingHold(msgspec.Struct, frozen=True, kw_only=True):
    """Measured step response of a creeping airspeed hold."""

    share: float
    """Immediate part of an airspeed step, in (0, 1]."""
    time: float
    """Time constant of the remaining part, s."""


class CreepingSpeed:
    """Airspeed setpoints for a creeping hold, from an estimate of its trim."""

    def __init__(self, hold: CreepingHold) -> None:
        """Start without a trim: the first airspeed flown counts as the trim."""
        self._hold = hold
        self._trim: float | None = None
        self._asked = self._time_s = 0.0

    def asked_for(
        self, wanted: float, flown: float, now: float, *, slowest: float, fastest: float
    ) -> float:
        """Return the airspeed setpoint (m/s) that yields the wanted airspeed, within the limits.

        All speeds are airspeeds in m/s, `flown` the present one; `now` (s) must rise from call to call.
        """
        if self._trim is None:
            self._trim = flown
        else:
            passed_s = min(now - self._time_s, self._hold.time)
            self._trim += (self._asked - self._trim) * passed_s / self._hold.time
        self._time_s = now
        more = (wanted - self._trim) / self._hold.share
        self._asked = min(max(self._trim + more, slowest), fastest)
        return self._asked

    def reset(self) -> None:
        """Forget the trim, after another source has commanded airspeeds."""
        self._trim = None
