"""How fast a loop may be that flies an aircraft whose response is known only so well.

One rule. A loop of gain g around a hold that answers k times as strongly as believed, and D seconds late, is

    L(s) = k g exp(-D s) / s,

whose phase margin is 90 degrees less k g D, and whose gain margin is pi / (2 k g D): 45 degrees and 6 dB are
both kept where

    g <= (pi / 4) / (k D).

k and D are the greatest that the response may have: the spread of its gain, the loop's own period and delay,
the share of the known delay that prediction does not take away, and the delay that may come on top. Within
that bound `sharpness` chooses how quick the loop is around the response as it most probably is, and how many
times quicker than the hold that it commands. A loop around another one is slower by `NESTING` (Astrom and
Murray, Feedback Systems, 2nd edition, chapters 10 and 14).
"""

import math

import msgspec

from vfguide.guidance.settings import LEAST_PERIOD
from vfguide.state import Airframe

MARGIN = math.pi / 4.0
"""Greatest k g D, rad: 45 degrees of phase and 6 dB of gain are left."""

NESTING = 2.0
"""How many times slower than the loop inside it a loop is."""

FORETOLD_SHARE = 0.2
"""Share of a delay that is predicted away and still counts as one: no prediction is perfect."""

SLIPPING_BANDWIDTH = 0.45
"""1/s: of the course loop of an aircraft that slips. On ArduPilot's simulated plane 0.7 kept the yaw
swinging at 0.9 Hz for ever."""

USUAL_AMPLIFICATION, AMPLIFICATION_STEP = 4.0, 4.0
"""How many times quicker than a hold its loop is at sharpness 0.5, and the factor from there to 1."""

GUST_M_S = 1.5
"""Speed error of gusts and noise: at sharpness 0.5 it asks for all acceleration, and none less does."""

QUICKEST_FACTOR = 1.0 / MARGIN
"""Layer factor at sharpness 1, where the margins are just kept."""

USUAL_FACTOR = 3.5
"""Layer factor at sharpness 0.5: 74 degrees of phase and 15 dB of gain are left."""


class HoldCertainty(msgspec.Struct, frozen=True, kw_only=True):
    """How well the response of one hold is known."""

    spread: float
    """The true gain lies within gain / spread and gain * spread; 1 or more."""
    late: float
    """Delay that may come on top of the known one, s."""


class Certainty(msgspec.Struct, frozen=True, kw_only=True):
    """How well an aircraft's response is known."""

    course: HoldCertainty
    """Of the course (or heading) hold."""
    speed: HoldCertainty
    """Of the speed hold."""


DECLARED = HoldCertainty(spread=1.1, late=0.0)
"""Written in the mission: measured by somebody, until flight contradicts."""

AS_DECLARED = Certainty(course=DECLARED, speed=DECLARED)
"""Both holds as the mission has them."""

TOLD = HoldCertainty(spread=1.5, late=0.15)
"""By the autopilot's own parameters: the airframe adds what they do not say."""

UNKNOWN = HoldCertainty(spread=3.0, late=0.4)
"""Nobody has said anything."""


class Bandwidth(msgspec.Struct, frozen=True, kw_only=True):
    """How fast the loops of one aircraft may be, 1/s; infinite where nothing bounds them."""

    course: float = math.inf
    """Loop from the course error to the turn rate."""
    speed: float = math.inf
    """Loop from the speed error to the acceleration."""
    energy_field: float = math.inf
    """Loop from the error along track to the speed, around a total-energy hold."""

    @property
    def course_field(self) -> float:
        """Loop from the error across track to the course."""
        return self.course / NESTING

    @property
    def speed_field(self) -> float:
        """Loop from the error along track to the speed."""
        return self.speed / NESTING


class Softness(msgspec.Struct, frozen=True, kw_only=True):
    """Factors on bandwidths, above 0, at most 1: less where a guard has found the aircraft strained."""

    course: float = 1.0
    """On the loops of the course."""
    speed: float = 1.0
    """On the loops of the speed."""


FIRM = Softness()
"""Of an aircraft that is not strained."""

UNBOUNDED = Bandwidth()
"""Of an aircraft of which nothing has to be minded."""


def factor_of(sharpness: float) -> float:
    """Boundary layer over kappa times the delay, for a sharpness from 0 to 1.

    1 is the quickest loop that keeps the margins, 0.5 the usual one; each tenth is as great a step as any.
    """
    return float(QUICKEST_FACTOR * (USUAL_FACTOR / QUICKEST_FACTOR) ** (2.0 * (1.0 - sharpness)))


def amplification_of(sharpness: float) -> float:
    """How many times quicker than a hold the loop around it may be, for a sharpness from 0 to 1.

    A loop of gain g around a hold of gain alpha sends setpoints that are g / alpha times as great as what it
    has measured, noise included: more than the hold can follow only wears its servos.
    """
    return float(USUAL_AMPLIFICATION * AMPLIFICATION_STEP ** (2.0 * sharpness - 1.0))


def bearable(
    gain_delay: float, certainty: HoldCertainty, *, period: float, loop_delay: float, factor: float
) -> float:
    """Greatest bandwidth of a loop around one hold, 1/s.

    Args:
        gain_delay: known dead time and lag of the hold, s.
        certainty: how well that is known.
        period: of the loop, s.
        loop_delay: from measurement to effect beyond the period, s.
        factor: layer factor that `sharpness` or the mission chose; 0 asks for the quickest loop.
    """
    delay = max(period, LEAST_PERIOD) + loop_delay + FORETOLD_SHARE * gain_delay
    bound = MARGIN / (certainty.spread * (delay + certainty.late))
    if gain_delay > 0.0 and factor > 0.0:
        bound = min(bound, 1.0 / (factor * delay))
    return bound


def bandwidth_of(
    airframe: Airframe,
    certainty: Certainty,
    *,
    slips: bool,
    period: float,
    loop_delay: float,
    factor: float,
    amplification: float = math.inf,
    softness: Softness = FIRM,
) -> Bandwidth:
    """Bandwidth that every response an aircraft may have bears.

    Args:
        airframe: most probable response.
        certainty: how well it is known.
        slips: whether its nose leaves the direction of flight in turns.
        period: of the loop, s.
        loop_delay: from measurement to effect beyond the period, s.
        factor: see `bearable`.
        amplification: how many times quicker than the hold that it commands a loop may be.
        softness: factors on what results.
    """
    course = bearable(
        airframe.course_dead_time + airframe.course_lag,
        certainty.course,
        period=period,
        loop_delay=loop_delay,
        factor=factor,
    )
    speed_late = airframe.speed_dead_time + airframe.speed_lag
    speed_delay = max(period, LEAST_PERIOD) + loop_delay + FORETOLD_SHARE * speed_late
    speed = bearable(
        speed_late,
        certainty.speed,
        period=period,
        loop_delay=loop_delay,
        factor=factor,
    )
    course = min(course, amplification * airframe.alpha)
    gentle = airframe.max_acceleration / (USUAL_AMPLIFICATION * GUST_M_S)
    speed = min(speed, amplification * min(airframe.beta, gentle))
    if slips and factor > 0.0:
        course = min(course, SLIPPING_BANDWIDTH)
    fastest = (
        1.0 / (factor * (max(period, LEAST_PERIOD) + loop_delay)) if factor > 0.0 else math.inf
    )
    # A hold that is slower than believed by TOLD.spread is still led with a damping of 0.7.
    slowest_hold = airframe.beta / max(certainty.speed.spread / TOLD.spread, 1.0)
    energy_field = min(
        slowest_hold / (1.0 + NESTING),
        MARGIN / (NESTING * certainty.speed.spread * (speed_delay + certainty.speed.late)),
    )
    return Bandwidth(
        course=softened(course, softness.course, fastest),
        speed=softened(speed, softness.speed, fastest),
        energy_field=softness.speed * energy_field,
    )


def softened(bound: float, softness: float, fastest: float) -> float:
    """Return a share of a bandwidth, or of what the sampled loop has anyway where that is less, 1/s."""
    return bound if softness >= 1.0 else softness * min(bound, fastest)
