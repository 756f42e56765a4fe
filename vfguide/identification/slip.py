"""How much a vehicle turns of what its bank says, and how far its nose leads: does it slip?

    turned by the nose = turn efficiency * integral of g tan(bank) / V dt + roll trim * time

over each leg of a flight between two settled moments, fitted to all legs by least squares. How the roll got
there does not matter, and both ends are means over a second: a yaw that swings is averaged out.

    ground velocity = reported airspeed * (scale along the heading - lead * turn rate right of it) + wind

over all reports gives true airspeeds and the nose's lead, likewise: the model that
`guidance.air_data` learns in flight, here with what gusts leave of it for an interval.
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
"""Ends of a leg are means over so long: a swing of 0.9 Hz and most noise leave nothing in them."""

NOSE_S = 2.0
"""The turn rate with which the nose leads is the mean over so long: in a swing it does not lead so."""

LEAST_REPORTS = 100
"""Fewer say nothing."""

LEAST_TURN = math.radians(5.0)
"""A leg in which the bank says less is a straight one: it tells of the roll's trim alone."""

LEAST_TURNS = 3
"""Fewer say nothing of how far they differ."""

ANGLE_ERROR, SHARE_ERROR = 0.01, 0.03
"""rad, and share of the angle: how far a leg may be off; only their proportion matters."""

SLIPS_BELOW = 0.9
"""A vehicle that turns less than this share of what its bank says slips; 1 is a coordinated turn, and
ArduPilot's simulated plane has 0.75 to 0.85."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A value that was measured."""

    value: float
    """The most likely."""
    half_width: float
    """Half width of the interval that holds the true value in 95 % of all cases, if the model is right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Slip:
    """How a vehicle turns."""

    efficiency: Estimate
    """Turn rate in parts of g tan(bank) / V."""
    lead: Estimate
    """Angle by which the nose leads the direction of flight for each rad/s, s."""

    @property
    def slips(self) -> bool | None:
        """Whether it is one that slips; None where the interval leaves that open."""
        found = self.efficiency
        if not abs(found.value - SLIPS_BELOW) > found.half_width:
            return None
        return found.value < SLIPS_BELOW


@dataclass(frozen=True, slots=True, kw_only=True)
class Bank:
    """One report."""

    time_s: float
    """s."""
    leg: int
    """On which it was."""
    heading: float
    """Where the nose points, rad."""
    bank: float
    """rad, positive right."""
    airspeed: float
    """As reported, m/s."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""


@dataclass(slots=True)
class Banks:
    """The banks of a flight as it happens, and the airspeed sensor's scale."""

    reports: list[Bank] = field(default_factory=list)
    """In the order of time."""

    def note(self, report: Bank) -> None:
        """Take a report."""
        self.reports.append(report)

    def slip(self) -> Slip | None:
        """What the flight has told so far; None where it has turned too little."""
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
    """(true airspeed over the reported one, the nose's lead in s), in the mean wind of a flight."""
    time_s = np.array([one.time_s for one in reports])
    heading = np.unwrap(np.array([one.heading for one in reports]))
    airspeed = np.array([one.airspeed for one in reports])
    turn_rate = smoothed(time_s, np.gradient(heading, time_s), NOSE_S)
    ahead, aside = airspeed * np.cos(heading), airspeed * np.sin(heading)
    one, none = np.ones_like(time_s), np.zeros_like(time_s)
    # A nose that leads to the right leaves the air velocity on its left.
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
    """From one settled moment to the next."""

    turned: float
    """By the nose, rad."""
    by_bank: float
    """What the bank says, rad."""
    lasts_s: float
    """s."""


def legs_of(reports: list[Bank], scale: float) -> list[SlipLeg]:
    """The legs of a flight, each from the end of the one before to its own end.

    Args:
        reports: all of them.
        scale: true airspeed over the reported one.
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
    """Those in which it turned."""
    return [leg for leg in legs if abs(leg.by_bank) > LEAST_TURN]


def leg_weights(by_bank: FloatArray) -> FloatArray:
    """How much legs of such angles (rad) count: by how far each may be off."""
    weights: FloatArray = 1.0 / np.hypot(ANGLE_ERROR, SHARE_ERROR * by_bank)
    return weights


def turn_efficiency(legs: list[SlipLeg], *, has_straight: bool = True) -> Estimate | None:
    """Turned over what the bank says, and its 95 % interval; None where too little was turned.

    Args:
        legs: of a flight.
        has_straight: whether some of them are straight, which tell the roll's trim.
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
