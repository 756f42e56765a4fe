"""The integral of the slot's field: what keeps pushing a follower off its slot is learned, and aimed off.

A field alone answers a lasting disturbance with a lasting error: it takes an error to ask for anything. So
the field is put around a point that lies a learned offset b beyond the slot, db/dt = e / T near the slot.
Small errors then obey d²e/dt² + s de/dt + (s / T) e = 0 with the field's slope s (1/s) at its middle: a
damping of sqrt(s T) / 2 (of integral action: Astrom and Murray, Feedback Systems, 2nd edition, chapter 11).
"""

from dataclasses import dataclass, replace
from typing import Generic

from vfguide.elementwise import BoolArray, Number, clip, like, where
from vfguide.guidance.formation import FormationError

NEAR_M = 2.0
"""m: an error of this size is learned from half as fast, and a greater one hardly. On the way to the slot the
error is no sign of a disturbance."""

GREATEST_M = 5.0
"""m: of the offset on each axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset(Generic[Number]):
    """b: how far beyond the slot the field aims, in the frame of the slot's motion."""

    ahead: Number
    """m along the slot's motion."""
    right: Number
    """m across it."""


def no_offset(shape: Number) -> Offset[Number]:
    """Nothing was learned yet; in the shape of another value."""
    return Offset(ahead=like(0.0, shape), right=like(0.0, shape))


def nearness(error: FormationError[Number]) -> Number:
    """Share of an error that is learned from: 1 in the slot, 1/2 at `NEAR_M`, with the fourth power."""
    squared = (
        error.along_track * error.along_track + error.cross_track * error.cross_track
    ) / NEAR_M**2
    return 1.0 / (1.0 + squared * squared)


def learning_rate(error: FormationError[Number], integral_s: float) -> tuple[Number, Number]:
    """(ahead, right) db/dt of the offset, m/s, with the time T (s) of the integral; 0 learns nothing."""
    if integral_s <= 0.0:
        return error.along_track * 0.0, error.along_track * 0.0
    share = nearness(error) / integral_s
    return share * error.along_track, share * error.cross_track


def aimed_error(
    error: FormationError[Number], offset: Offset[Number], integral_s: float
) -> FormationError[Number]:
    """The error from the point that the field aims at, and its rate: e + b and de/dt + db/dt."""
    ahead_rate, right_rate = learning_rate(error, integral_s)
    return replace(
        error,
        along_track=error.along_track + offset.ahead,
        cross_track=error.cross_track + offset.right,
        along_track_rate=error.along_track_rate + ahead_rate,
        cross_track_rate=error.cross_track_rate + right_rate,
    )


def learned(
    offset: Offset[Number],
    error: FormationError[Number],
    integral_s: float,
    *,
    period: float,
    held: bool | BoolArray,
) -> Offset[Number]:
    """The offset a step later.

    Args:
        offset: b until now.
        error: of the step.
        integral_s: T; 0 learns nothing.
        period: since the step before, s.
        held: where something else than the field decides, or a limit: learning would only wind up.
    """
    ahead_rate, right_rate = learning_rate(error, integral_s)
    ahead = clip(offset.ahead + ahead_rate * period, -GREATEST_M, GREATEST_M)
    right = clip(offset.right + right_rate * period, -GREATEST_M, GREATEST_M)
    return Offset(ahead=where(held, offset.ahead, ahead), right=where(held, offset.right, right))
