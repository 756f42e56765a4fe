"""The formation's shared clock, stops of this process, and faults of the autopilot's clock.

The pilot is told of useless stamps, a wrong rate, lost time and stutters. While the autopilot's clock stands
still, its difference from the companion's grows. The difference falls again if the clock catches up, as
ArduPlane in software does after less than 0.1 s. Lost time is permanent growth of the difference: its minimum
over the last 1.5 s, less the minimum before. A steady but slow clock keeps losing time. Its rate is found
within some 10 s, and explains the loss.
"""

import math
from collections import deque
from collections.abc import Callable

import msgspec

from vfguide.companion.alerts import Alerts
from vfguide.guidance.other_clock import DRIFT, OtherClock
from vfguide.mavlink.announcements import WARNING

HANG_S = 2.0
"""Interval of two calls above which this process hung, s: input received then is old."""

STALL_S = 0.5
"""Interval of two calls above which modes are commanded only after a new question is answered, s: the first
input read has waited."""

AWAKE_S = 1.0
"""Time after a hang in which buffered input arrives, s."""


class SharedClock(msgspec.Struct, frozen=True, kw_only=True):
    """Conversion between the own clock and the formation's."""

    to_own: Callable[[float], float] = float
    """Converts a time of the shared clock to the own one, s; NaN while unknown."""
    from_own: Callable[[float], float] = float
    """Converts a time of the own clock to the shared one, s; NaN while unknown."""


SAME_CLOCK = SharedClock()
"""Identity, for companions that read one clock."""


class Wakefulness:
    """Hangs and stalls of one companion, found from the times of its calls; times in s."""

    def __init__(self) -> None:
        self._called = -math.inf
        self._awake = -math.inf
        self._stalled = -math.inf
        self.since = math.inf
        """Beginning of calls without a hang."""

    def note_call(self, now: float) -> float:
        """Note a call; return the duration of the hang before it, s, or 0."""
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
        """Check whether input arriving now has waited, and must not be used."""
        return now < self._awake

    def is_stale(self, stamp: float) -> bool:
        """Check whether a time (s) lies before the end of the last stall."""
        return stamp < self._stalled


REPORTED_SKEW = 0.005
"""Least skew worth a text: crystals are a hundred times better."""

SHARE, STEADY_S = 0.5, 10.0
"""A skew is told once known, and steady within this share, for so long (s), and again after changing by that
share. For a shorter time, a clock that stutters and catches up looks slow or fast."""

REPORTED_S = 0.19
"""Lost time worth a text, s: 0.2 s less the uncertainty of the reports' latency."""

QUIET_S, SOONEST_S, MUCH_LOST_S = 60.0, 10.0, 0.95
"""Least interval of texts about lost time, s; a shorter one once this much (almost 1 s) is lost again."""

SPAN_S, SPANS = 0.5, 3
"""Minima of the difference are compared over this many spans (s): a loss must last for all of them."""

STEADY_SHARE = 0.05
"""Growth of the difference, in parts of the loss, that still counts as settled. In its first 20 s an evenly
slow clock exceeds it each second; by then its rate is known."""

LONGEST_S = 12.0
"""A clock without a rate that loses time for longer does so unevenly, s."""

CAUGHT_UP_S, CATCHES_UP_S = 0.01, 4.0
"""A clock has caught up if it is this near to its former difference within this time, s."""

STUTTER_S, STUTTERS, STUTTERS_WITHIN_S = 0.05, 10, 60.0
"""Stutters of at least this (1 m at 20 m/s) are worth a text if so many come within this time, s."""


class ClockWatch:
    """Watch of the autopilot's clock for the pilot; tells lost time from stutters that are caught up."""

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
        """Check the clock; call after each report and each answer."""
        clock = self._clock
        if not math.isfinite(clock.most):
            return
        self._note_stamps()
        if clock.series != self._series:
            self._begin()
        self._note_skew(now)
        passed_s = max(now - self._noted_s, 0.0)
        # A clock wrongly taken for fast would seem to lose the time by which its stamps are shortened.
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
        """Begin with another clock; told faults stay told."""
        self._series = self._clock.series
        self._before, self._depth, self._stuttered_s = math.inf, 0.0, -math.inf
        self._newest, self._deepest = math.inf, 0.0
        self._sooner_s = 0.0
        self._stutters.clear()
        self._compare_from(-math.inf)

    def _compare_from(self, now: float) -> None:
        """Treat what was lost until now as explained."""
        self._baseline = self._lost_since = self._least = math.inf
        self._spans.clear()
        self._span_ends = now + SPAN_S

    def _note_stamps(self) -> None:
        """Tell the pilot when stamps become useless, and when they tell time again."""
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
        """Tell the pilot once of a clock that does not keep time."""
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
        """Tell the pilot of lost time, once the loss has lasted."""
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
        """Count stutters that are caught up, and tell the pilot of many, once per flight.

        The difference between the clocks is at least `at_least` (s). That is minus infinity without answers,
        which alone show the depth of a stutter.
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
