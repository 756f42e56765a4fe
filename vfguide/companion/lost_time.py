"""What a pilot hears of time that an autopilot's clock loses.

The difference between the companion's clock and the autopilot's grows where the autopilot's stands still, and
falls again where it makes up for that: ArduPlane in software does so after less than 0.1 s. Lost is what the
difference has grown by for good: its least value of the last 2 s, less the least before. A clock that runs
evenly, but slow, goes on losing for longer; how slow is found within some 10 s (`autopilot_clock.ClockRate`),
and what was lost meanwhile is put down to that.
"""

import math
from collections import deque

from vfguide.companion.alerts import Alerts
from vfguide.mavlink.announcements import WARNING

REPORTED_S = 0.19
"""Lost time that is worth a text to the pilot: 0.2 s, less what the ways of the reports leave open."""

QUIET_S = 60.0
"""Shortest interval of two such texts, unless much more is lost than before."""

MUCH_LOST_S = 1.0
"""So much more is told sooner."""

SOONEST_S = 10.0
"""Shortest interval of two texts however much is lost: a clock that loses time for a while is worth one."""

SPAN_S = 0.5
"""Of each of the least differences that are compared."""

SPANS = 3
"""A slip has lasted for so many of them."""

STEADY_SHARE = 0.05
"""By this share of what is lost the difference may still grow. Where time is lost evenly it grows by more in
one second of the first 20, and the rate of such a clock is known before."""

LONGEST_S = 12.0
"""A clock that goes on losing time for longer, and has no rate, does so unevenly."""

CAUGHT_UP_S = 0.01
"""Nearer to where it was before, and a clock has made up for its stutter."""

CATCHES_UP_S = 4.0
"""Within this after a stutter: what is made up for later was lost meanwhile."""

STUTTER_S = 0.05
"""Shorter ones are not worth a text: 1 m at 20 m/s."""

STUTTERS, STUTTERS_WITHIN_S = 10, 60.0
"""So many within so long are."""


class LostTime:
    """Tells lost time from time that is made up for."""

    def __init__(self, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self._told_s = -math.inf
        self._spans: deque[float] = deque(maxlen=SPANS)
        self._least = math.inf
        self._span_ends = -math.inf
        self.forget()

    def forget(self) -> None:
        """The autopilot has started anew; what was told was told."""
        self._baseline = math.inf
        self._lost_since = math.inf
        self._begin_spans(-math.inf)
        self._before, self._depth, self._stuttered_s = math.inf, 0.0, -math.inf
        self._deepest = 0.0
        self._stutters: deque[float] = deque(maxlen=STUTTERS)

    def slipped(self, before: float, at_least: float, now: float) -> None:
        """The difference has grown, perhaps only for a moment.

        Args:
            before: the least difference until now, s.
            at_least: what it is now at least, s.
            now: s.
        """
        self._before = min(self._before, before)
        self._depth = max(self._depth, at_least - self._before)
        self._stuttered_s = now

    def forgotten(self, grown_s: float) -> None:
        """The difference has grown by this (s) as old reports count no more: drift, or a slower link."""
        self._baseline += grown_s

    def explained(self, now: float) -> None:
        """All that was lost until now is put down to the rate of the clock."""
        self._baseline, self._lost_since = math.inf, math.inf
        self._begin_spans(now)

    def note(self, difference: float, now: float) -> None:
        """Take the least difference (s) that is known now; to be called with each report."""
        self._note_stutter(difference, now)
        self._baseline = min(self._baseline, difference)
        self._least = min(self._least, difference)
        if now >= self._span_ends:
            self._spans.append(self._least)
            self._least, self._span_ends = math.inf, now + SPAN_S
            self._judge(now)

    def _begin_spans(self, now: float) -> None:
        """Compare only what comes from now on."""
        self._spans.clear()
        self._least, self._span_ends = math.inf, now + SPAN_S

    def _judge(self, now: float) -> None:
        """Tell the pilot of what is lost, once it has lasted."""
        spans = self._spans
        settled = min(spans)
        lost_s = settled - self._baseline
        if len(spans) < SPANS or lost_s < REPORTED_S:
            self._lost_since = math.inf
            return
        self._lost_since = min(self._lost_since, now)
        steady = spans[-1] - spans[0] <= STEADY_SHARE * lost_s
        if not steady and now - self._lost_since < LONGEST_S:
            return
        since_s = now - self._told_s
        if since_s < SOONEST_S or (since_s < QUIET_S and lost_s < MUCH_LOST_S):
            return
        self._alerts.say(
            "clock",
            WARNING,
            f"the autopilot's clock has lost {lost_s:.1f} s: its times are put right;"
            " see whether it is overloaded",
        )
        self._told_s, self._baseline, self._lost_since = now, settled, math.inf

    def _note_stutter(self, difference: float, now: float) -> None:
        """Count a stutter that is made up for, and tell the pilot of many, once in the flight."""
        if self._depth == 0.0:
            return
        caught_up = difference <= self._before + CAUGHT_UP_S
        if not caught_up and now - self._stuttered_s < CATCHES_UP_S:
            return
        if caught_up and self._depth >= STUTTER_S:
            self._stutters.append(now)
            self._deepest = max(self._deepest, self._depth)
        self._before, self._depth = math.inf, 0.0
        many = len(self._stutters) == STUTTERS and now - self._stutters[0] <= STUTTERS_WITHIN_S
        if many:
            self._alerts.say(
                "clock: stutter",
                WARNING,
                f"the autopilot's clock stutters by up to {self._deepest:.2f} s and catches up:"
                " the computer it runs on is busy",
                quiet_s=math.inf,
            )
