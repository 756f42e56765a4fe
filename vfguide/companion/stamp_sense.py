"""Whether time stamps tell time: those that stand still, or run many times too fast or slow, do not.

A sender that leaves its stamps at 0, counts microseconds or seconds where milliseconds are meant, or sends
the same stamp with one place after the other, is heard by when its messages arrive instead: later by what
they were under way, which nobody knows.
"""

import math
from collections import deque

SPAN_S = 1.5
"""Stamps are compared over at least this, on the reader's clock: radios hold messages back for as long."""

LEAST_COUNT = 4
"""Messages in which the sender has moved, at least."""

SLOWEST, FASTEST = 0.02, 50.0
"""Seconds of stamps in a second; what waits in a radio comes faster than that for no longer than a moment."""

RIGHT_LOWEST, RIGHT_HIGHEST = 0.75, 1.3
"""The same of stamps that tell time again."""

RIGHT_S = 10.0
"""For so long they have to."""

MOST_COUNT = 256
"""Stamps that are kept: a few seconds of the fastest telemetry."""

Place = tuple[float, float]


class StampSense:
    """Of the stamps of one sender."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque(maxlen=MOST_COUNT)
        self._place: Place | None = None
        self._right_since = math.inf
        self.fault: str | None = None
        """What is wrong with them, in words; None where they may tell time."""

    def note(self, stamp_s: float, place: Place, now: float) -> None:
        """Take a message.

        Args:
            stamp_s: its stamp, s.
            place: where its sender says it is; one that repeats itself wholly says nothing of its stamps.
            now: when it is read, s.
        """
        if place == self._place:
            return
        self._place = place
        seen = self._seen
        if seen and (now < seen[-1][1] or stamp_s < seen[-1][0]):
            # Started anew, or wrapped: what was before is not comparable.
            seen.clear()
            self._right_since = math.inf
        seen.append((stamp_s, now))
        while len(seen) > LEAST_COUNT and now - seen[1][1] >= SPAN_S:
            seen.popleft()
        passed_s = now - seen[0][1]
        if passed_s >= SPAN_S and len(seen) >= LEAST_COUNT:
            self._judge((stamp_s - seen[0][0]) / passed_s, now)

    def _judge(self, rate: float, now: float) -> None:
        """Decide by how many seconds of stamps have passed in one."""
        if rate < SLOWEST:
            self.fault = "stand still" if rate == 0.0 else f"run {1.0 / rate:.0f} times too slow"
        elif rate > FASTEST:
            self.fault = f"run {rate:.0f} times too fast"
        if not RIGHT_LOWEST <= rate <= RIGHT_HIGHEST:
            self._right_since = math.inf
            return
        self._right_since = min(self._right_since, now)
        if now - self._right_since >= RIGHT_S:
            self.fault = None
