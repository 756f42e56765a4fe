"""How fast an autopilot's clock runs, by its answers to TIMESYNC: one in a simulator may be percents slow.

What was asked at t0 and answered at t3 with the autopilot's time c shows that the difference between the two
clocks lay between t0 - c and t3 - c. Two such answers bound by how much it can have grown between them,
however long they were on their way. While every pair allows the rate of the companion's clock it is that: a
link that becomes slower, or an ordinary quartz, leaves it as it is.
"""

import math
from collections import deque
from dataclasses import dataclass

WINDOW_S = 10.0
"""Of the answers that are looked at: their ways there and back of some milliseconds leave 0.02 %."""

APART_S = 2.0
"""Answers nearer to each other say little."""

GREATEST_SKEW = 0.2
"""Of a clock that runs evenly; one that is slower stands still now and then."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bracket:
    """What one answer shows of the difference between the clocks."""

    autopilot_s: float
    """When it was given, s on the autopilot's clock."""
    least: float
    """Companion's clock less the autopilot's at least, s."""
    most: float
    """At most, s."""


class ClockRate:
    """Learns by how much a second of the autopilot is longer than one of the companion."""

    def __init__(self) -> None:
        self._brackets: deque[Bracket] = deque()
        self.skew = 0.0
        """Seconds of the companion beyond one, for each second of the autopilot; above 0 where it is slow."""

    def forget(self) -> None:
        """The autopilot has started anew."""
        self._brackets.clear()

    def note(self, newest: Bracket) -> bool:
        """Take the newest answer; returns whether the rate is another one now."""
        brackets = self._brackets
        if brackets and newest.autopilot_s <= brackets[-1].autopilot_s:
            brackets.clear()
        brackets.append(newest)
        while newest.autopilot_s - brackets[0].autopilot_s > WINDOW_S:
            brackets.popleft()
        oldest = brackets[0]
        if newest.autopilot_s - oldest.autopilot_s < WINDOW_S - APART_S:
            return False
        pairs = [(oldest, one) for one in brackets] + [(one, newest) for one in brackets]
        bounds = [bounds_of(*pair) for pair in pairs]
        lowest, highest = max(low for low, _ in bounds), min(high for _, high in bounds)
        if lowest > highest:
            # It does not run evenly: it has just lost time all at once, or has another rate now.
            return False
        before = self.skew
        # Where every pair says that it is not the companion's, the middle is the likeliest.
        skew = 0.0 if lowest <= 0.0 <= highest else 0.5 * (lowest + highest)
        self.skew = min(max(skew, -GREATEST_SKEW), GREATEST_SKEW)
        return self.skew != before


def bounds_of(first: Bracket, second: Bracket) -> tuple[float, float]:
    """Least and greatest growth of the difference for each second between two answers."""
    passed = second.autopilot_s - first.autopilot_s
    if passed < APART_S:
        return -math.inf, math.inf
    return (second.least - first.most) / passed, (second.most - first.least) / passed
