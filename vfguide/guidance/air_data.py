"""What a vehicle's airspeed sensor, its turns and its airspeed hold show in flight.

**Airspeed calibration.** A Kalman filter of scale, slip and wind, over various directions of flight:

    ground velocity = reported airspeed * (scale along the heading - slip * turn rate right of it) + wind

On a straight flight a wrong scale and a head wind look the same. On a turn the wind stays and the aircraft
turns, which tells them apart. While the wind itself changes the filter learns little.

Source: Cho, Kim, Lee and Kee, "Wind estimation and airspeed calibration using a UAV with a single-antenna GPS
receiver and pitot tube", IEEE Transactions on Aerospace and Electronic Systems 47(1), 2011.

**Turn efficiency.** A Kalman filter of one number; 1 is a coordinated turn, and less is a slipping one:

    turn rate = turn efficiency * g tan(bank) / V

Two witnesses give the turn rate: the nose, which a changing wind turns as well, and the acceleration over
ground, which gusts disturb. Where they disagree the estimate becomes uncertain. Straight flight tells
nothing. ArduPilot's simulated plane has 0.745 to 0.85, by its place on a circle in wind: only the slow mean
is learned.

**Creeping airspeed hold.** Where FW_THR_ASPD_MIN and FW_THR_ASPD_MAX are not set, PX4 flies every airspeed
with the throttle FW_THR_TRIM. Part of a speed change comes within 2 s; its integrator brings the rest within
a minute. Asked for as much more as is missing, it flies what was wanted.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.airframe import GRAVITY
from vfguide.state import GAP_S

LEAST_SCALE, GREATEST_SCALE = 0.85, 1.25
"""Indicated against true airspeed at 3000 m is 1.16; the rest is the sensor's."""

SCALE_DEVIATION = 0.05
"""What is not known of the scale at first."""

WIND_DEVIATION = 10.0
"""The same of the wind, m/s."""

VELOCITY_NOISE = 0.2
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

Vector = tuple[float, ...]
Matrix = tuple[Vector, ...]


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
    """One scalar measurement: seen = row . estimate."""
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
"""What no vehicle turns less, or more, than."""

PRIOR, PRIOR_DEVIATION = 0.9, 0.15
"""Before anything is learned: half way between a vehicle that slips and one that does not."""

SMOOTHED_S = 1.0
"""Time constant on bank and turn rate alike: a yaw that swings at 0.9 Hz leaves a sixth of it."""

LEAST_BANK = math.radians(5.0)
"""With less bank trim and noise are too great a part of it."""

TURN_NOISE = 0.02
"""rad/s: how far a smoothed turn rate is from what the smoothed bank makes of it."""

NOISE_S = 2.0
"""For so long it is the same error: gusts, and what a swing leaves."""

DRIFT = 0.005
"""How much the efficiency changes, 1/sqrt(s): in a turn of 0.1 rad/s a minute is remembered."""

GREATEST_TURN_RATE = 10.0
"""rad/s: no aircraft turns faster."""

KNOWN = 0.05
"""Standard deviation below which it is known."""

SLIPS_BELOW, COORDINATED_ABOVE = 0.88, 0.92
"""A vehicle slips below the one and does not above the other; between them it stays what it was taken for."""


class TurnEfficiency(msgspec.Struct, frozen=True, kw_only=True):
    """What is known so far."""

    value: float = PRIOR
    """Turn rate in parts of g tan(bank) / V."""
    variance: float = PRIOR_DEVIATION**2
    """Variance of the efficiency."""
    by_bank: float = 0.0
    """g tan(bank) / V, smoothed, rad/s."""
    turn_rate: float = 0.0
    """Turn rate, smoothed, rad/s."""
    seen_s: float = 0.0
    """For how long bank and turn rate have been smoothed without a gap, s."""

    @property
    def is_known(self) -> bool:
        """Whether it is known well enough to be flown by."""
        return math.sqrt(self.variance) < KNOWN

    def slips(self, *, before: bool) -> bool:
        """Whether the vehicle slips.

        Args:
            before: what it was taken for: that stays where nothing else is known.
        """
        if not self.is_known:
            return before
        return self.value < (COORDINATED_ABOVE if before else SLIPS_BELOW)


def agreed(first: TurnEfficiency, second: TurnEfficiency) -> TurnEfficiency:
    """Return what two witnesses know together; that they differ makes it uncertain.

    Args:
        first: by one witness.
        second: by the other.
    """
    apart = first.value - second.value
    return replace(
        first,
        value=0.5 * (first.value + second.value),
        variance=max(first.variance, second.variance) + 0.25 * apart * apart,
    )


def learned(
    before: TurnEfficiency, *, bank: float, airspeed: float, turn_rate: float, period: float
) -> TurnEfficiency:
    """What is known after a report; the same where one of its numbers is none.

    Args:
        before: after the report before.
        bank: rad, positive right.
        airspeed: true, m/s.
        turn_rate: since the report before, rad/s.
        period: since then, s.
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
    # The error of one report is that of the next: in NOISE_S as much is learned as by one.
    noise = TURN_NOISE * TURN_NOISE * NOISE_S / period
    gain = variance * seen.by_bank / (variance * seen.by_bank**2 + noise)
    value = seen.value + gain * (seen.turn_rate - seen.value * seen.by_bank)
    return replace(
        seen,
        value=clip(value, LEAST, GREATEST),
        variance=(1.0 - gain * seen.by_bank) * variance,
    )


class CreepingHold(msgspec.Struct, frozen=True, kw_only=True):
    """Steps of such a hold, as they were measured."""

    share: float
    """Of a new airspeed, what comes at once; above 0, at most 1."""
    time: float
    """Time constant with which it creeps on, s."""


class CreepingSpeed:
    """The airspeed that a hold is trimmed to, and what it is asked for."""

    def __init__(self, hold: CreepingHold) -> None:
        """Know nothing of the trim yet: the first airspeed that is flown is taken for it."""
        self._hold = hold
        self._trim: float | None = None
        self._asked = self._time_s = 0.0

    def asked_for(
        self, wanted: float, flown: float, now: float, *, slowest: float, fastest: float
    ) -> float:
        """What to ask for, m/s, within what may be asked for.

        Args:
            wanted: airspeed that is to be flown, m/s.
            flown: airspeed that is flown, m/s.
            now: s; later than at the call before.
            slowest: least that may be asked for, m/s.
            fastest: most, m/s.
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
        """Forget the trim: somebody else has asked for other airspeeds meanwhile."""
        self._trim = None
