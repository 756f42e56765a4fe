"""How much a vehicle turns of what its bank says, learned in flight: a Kalman filter of one number.

    turn rate = turn efficiency * g tan(bank) / V

There are two witnesses of the turn rate. A wind that changes turns the nose as well; gusts disturb the
acceleration over ground. Where the two do not agree nothing is known.

1 is a coordinated turn. A vehicle without coordination turns less and slips; ArduPilot's simulated plane does
by 0.745 to 0.85, other values in other parts of a circle in wind, which is why no more than their slow mean
is learned. Straight flight tells nothing.
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip, low_pass
from vfguide.guidance.airframe import GRAVITY
from vfguide.state import GAP_S

LEAST, GREATEST = 0.5, 1.1
"""What no vehicle turns less, or more, than."""

PRIOR, PRIOR_DEVIATION = 0.9, 0.15
"""Before anything is learned: half way between a vehicle that slips and one that does not."""

SMOOTHED_S = 1.0
"""Time constant on bank and turn rate alike: a yaw that swings at 0.9 Hz leaves a sixth of it."""

LEAST_BANK = math.radians(5.0)
"""With less bank trim and noise are too great a part of it."""

NOISE = 0.02
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
    if not all(map(math.isfinite, (bank, airspeed, turn_rate, period))):
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
    noise = NOISE * NOISE * NOISE_S / period
    gain = variance * seen.by_bank / (variance * seen.by_bank**2 + noise)
    value = seen.value + gain * (seen.turn_rate - seen.value * seen.by_bank)
    return replace(
        seen,
        value=clip(value, LEAST, GREATEST),
        variance=(1.0 - gain * seen.by_bank) * variance,
    )
