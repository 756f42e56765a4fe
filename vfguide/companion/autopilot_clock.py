"""An autopilot's clock, as seen from the companion's: it slips, runs slow, wraps, and starts anew.

A report is never read before it was made, so the least difference between the reader's clock and the
autopilot's is the one with the least delay in it. From reports alone a clock that has lost time looks like a
link that has become slower. TIMESYNC tells the two apart: what was asked at t0 and answered at t3 with the
autopilot's time c shows that the difference lies between t0 - c and t3 - c.

An answer shows something else, too: what comes after it on the same stream was said after t0. So nothing
that is heard is older than the newest question that has been answered, however long it waited in a radio.

How fast an autopilot's clock runs, by its answers to TIMESYNC: one in a simulator may be percents slow.

What was asked at t0 and answered at t3 with the autopilot's time c shows that the difference between the two
clocks lay between t0 - c and t3 - c. Two such answers bound by how much it can have grown between them,
however long they were on their way. While every pair allows the rate of the companion's clock it is that: a
link that becomes slower, or an ordinary quartz, leaves it as it is.
"""

import math
from collections import deque
from dataclasses import dataclass

import msgspec

from vfguide.companion.alerts import Alerts
from vfguide.companion.lost_time import LostTime
from vfguide.companion.stamp_sense import StampSense
from vfguide.mavlink.announcements import WARNING

RATE_WINDOW_S = 10.0
"""Of the answers that are looked at: their ways there and back of some milliseconds leave 0.02 %."""

APART_S = 2.0
"""Answers nearer to each other say little."""

CONFIRMED_S = 20.0
"""Over this the least differences of two windows have to show a rate, too, before the pilot hears of it: a
clock that stutters and catches up looks now and then like one that runs slow or fast."""

GREATEST_SKEW = 0.2
"""Of a clock that runs evenly; one that is slower stands still now and then."""

ASK_S = 0.5
"""Between questions for the autopilot's time: a slip is found in less than a second."""

OPEN = 40
"""Questions that an answer is awaited for: telemetry that is 20 s late is known to be."""

SILENT_S = 5.0
"""Not one answer for so long after the first question: an autopilot that has none."""

NANOSECOND = 1e-9

ROUNDING_S = 0.01
"""Stamps are in milliseconds, and two quartz clocks drift apart by some of them in a window."""

SLIP_S = 0.25
"""Without answers: reports that all come later by more than this show a clock that has lost time."""

UNANSWERED_LOOK_S = 0.5
"""Without answers: for how long they have to, at least."""

UNANSWERED_S = 3.0
"""After this the autopilot is taken for one that does not answer."""

REPORTED_SKEW = 0.005
"""By which a clock may be slow or fast before the pilot is told: crystals are a hundred times better."""

WINDOW_S = 30.0
"""How long a fast report is remembered: two clocks drift apart by some milliseconds in this time."""

ARRIVAL_STEP_S = 0.001
"""By which boot times by arrival begin after the newest that was believed."""

WRAP_S = 2**32 * 1e-3
"""Boot times are counted in 32 bits of milliseconds: after 49.7 days they begin at 0 again."""

FALL_S = 1.0
"""A boot time that falls back by more than this is no late report of an ordinary link."""

LEAP_S = 2.0
"""A boot time that runs ahead of the time that has passed by more than this is no ordinary report either."""

CERTAIN_S = 1.0
"""For so long boot times have to go on from elsewhere, as time does and with none of the former ones between
them. Frames that are repeated or forged come singly, all at once, or among the autopilot's own."""

CERTAIN_COUNT = 3
"""How many of them, at least."""

EVEN = 0.25
"""By this share of the time that has passed they may disagree with it, and by 0.1 s of jitter."""


class Bracket(msgspec.Struct, frozen=True, kw_only=True):
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
        self._least: deque[tuple[float, float]] = deque()
        self.skew = 0.0
        """Seconds of the companion beyond one, for each second of the autopilot; above 0 where it is slow."""

    def forget(self) -> None:
        """The autopilot has started anew."""
        self._brackets.clear()
        self._least.clear()

    @property
    def is_confirmed(self) -> bool:
        """Whether the least differences show the rate as well, within half of it."""
        if not self._least:
            return False
        (began, before), (ended, after) = self._least[0], self._least[-1]
        passed = ended - began
        if passed < CONFIRMED_S - APART_S:
            return False
        return abs((after - before) / passed - self.skew) <= 0.5 * abs(self.skew)

    def note(self, newest: Bracket) -> bool:
        """Take the newest answer; returns whether the rate is another one now."""
        brackets = self._brackets
        if brackets and newest.autopilot_s <= brackets[-1].autopilot_s:
            self.forget()
        brackets.append(newest)
        while newest.autopilot_s - brackets[0].autopilot_s > RATE_WINDOW_S:
            brackets.popleft()
        oldest = brackets[0]
        if newest.autopilot_s - oldest.autopilot_s < RATE_WINDOW_S - APART_S:
            return False
        self._least.append((newest.autopilot_s, min(one.most for one in brackets)))
        while newest.autopilot_s - self._least[0][0] > CONFIRMED_S:
            self._least.popleft()
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


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """What a report's boot time says."""

    time_s: float
    """When the report was true, s on the companion's clock."""
    boot_time_s: float
    """Boot time of the autopilot, s, without wraps."""
    read_s: float
    """When it was read, s on the companion's clock."""
    skew: float
    """Seconds beyond one that pass here for each second of the autopilot."""
    rebooted: bool = False
    """Whether it shows that the autopilot has started anew."""


@dataclass(slots=True)
class Elsewhere:
    """Boot times that do not follow from those before."""

    began: tuple[float, float]
    """The first: boot time and when it was read, s."""
    newest: float
    """The last boot time, s."""
    count: int = 1
    """How many."""


class AutopilotClock:
    """Puts an autopilot's boot times onto the companion's clock."""

    def __init__(self, alerts: Alerts | None = None) -> None:
        self._alerts = alerts or Alerts()
        self._asked: dict[int, float] = {}
        self._rate = ClockRate()
        self._anchor = (0.0, 0.0)
        self._reported_skew = 0.0
        self._explained_skew = self._sooner_s = 0.0
        self._lost = LostTime(self._alerts)
        self._sense = StampSense()
        self._arrival_offset_s = self._offset_s = 0.0
        self._elsewhere: Elsewhere | None = None
        self._least = self._least_before = self._recent = math.inf
        self._window_ends = self._look_ends = -math.inf
        self._looked = 0
        self._newest = self._read = -math.inf
        self._asked_time = self._answered = -math.inf
        self._first_asked: float | None = None
        self._newest_answered: float | None = None

    def read(
        self, boot_time_s: float, now: float, place: tuple[float, float] | None = None
    ) -> Reading | None:
        """When a report that is read now was true; None where its boot time cannot be believed.

        Boot times that tell no time are replaced by when reports arrive: their clock goes on from there.

        Args:
            boot_time_s: as reported, s; begins at 0 again after 2^32 ms.
            now: s on the companion's clock.
            place: that is reported with it; None where that does not matter.
        """
        if place is not None:
            boot_time_s = self._sensible(boot_time_s, place, now)
        boot_time_s = self._unwrapped(boot_time_s)
        rebooted = False
        if not self._follows(boot_time_s, now):
            if not self._goes_on_elsewhere(boot_time_s, now):
                return None
            rebooted = boot_time_s < self._newest
            self._forget()
        self._elsewhere = None
        self._note(boot_time_s, now)
        return Reading(
            time_s=self._even(boot_time_s) + self._difference,
            boot_time_s=boot_time_s,
            read_s=now,
            skew=self._rate.skew,
            rebooted=rebooted,
        )

    def _sensible(self, boot_time_s: float, place: tuple[float, float], now: float) -> float:
        """A boot time, or one by arrival that goes on from the last where boot times tell no time."""
        before = self._sense.fault
        self._sense.note(boot_time_s, place, now)
        fault = self._sense.fault
        if fault is not None and before is None:
            # It goes on from the newest that was believed, without what answers have said of another clock.
            self._arrival_offset_s = max(self._newest, 0.0) + ARRIVAL_STEP_S - now
            self._forget()
            self._alerts.say(
                "clock",
                WARNING,
                f"the autopilot's boot times {fault}: flown by when its reports arrive, less certainly;"
                " see its firmware and what passes its telemetry on",
            )
        elif fault is None and before is not None:
            # Goes on from there, too: the autopilot has not started anew.
            self._offset_s = now + self._arrival_offset_s - boot_time_s
            self._forget()
            self._alerts.say(
                "clock", WARNING, "the autopilot's boot times tell time again: nothing to do"
            )
        return (boot_time_s + self._offset_s) if fault is None else now + self._arrival_offset_s

    def ask(self, now: float) -> int | None:
        """The stamp (ns) of a question to send now, or None while none is due."""
        if now - self._asked_time < ASK_S:
            return None
        self._asked_time = now
        if self._first_asked is None:
            self._first_asked = now
        stamp = round(now / NANOSECOND)
        self._asked[stamp] = now
        while len(self._asked) > OPEN:
            del self._asked[next(iter(self._asked))]
        return stamp

    def answer(self, stamp: int, autopilot_ns: int, now: float) -> None:
        """Take the answer to a question, which carries its stamp; others are passed over."""
        asked = self._asked.pop(stamp, None)
        if asked is not None:
            self._newest_answered = max(asked, self._newest_answered or asked)
        if asked is None or not math.isfinite(self._newest) or self._sense.fault is not None:
            return
        time_s = autopilot_ns * NANOSECOND + self._offset_s
        # The answer's clock does not wrap.
        time_s += WRAP_S * round((self._newest - time_s) / WRAP_S)
        least, most = asked - self._even(time_s), now - self._even(time_s)
        if self._elsewhere is not None or least - self._difference > WINDOW_S:
            # A reboot that has not shown in the reports yet.
            return
        self._answered = now
        if self._difference < least - ROUNDING_S:
            self._slipped(most, least, now)
        self._least = min(self._least, most)
        bracket = Bracket(autopilot_s=time_s, least=asked - time_s, most=now - time_s)
        # With the new rate everything goes on from the newest report.
        anchor = self._newest, self._even(self._newest)
        if self._rate.note(bracket):
            self._anchor = anchor
        self._tell_of_rate(now)

    def greatest_age(self, now: float) -> float:
        """How old at most (s) is what is heard now; infinite while not known, 0 without any answer ever."""
        if self._newest_answered is not None:
            return now - self._newest_answered
        asked = self._first_asked
        return 0.0 if asked is not None and now - asked > SILENT_S else math.inf

    @property
    def _difference(self) -> float:
        return min(self._least, self._least_before)

    def _even(self, boot_time_s: float) -> float:
        """A boot time in seconds of the companion, from an arbitrary zero."""
        boot_s, even_s = self._anchor
        return even_s + (boot_time_s - boot_s) * (1.0 + self._rate.skew)

    def _tell_of_rate(self, now: float) -> None:
        """Tell the pilot of a clock that does not keep time, once."""
        skew = self._rate.skew
        if abs(skew - self._explained_skew) >= REPORTED_SKEW:
            self._explained_skew = skew
            self._lost.explained(now)
        if abs(skew) >= REPORTED_SKEW and not self._rate.is_confirmed:
            return
        if abs(skew - self._reported_skew) < max(REPORTED_SKEW, 0.5 * abs(self._reported_skew)):
            return
        self._reported_skew = skew
        if abs(skew) < REPORTED_SKEW:
            return
        self._alerts.say(
            "clock",
            WARNING,
            f"the autopilot's clock runs {abs(skew):.1%} {'slow' if skew > 0.0 else 'fast'}: its times are"
            " put right; see whether it is overloaded",
        )

    def _forget(self) -> None:
        """Nothing is known of the autopilot any more."""
        self._rate.forget()
        self._lost.forget()
        self._least = self._least_before = self._recent = math.inf
        self._window_ends = self._look_ends = -math.inf
        self._looked = 0
        self._newest = self._read = -math.inf
        self._asked_time = self._answered = -math.inf
        self._elsewhere = None
        self._asked.clear()

    def _unwrapped(self, boot_time_s: float) -> float:
        if not math.isfinite(self._newest):
            return boot_time_s
        return boot_time_s + WRAP_S * round((self._newest - boot_time_s) / WRAP_S)

    def _follows(self, boot_time_s: float, now: float) -> bool:
        """Whether a boot time follows from those before."""
        if not math.isfinite(self._newest):
            return True
        ahead = boot_time_s - self._newest
        return -FALL_S <= ahead <= max(now - self._read, 0.0) + LEAP_S

    def _goes_on_elsewhere(self, boot_time_s: float, now: float) -> bool:
        """Whether boot times have gone on from another one for so long that it is the autopilot's."""
        other = self._elsewhere
        if other is None or boot_time_s < other.newest:
            self._elsewhere = Elsewhere((boot_time_s, now), boot_time_s)
            return False
        went_on, passed = boot_time_s - other.began[0], now - other.began[1]
        if abs(went_on - passed) > EVEN * passed + 0.1:
            self._elsewhere = Elsewhere((boot_time_s, now), boot_time_s)
            return False
        other.count += boot_time_s > other.newest
        other.newest = boot_time_s
        return went_on >= CERTAIN_S and other.count >= CERTAIN_COUNT

    def _note(self, boot_time_s: float, now: float) -> None:
        """Learn from a report."""
        if boot_time_s > self._newest:
            if math.isfinite(self._newest):
                # One that is taken for fast, and is not, would seem to lose what its times are shortened by.
                self._sooner_s += max(-self._rate.skew, 0.0) * (boot_time_s - self._newest)
            self._newest, self._read = boot_time_s, now
        difference = now - self._even(boot_time_s)
        if now >= self._window_ends:
            before = self._difference
            self._least_before, self._least = self._least, difference
            self._window_ends = now + WINDOW_S
            self._lost.forgotten(max(self._difference - before, 0.0))
        self._least = min(self._least, difference)
        if now >= self._look_ends:
            late = self._recent - self._difference
            unanswered = now - self._answered > UNANSWERED_S
            if unanswered and self._looked >= 2 and SLIP_S < late < math.inf:
                lowest = min(self._recent, difference)
                self._slipped(lowest, lowest, now)
            self._recent, self._looked = math.inf, 0
            self._look_ends = now + UNANSWERED_LOOK_S
        self._recent = min(self._recent, difference)
        self._looked += 1
        self._lost.note(self._difference - self._sooner_s, now)

    def _slipped(self, difference: float, at_least: float, now: float) -> None:
        """The autopilot's clock has lost time: what was learned before is not so any more."""
        self._lost.slipped(self._difference - self._sooner_s, at_least - self._sooner_s, now)
        self._least, self._least_before = difference, math.inf
        self._window_ends = now + WINDOW_S
