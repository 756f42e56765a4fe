"""The formation's shared clock, the clock of a leader that none can read, and stops of this process.

A foreign leader's clock cannot be read. Each message carries the sender's time. No message is read before
it was sent, so the least difference between the reader's clock and the stamps is the one with the least
delay in it. Later ones are late by the rest, and that is known to milliseconds. How long the fastest
message took is not in the messages: a delay that all of them have looks like a clock that is behind. An
autopilot that answers TIMESYNC shows it: no question is answered before it was asked, so the greatest
difference between asking and the answer's stamp is the one with the least delay on the way there, and the
truth lies midway between both, as far as the fastest each way take alike. Of one that does not answer the
mission may tell it (`leader.least_delay_s`); what is missing there puts followers behind their slots by
that time at the formation's speed.
"""

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import msgspec

HANG_S = 2.0
"""Longer than this between two calls, and this process was stopped: what it hears then is old."""

STALL_S = 0.5
"""After longer than this between two calls modes are commanded only once a new question was answered: what is
read first has waited."""

AWAKE_S = 1.0
"""For so long after a hang what waited in buffers arrives."""

DRIFT = 100e-6
"""s/s by which two clocks may run apart: the least difference grows with it, and does not rule for ever."""

SOONER_S = 1.0
"""A message that is earlier than the fastest by more than this has another clock."""

LATE_MESSAGE_S = 5.0
"""One that is later by more than this is too old to be of use."""

CERTAIN_COUNT, CERTAIN_S = 3, 1.0
"""Stamps have to go on from elsewhere so often, and for so long, before the sender has another clock."""

STANDS_S = 10.0
"""The same where stamps go on from where they were, and are only late: a slow radio is no new clock."""

EVEN_S = 1.0
"""By so much they may disagree with each other meanwhile."""


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


class Moment(msgspec.Struct, frozen=True, kw_only=True):
    """What a message's stamp says."""

    time_s: float
    """When it was true, s on the reader's clock, if the fastest message took the least delay."""
    even_s: float
    """The same without corrections, for differences: s from an arbitrary zero."""
    late_s: float
    """By how much it is later than the fastest, s."""
    restarted: bool
    """Whether the sender's clock is another one from here on."""


@dataclass(slots=True)
class _Elsewhere:
    """Stamps that do not go on from those before."""

    difference: float
    began_s: float
    newest_stamp: float
    count: int = 1


class LeaderClock:
    """Puts the stamps of one sender onto the reader's clock."""

    def __init__(self, *, least_delay_s: float | None = None) -> None:
        """Know nothing yet.

        Args:
            least_delay_s: how long the fastest message takes; None where that is to be found out.
        """
        self.counters: Counter[str] = Counter()
        """Messages whose stamps were not used, by reason."""
        self._told_s = least_delay_s
        self._earliest = self._answered_s = -math.inf
        self._least = math.nan
        self._newest = -math.inf
        self._read_s = math.nan
        self._zero = 0.0
        self._elsewhere: _Elsewhere | None = None

    @property
    def offset_s(self) -> float:
        """The reader's clock less the sender's, s; NaN before the first message."""
        return self._least - self.least_delay_s

    @property
    def least_delay_s(self) -> float:
        """How long the fastest message takes, as it was told, or by the answers that have come; else 0."""
        if self._told_s is not None:
            return self._told_s
        measured = 0.5 * (self._least - self._earliest)
        return min(max(measured, 0.0), LATE_MESSAGE_S) if math.isfinite(measured) else 0.0

    def read(self, stamp_s: float, now: float) -> Moment | None:
        """When a message was true that is read now; None where its stamp is not believed, or not newer."""
        restarted = False
        if not self._goes_on(stamp_s, now):
            if not self._is_new_clock(stamp_s, now):
                self.counters["time stamp not believed"] += 1
                return None
            restarted = True
        elif not math.isnan(self._least) and stamp_s <= self._newest:
            self.counters["not newer"] += 1
            return None
        difference = now - stamp_s
        if restarted or math.isnan(self._least):
            self._least, self._zero = difference, difference
            self._earliest = self._answered_s = -math.inf
        else:
            self._least = min(self._least + DRIFT * max(now - self._read_s, 0.0), difference)
        self._newest, self._read_s, self._elsewhere = stamp_s, now, None
        return Moment(
            time_s=stamp_s + self.offset_s,
            even_s=stamp_s + self._zero,
            late_s=difference - self._least,
            restarted=restarted,
        )

    def answer(self, asked_s: float, sender_s: float, now: float) -> None:
        """Take the answer to a question for the sender's time.

        Args:
            asked_s: when it was asked, s on the reader's clock.
            sender_s: what the sender's clock showed.
            now: s on the reader's clock.
        """
        difference = asked_s - sender_s
        # Of another clock than the stamps' it says nothing.
        if math.isnan(self._least) or not -2.0 * LATE_MESSAGE_S <= difference - self._least <= 0.0:
            return
        drifted = self._earliest - DRIFT * max(now - self._answered_s, 0.0)
        self._earliest, self._answered_s = max(drifted, difference), now

    def _goes_on(self, stamp_s: float, now: float) -> bool:
        """Whether a stamp goes on from those before."""
        if math.isnan(self._least):
            return math.isfinite(stamp_s)
        return -SOONER_S <= now - stamp_s - self._least <= LATE_MESSAGE_S

    def _is_new_clock(self, stamp_s: float, now: float) -> bool:
        """Whether stamps have gone on from elsewhere for so long that they are the sender's."""
        difference, other = now - stamp_s, self._elsewhere
        if (
            other is None
            or abs(difference - other.difference) > EVEN_S
            or stamp_s < other.newest_stamp - EVEN_S
        ):
            self._elsewhere = _Elsewhere(difference, now, stamp_s)
            return False
        if stamp_s > other.newest_stamp:
            other.count += 1
            other.newest_stamp = stamp_s
        # A clock never runs backward: if it seems to, it has started anew.
        backward = stamp_s < self._newest - LATE_MESSAGE_S or difference < self._least
        lasts_s = CERTAIN_S if backward else STANDS_S
        return other.count >= CERTAIN_COUNT and now - other.began_s >= lasts_s
