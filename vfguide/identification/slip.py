"""Slip of a vehicle: its turn efficiency, and the lead of its nose in turns.

    heading change = turn efficiency * integral of g tan(bank) / V dt + roll trim * time
    ground velocity = reported airspeed * (scale along the heading - lead * turn rate right of it) + wind

The first equation is fitted by least squares to all legs of a flight between two settled moments. How the
roll got there does not matter. Both ends are means over a second, which averages out yaw oscillations.

The second equation is fitted to all reports for true airspeeds and the nose's lead. It is the model that
`guidance.air_data` learns in flight, here with the residuals of gusts for an interval.
"""

import math
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.air_data import GREATEST_SCALE, LEAST_SCALE
from vfguide.guidance.airframe import GRAVITY

NORMAL_95 = 1.96

END_S = 1.0
"""Averaging time at the ends of a leg, s: it removes an oscillation of 0.9 Hz and most noise."""

NOSE_S = 2.0
"""Averaging time of the turn rate for the nose's lead, s: the nose does not lead so in an oscillation."""

LEAST_REPORTS = 100
"""Minimum number of reports for an estimate."""

LEAST_TURN = math.radians(5.0)
"""Maximum heading change from the bank on a straight leg, which shows the roll trim only, rad."""

LEAST_TURNS = 3
"""Minimum number of turns for an interval."""

ANGLE_ERROR, SHARE_ERROR = 0.01, 0.03
"""Error of a leg in rad, and as a share of the angle; only their ratio matters."""

SLIPS_BELOW = 0.9
"""Turn efficiency below which a vehicle slips. A coordinated turn has 1, and ArduPilot's simulated plane has
0.75 to 0.85."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A measured value."""

    value: float
    """Most likely value."""
    half_width: float
    """Half width of the 95 % interval of the true value, if the model is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """Slip of a vehicle in turns."""

    efficiency: Estimate
    """Turn rate as a fraction of g tan(bank) / V."""
    lead: Estimate
    """Angle by which the nose leads the direction of flight for each rad/s, s."""

    @property
    def slips(self) -> bool | None:
        """Whether the vehicle slips; None if the interval leaves that open."""
        found = self.efficiency
        if not abs(found.value - SLIPS_BELOW) > found.half_width:
            return None
        return found.value < SLIPS_BELOW


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """One report of bank, heading and velocity."""

    time_s: float
    leg: int
    heading: float
    """Heading of the nose, rad."""
    bank: float
    """Bank angle, rad, positive right."""
    airspeed: float
    """Reported airspeed, m/s."""
    velocity_north: float
    """Ground velocity toward north, m/s."""
    velocity_east: float
    """Ground velocity toward east, m/s."""


@dataclass(slots=True)
class Banks:
    """Bank reports of a flight."""

    reports: list[Bank] = field(default_factory=list)
    """Reports in order of time."""

    def note(self, report: Bank) -> None:
        """Add a report."""
        self.reports.append(report)

    def slip(self) -> Slip | None:
        """Return the slip from the reports so far; None with too few turns."""
        if len(self.reports) < LEAST_REPORTS:
            return None
        scale, lead = scale_and_lead(self.reports)
        found = turn_efficiency(legs_of(self.reports, scale.value))
        if found is None:
            return None
        of_scale = found.value * scale.half_width / scale.value
        return Slip(
            efficiency=replace(found, half_width=math.hypot(found.half_width, of_scale)), lead=lead
        )


def scale_and_lead(reports: list[Bank]) -> tuple[Estimate, Estimate]:
    """Return (ratio of true to reported airspeed, the nose's lead in s), in the mean wind of a flight."""
    time_s = np.array([one.time_s for one in reports])
    heading = np.unwrap(np.array([one.heading for one in reports]))
    airspeed = np.array([one.airspeed for one in reports])
    turn_rate = smoothed(time_s, np.gradient(heading, time_s), NOSE_S)
    ahead, aside = airspeed * np.cos(heading), airspeed * np.sin(heading)
    one, none = np.ones_like(time_s), np.zeros_like(time_s)
    # A nose that leads to the right has the air velocity on its left.
    north = np.column_stack((ahead, turn_rate * aside, one, none))
    east = np.column_stack((aside, -turn_rate * ahead, none, one))
    rows = np.concatenate((north, east))
    seen = np.array(
        [one.velocity_north for one in reports] + [one.velocity_east for one in reports]
    )
    inverse = np.linalg.pinv(rows.T @ rows)
    values = inverse @ (rows.T @ seen)
    rest = seen - rows @ values
    variance = float(rest @ rest) / len(rest) * correlation_factor(rest)
    half_widths = NORMAL_95 * np.sqrt(np.maximum(variance * np.diag(inverse), 0.0))
    scale = Estimate(
        value=min(max(float(values[0]), LEAST_SCALE), GREATEST_SCALE),
        half_width=float(half_widths[0]),
    )
    return scale, Estimate(value=float(values[1]), half_width=float(half_widths[1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class SlipLeg:
    """Leg from one settled moment to the next."""

    turned: float
    """Heading change, rad."""
    by_bank: float
    """Heading change expected from the bank, rad."""
    lasts_s: float


def legs_of(reports: list[Bank], scale: float) -> list[SlipLeg]:
    """Return the legs of a flight, each from the end of the one before to its own end.

    `scale` is the ratio of true to reported airspeed.
    """
    if len(reports) < 2:
        return []
    time_s = np.array([one.time_s for one in reports])
    heading = np.unwrap(np.array([one.heading for one in reports]))
    rates = np.array(
        [GRAVITY * math.tan(one.bank) / (scale * max(one.airspeed, 1.0)) for one in reports]
    )
    by_bank = np.concatenate(([0.0], np.cumsum(0.5 * (rates[1:] + rates[:-1]) * np.diff(time_s))))
    changes = [at for at in range(1, len(reports)) if reports[at].leg != reports[at - 1].leg]
    ends = [float(time_s[0]) + END_S]
    ends += [one for at in [*changes, len(reports)] if (one := float(time_s[at - 1])) > ends[0]]

    def moments(values: FloatArray) -> list[float]:
        return [
            float(np.mean(values[(time_s > end - END_S) & (time_s <= end + 1e-9)])) for end in ends
        ]

    rows = zip(moments(heading), moments(by_bank), moments(time_s), strict=True)
    points = list(rows)
    return [
        SlipLeg(
            turned=after[0] - before[0], by_bank=after[1] - before[1], lasts_s=after[2] - before[2]
        )
        for before, after in pairwise(points)
    ]


def turning(legs: list[SlipLeg]) -> list[SlipLeg]:
    """Return the legs with a turn."""
    return [leg for leg in legs if abs(leg.by_bank) > LEAST_TURN]


def leg_weights(by_bank: FloatArray) -> FloatArray:
    """Return the weights of legs with such angles (rad), the inverse of their errors."""
    weights: FloatArray = 1.0 / np.hypot(ANGLE_ERROR, SHARE_ERROR * by_bank)
    return weights


def turn_efficiency(legs: list[SlipLeg], *, has_straight: bool = True) -> Estimate | None:
    """Return the turn efficiency and its 95 % interval; None with too few turns.

    `has_straight` tells whether some legs are straight, which show the roll trim.
    """
    if len(turning(legs)) < LEAST_TURNS:
        return None
    from scipy.special import stdtrit

    rows = np.array([(leg.by_bank, leg.lasts_s) for leg in legs])[:, : 2 if has_straight else 1]
    turned = np.array([leg.turned for leg in legs])
    weights = leg_weights(rows[:, 0])
    weighted = rows * weights[:, None]
    inverse = np.linalg.pinv(weighted.T @ weighted)
    values = inverse @ (weighted.T @ (turned * weights))
    rest = (turned - rows @ values) * weights
    degrees = max(len(legs) - rows.shape[1], 1)
    variance = float(rest @ rest) / degrees * float(inverse[0, 0])
    half_width = float(stdtrit(degrees, 0.975)) * math.sqrt(max(variance, 0.0))
    return Estimate(value=float(values[0]), half_width=half_width)


def smoothed(time_s: FloatArray, values: FloatArray, width_s: float) -> FloatArray:
    """Return the running mean over some seconds, truncated at the ends."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    half = 0.5 * width_s
    low = np.searchsorted(time_s, time_s - half, side="left")
    high = np.searchsorted(time_s, time_s + half, side="right")
    mean: FloatArray = (total[high] - total[low]) / (high - low)
    return mean


def correlation_factor(rest: FloatArray) -> float:
    """Return the factor by which correlation of neighbours reduces the effective number of samples."""
    power = float(rest @ rest)
    if power == 0.0:
        return 1.0
    correlation = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.99)
    return (1.0 + correlation) / (1.0 - correlation)
