"""The formation's shared clock, and stops of this process."""

import math
from collections.abc import Callable

import msgspec

HANG_S = 2.0
"""Longer than this between two calls, and this process was stopped: what it hears then is old."""

STALL_S = 0.5
"""After longer than this between two calls modes are commanded only once a new question was answered: what is
read first has waited."""

AWAKE_S = 1.0
"""For so long after a hang what waited in buffers arrives."""


class SharedClock(msgspec.Struct, frozen=True, kw_only=True):
    """From one's own clock to the formation's and back."""

    to_own: Callable[[float], float] = float
    """A time of the shared clock on one's own, s; NaN while not known."""
    from_own: Callable[[float], float] = float
    """A time of one's own clock on the shared one, s; NaN while not known."""


SAME_CLOCK = SharedClock()
"""Where all companions read one clock."""


class Wakefulness:
    """When one companion was called last, and what that means for what it hears now; times in s."""

    def __init__(self) -> None:
        """Was never called."""
        self._called = -math.inf
        self._awake = -math.inf
        self._stalled = -math.inf
        self.since = math.inf
        """Since when it is called without a hang."""

    def note_call(self, now: float) -> float:
        """Note a call.

        Returns:
            For how long it hung before, s; 0 if it did not.
        """
        before, self._called = self._called, now
        away = now - before
        if away > HANG_S:
            self.since = now
        if not STALL_S < away < math.inf:
            return 0.0
        self._stalled = now
        if away <= HANG_S:
            return 0.0
        self._awake = now + AWAKE_S
        return away

    def is_waking(self, now: float) -> bool:
        """Whether what arrives now has waited: then nothing goes by it."""
        return now < self._awake

    def is_stale(self, stamp: float) -> bool:
        """Whether something was true at a time (s) before the last stall."""
        return stamp < self._stalled
