"""The integral of the slot's field: what keeps pushing a follower off its slot is learned, and aimed off.

A field alone answers a lasting disturbance with a lasting error: it takes an error to ask for anything. So
the field is put around a point that lies a learned offset b beyond the slot, db/dt = e / T near the slot.
Small errors then obey d²e/dt² + s de/dt + (s / T) e = 0 with the field's slope s (1/s) at its middle: a
damping of sqrt(s T) / 2 (of integral action: Astrom and Murray, Feedback Systems, 2nd edition, chapter 11).

Round a circle in wind the disturbance comes back with every turn: speeds rise and fall with the course, and
whatever the model of the autopilot gets wrong rises and falls with them. A mean offset follows that a quarter
of a turn late. So in turns the offset also has a part that goes as the cosine and the sine of the slot's
course, and one of twice the course, each learned in its own phase (adaptive feedforward cancellation: Bodson,
Sacks and Khosla, IEEE Transactions on Automatic Control 39(9), 1994).
"""

import math

import msgspec
from msgspec.structs import replace

from vfguide.elementwise import clip
from vfguide.guidance.formation import FormationError, SlotMotion

NEAR_M = 2.0
"""m: an error of this size is learned from half as fast, and a greater one hardly. On the way to the slot the
error is no sign of a disturbance."""

GREATEST_M = 5.0
"""m: of the offset on each axis."""


IN_GUSTS = 0.9
"""In gusts so much less is learned of an error: it is gone before it is known."""

HARMONICS = (1.0, 2.0)
"""Multiples of the slot's course that an offset is learned for: in a steady wind a slot's ground speed has
hardly any more."""

TURNING_RAD_S = 0.04
"""Turn rate at which harmonics count by half: on a straight they could not be told from the mean."""


class Harmonic(msgspec.Struct, frozen=True, kw_only=True):
    """A part of the offset that goes round with the slot's course, m."""

    ahead_cosine: float
    ahead_sine: float
    right_cosine: float
    right_sine: float


class Offset(msgspec.Struct, frozen=True, kw_only=True):
    """b: how far beyond the slot the field aims, in the frame of the slot's motion."""

    ahead: float
    """Mean, m along the slot's motion."""
    right: float
    """Mean, m across it."""
    harmonics: tuple[Harmonic, ...]
    """One for each of `HARMONICS`."""


def no_offset() -> Offset:
    """Nothing was learned yet."""
    still = Harmonic(ahead_cosine=0.0, ahead_sine=0.0, right_cosine=0.0, right_sine=0.0)
    return Offset(ahead=0.0, right=0.0, harmonics=(still,) * len(HARMONICS))


def nearness(error: FormationError) -> float:
    """Share of an error that is learned from: 1 in the slot, 1/2 at `NEAR_M`, with the fourth power."""
    squared = (
        error.along_track * error.along_track + error.cross_track * error.cross_track
    ) / NEAR_M**2
    return 1.0 / (1.0 + squared * squared)


def learning_rate(
    error: FormationError, integral_s: float, gust_share: float = 0.0
) -> tuple[float, float]:
    """(ahead, right) db/dt of the mean offset, m/s.

    Args:
        error: from the slot.
        integral_s: T, s; 0 learns nothing.
        gust_share: 0 to 1: how far errors are those of gusts, which do not last.
    """
    if integral_s <= 0.0:
        return 0.0, 0.0
    share = nearness(error) * (1.0 - IN_GUSTS * gust_share) / integral_s
    return share * error.along_track, share * error.cross_track


def turning_share(turn_rate: float) -> float:
    """How far harmonics count at a turn rate (rad/s): 0 on a straight, 1 in a turn."""
    squared = turn_rate * turn_rate
    return squared / (squared + TURNING_RAD_S**2)


def harmonic_share(turn_rate: float, integral_s: float) -> float:
    """How fast a harmonic is update_offset, in parts of the mean: as fast, but no faster than the slot turns.

    What is learned within less of a turn could not be told from the mean.

    Args:
        turn_rate: of the slot, rad/s.
        integral_s: T, s.
    """
    return clip(abs(turn_rate) * integral_s, 0.0, 1.0)


def learning_growth(turn_rate: float, integral_s: float) -> float:
    """How much faster than a mean alone all parts together are learned: 1 or more. Arguments as above."""
    share = turning_share(turn_rate) * harmonic_share(turn_rate, integral_s)
    return 1.0 + share * float(len(HARMONICS))


def aimed_error(
    error: FormationError,
    offset: Offset,
    integral_s: float,
    motion: SlotMotion,
    gust_share: float = 0.0,
) -> FormationError:
    """The error from the point that the field aims at, and its rate: e + b and de/dt + db/dt.

    Args:
        error: from the slot.
        offset: b.
        integral_s: T, s; 0 learns nothing.
        motion: of the slot.
        gust_share: see `learning_rate`.
    """
    if integral_s <= 0.0:
        return error
    growth = learning_growth(motion.turn_rate, integral_s)
    ahead, right, ahead_rate, right_rate = sum_of(offset, motion)
    ahead_growth, right_growth = learning_rate(error, integral_s, gust_share)
    return replace(
        error,
        along_track=error.along_track + clip(ahead, -GREATEST_M, GREATEST_M),
        cross_track=error.cross_track + clip(right, -GREATEST_M, GREATEST_M),
        along_track_rate=error.along_track_rate + growth * ahead_growth + ahead_rate,
        cross_track_rate=error.cross_track_rate + growth * right_growth + right_rate,
    )


def sum_of(offset: Offset, motion: SlotMotion) -> tuple[float, float, float, float]:
    """(ahead, right) of all parts together, m, and how they change as the slot turns, m/s."""
    share = turning_share(motion.turn_rate)
    ahead, right = offset.ahead, offset.right
    ahead_rate = right_rate = 0.0
    for multiple, one in zip(HARMONICS, offset.harmonics, strict=True):
        cosine, sine = (
            share * math.cos(multiple * motion.course),
            share * math.sin(multiple * motion.course),
        )
        turn_rate = multiple * motion.turn_rate
        ahead = ahead + one.ahead_cosine * cosine + one.ahead_sine * sine
        right = right + one.right_cosine * cosine + one.right_sine * sine
        ahead_rate = ahead_rate + turn_rate * (one.ahead_sine * cosine - one.ahead_cosine * sine)
        right_rate = right_rate + turn_rate * (one.right_sine * cosine - one.right_cosine * sine)
    return ahead, right, ahead_rate, right_rate


def update_offset(
    offset: Offset,
    error: FormationError,
    integral_s: float,
    motion: SlotMotion,
    *,
    period: float,
    held: bool,
    gust_share: float = 0.0,
) -> Offset:
    """The offset a step later.

    Args:
        offset: b until now.
        error: of the step.
        integral_s: T; 0 learns nothing.
        motion: of the slot.
        period: since the step before, s.
        held: where something else than the field decides, or a limit: learning would only wind up.
        gust_share: see `learning_rate`.
    """
    if held:
        return offset
    ahead_rate, right_rate = learning_rate(error, integral_s, gust_share)
    share = harmonic_share(motion.turn_rate, integral_s)
    ahead, right, _, _ = sum_of(offset, motion)
    # Beyond the bound of all parts together each of them would only wind up.
    if abs(ahead) >= GREATEST_M and ahead * ahead_rate > 0.0:
        ahead_rate = 0.0
    if abs(right) >= GREATEST_M and right * right_rate > 0.0:
        right_rate = 0.0

    def grown(part: float, rate: float) -> float:
        return clip(part + rate * period, -GREATEST_M, GREATEST_M)

    harmonics = []
    for multiple, one in zip(HARMONICS, offset.harmonics, strict=True):
        cosine, sine = (
            share * math.cos(multiple * motion.course),
            share * math.sin(multiple * motion.course),
        )
        harmonics.append(
            Harmonic(
                ahead_cosine=grown(one.ahead_cosine, cosine * ahead_rate),
                ahead_sine=grown(one.ahead_sine, sine * ahead_rate),
                right_cosine=grown(one.right_cosine, cosine * right_rate),
                right_sine=grown(one.right_sine, sine * right_rate),
            )
        )
    return Offset(
        ahead=grown(offset.ahead, ahead_rate),
        right=grown(offset.right, right_rate),
        harmonics=tuple(harmonics),
    )
