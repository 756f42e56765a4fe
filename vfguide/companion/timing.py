"""The formation's shared clock, stops of this process, and faults of the autopilot's clock.

The pilot hears of worthless stamps, a wrong rate, lost time and stutters. The difference between the clocks
of companion and autopilot grows while the autopilot's stands still, and falls again where it makes up for
that: ArduPlane in software does so after less than 0.1 s. Lost is what the difference has grown by for good:
its least value of the last 1.5 s, less the least before. An even but slow clock goes on losing for longer.
Its rate is found within some 10 s, and explains what was lost.
"""

import math
from collections import deque
from collections.abc import Callable

import msgspec

from vfguide.companion.alerts import Alerts
from vfguide.guidance.other_clock import DRIFT, OtherClock
from vfguide.mavlink.announcements import WARNING

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


REPORTED_SKEW = 0.005
"""Least skew that is worth a text: crystals are a hundred times better."""

SHARE, STEADY_S = 0.5, 10.0
"""A skew is told once it has been known, and steady, within this share of it for so long; again if it has
changed by as much. A clock that stutters and catches up looks for a shorter time like a slow or fast one."""

REPORTED_S = 0.19
"""Lost time that is worth a text: 0.2 s, less what the ways of the reports leave open."""

QUIET_S, SOONEST_S, MUCH_LOST_S = 60.0, 10.0, 0.95
"""Shortest interval of two such texts, and if another second is lost, less the same."""

SPAN_S, SPANS = 0.5, 3
"""Least differences are compared over so many spans: a loss has to last for all of them."""

STEADY_SHARE = 0.05
"""By this share of what is lost the difference may still grow. Where time is lost evenly it grows by more in
one second of the first 20, and the rate of such a clock is known before."""

LONGEST_S = 12.0
"""A clock that goes on losing time for longer, and has no rate, does so unevenly."""

CAUGHT_UP_S, CATCHES_UP_S = 0.01, 4.0
"""A clock has made up for its stutter that is as near to where it was, within so long."""

STUTTER_S, STUTTERS, STUTTERS_WITHIN_S = 0.05, 10, 60.0
"""So many stutters of at least this (1 m at 20 m/s) within so long are worth a text."""


class ClockWatch:
    """Tells a pilot what is wrong with a clock, and lost time from time that is made up for."""

    def __init__(self, clock: OtherClock, alerts: Alerts) -> None:
        self._clock, self._alerts = clock, alerts
        self._fault: str | None = None
        self._told_skew = self._explained_skew = self._steady_skew = 0.0
        self._steady_since = math.inf
        self._told_s, self._noted_s, self._sooner_s = -math.inf, math.inf, 0.0
        self._baseline = self._lost_since = self._least = math.inf
        self._spans: deque[float] = deque(maxlen=SPANS)
        self._span_ends = -math.inf
        self._stutters: deque[float] = deque(maxlen=STUTTERS)
        self._begin()

    def note(self, now: float) -> None:
        """Look at the clock; to be called after each report and each answer."""
        clock = self._clock
        if not math.isfinite(clock.most):
            return
        self._note_stamps()
        if clock.series != self._series:
            self._begin()
        self._note_skew(now)
        passed_s = max(now - self._noted_s, 0.0)
        # One that is taken for fast, and is not, would seem to lose what its times are shortened by.
        self._sooner_s += max(-clock.skew, 0.0) * passed_s
        difference = clock.most - self._sooner_s
        self._note_stutter(difference, clock.least - self._sooner_s, now)
        self._baseline = min(self._baseline + DRIFT * passed_s, difference)
        self._noted_s, self._newest = now, difference
        self._least = min(self._least, difference)
        if now >= self._span_ends:
            self._spans.append(self._least)
            self._least, self._span_ends = math.inf, now + SPAN_S
            self._judge(now)

    def _say(self, text: str) -> None:
        self._alerts.say("clock", WARNING, f"the autopilot's {text}")

    def _begin(self) -> None:
        """The clock is another one; what was told was told."""
        self._series = self._clock.series
        self._before, self._depth, self._stuttered_s = math.inf, 0.0, -math.inf
        self._newest, self._deepest = math.inf, 0.0
        self._sooner_s = 0.0
        self._stutters.clear()
        self._compare_from(-math.inf)

    def _compare_from(self, now: float) -> None:
        """What was lost until now is explained."""
        self._baseline = self._lost_since = self._least = math.inf
        self._spans.clear()
        self._span_ends = now + SPAN_S

    def _note_stamps(self) -> None:
        """Tell the pilot of stamps that tell no time, and that they do again."""
        fault, before = self._clock.fault, self._fault
        self._fault = fault
        if (fault is None) is not (before is None):
            self._say(
                "boot times tell time again: nothing to do"
                if fault is None
                else f"boot times {fault}: flown by when its reports arrive, less certainly;"
                " see its firmware and what passes its telemetry on"
            )

    def _note_skew(self, now: float) -> None:
        """Tell the pilot of a clock that does not keep time, once."""
        skew = self._clock.skew
        if abs(skew - self._explained_skew) >= REPORTED_SKEW:
            self._explained_skew = skew
            self._compare_from(now)
        share = SHARE * abs(skew)
        if self._clock.skew_error > share or abs(skew - self._steady_skew) > share:
            self._steady_skew, self._steady_since = skew, now
        if abs(skew) >= REPORTED_SKEW and now - self._steady_since < STEADY_S:
            return
        if abs(skew - self._told_skew) < max(REPORTED_SKEW, SHARE * abs(self._told_skew)):
            return
        self._told_skew = skew
        if abs(skew) >= REPORTED_SKEW:
            self._say(
                f"clock runs {abs(skew):.1%} {'slow' if skew > 0.0 else 'fast'}: its times are put right;"
                " see whether it is overloaded"
            )

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
        since_s = now - self._told_s
        if not steady and now - self._lost_since < LONGEST_S:
            return
        if since_s < SOONEST_S or (since_s < QUIET_S and lost_s < MUCH_LOST_S):
            return
        self._say(
            f"clock has lost {lost_s:.1f} s: its times are put right; see whether it is overloaded"
        )
        self._told_s, self._baseline, self._lost_since = now, settled, math.inf

    def _note_stutter(self, difference: float, at_least: float, now: float) -> None:
        """Count a stutter that is made up for, and tell the pilot of many, once in the flight.

        Args:
            difference: between the clocks at most, s.
            at_least: the same; minus infinity without answers, which alone show how deep a stutter is.
            now: s.
        """
        if at_least > self._newest + CAUGHT_UP_S:
            self._before = min(self._before, self._newest)
            self._depth = max(self._depth, at_least - self._before)
            self._stuttered_s = now
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
