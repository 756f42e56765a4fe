"""Another clock, as seen from one's own: its offset, rate, slips and uncertainty.

No report is read before it was made, so the least difference between one's own clock and the stamps of
reports is the one with the least delay in it. Later reports are late by the rest. A question that was asked
at t0 and answered at t3 with the other clock's time c shows that the difference lies between t0 - c and
t3 - c. Both kinds of evidence narrow one interval, which widens again as two quartz clocks may run apart.
Evidence outside of it shows that the other clock has slipped. Two answers bound how fast it runs.

| basis | when a report was true | wrong by at most |
|---|---|---|
| nothing | nobody knows | infinite |
| arrival: stamps stand still, leap, or count in another unit | when it arrives, less the told way | 1.5 s |
| stamps: nothing is answered | its stamp and the least difference, less the told way | 0.5 s |
| answers | the same, less half of the fastest ways there and back | the interval's farther end |

Stamps of 32 bits of milliseconds wrap and go on. Stamps that fall or leap are those of a clock that has
started anew once they have gone on for a second, as time does, with none of the former ones between them.
Frames that are repeated or forged come singly, all at once, or among the true ones.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

import msgspec

DRIFT = 100e-6
"""s/s by which two quartz clocks run apart at most: 50 ppm each."""

TICK_S = 1e-3
"""Contradictions within this are none: stamps are in milliseconds."""

NANOSECOND = 1e-9

WRAP_S = 2**32 * 1e-3
"""Stamps begin at 0 again after 32 bits of milliseconds, 49.7 days."""

FALL_S, LEAP_S = 1.0, 2.0
"""Stamps that fall back, or run ahead of the time that has passed, by more do not go on from those before."""

CERTAIN_COUNT, CERTAIN_S = 3, 1.0
"""Stamps have to go on elsewhere so often, and for so long, before the other clock has started anew."""

EVEN_S = 1.0
"""Such stamps disagree with the time that passes meanwhile by at most this."""

LONGEST_WAY_S = 5.0
"""Longest way of the fastest report that answers may show."""

FOREIGN_S = 30.0
"""Answers that contradict the reports by more come of another clock, or of one that has started anew."""

ANSWERED_S = 3.0
"""While the last answer is not older than this, answers alone tell a slip from a slower link."""

SILENT_S = 5.0
"""No answer for so long after the first question, and none will come."""

RATE_WINDOW_S, APART_S = 10.0, 2.0
"""Rates are found from answers within this, of those at least so far apart."""

GREATEST_SKEW = 0.2
"""Highest skew of a clock that runs evenly; a slower one stands still now and then."""


class Bracket(msgspec.Struct, frozen=True, kw_only=True):
    """Bounds that one answer sets for the difference between the clocks."""

    asked_s: float
    """When it was asked for, s on one's own clock."""
    least: float
    """One's own clock less the other at least, s: the time of the question less the answer's stamp."""
    most: float
    """The same at most, s."""

    @property
    def other_s(self) -> float:
        """Time that was answered, s on the other clock."""
        return self.asked_s - self.least

    @property
    def middle(self) -> float:
        """Likeliest difference, s."""
        return 0.5 * (self.least + self.most)

    def bound_s(self, now: float) -> float:
        """Greatest error of the middle at a time, s, if both clocks have run on without a step."""
        return 0.5 * (self.most - self.least) + DRIFT * abs(now - self.asked_s)


def skew_bounds(brackets: "deque[Bracket]") -> tuple[float, float]:
    """Least and greatest growth of the difference for each second of the other clock, by all answers.

    The least is above the greatest where the other clock did not run evenly.
    """
    oldest, newest = brackets[0], brackets[-1]
    lowest, highest = -math.inf, math.inf
    for one in brackets:
        for first, second in ((oldest, one), (one, newest)):
            passed = second.other_s - first.other_s
            if passed >= APART_S:
                lowest = max(lowest, (second.least - first.most) / passed)
                highest = min(highest, (second.most - first.least) / passed)
    return lowest, highest


class TimeQuestions:
    """Questions for another clock's time, which carry the time of one's own in nanoseconds."""

    def __init__(self, *, every_s: float, most_open: int) -> None:
        """Have asked nothing yet.

        Args:
            every_s: shortest interval, s.
            most_open: as many of the newest wait for an answer.
        """
        self._every_s, self._most_open = every_s, most_open
        self._open: dict[int, float] = {}
        self._first_s: float | None = None
        self._last_s = -math.inf
        self._newest_answered_s: float | None = None

    def ask(self, now: float) -> int | None:
        """Return the stamp of a question to send now, or None while none is due."""
        if now - self._last_s < self._every_s:
            return None
        self._last_s = now
        if self._first_s is None:
            self._first_s = now
        stamp = round(now / NANOSECOND)
        self._open[stamp] = now
        while len(self._open) > self._most_open:
            del self._open[next(iter(self._open))]
        return stamp

    def answered(self, stamp: int) -> float | None:
        """Return when the question of an answer was asked, once; None where nobody asked it."""
        asked_s = self._open.pop(stamp, None)
        if asked_s is not None:
            self._newest_answered_s = max(asked_s, self._newest_answered_s or asked_s)
        return asked_s

    def greatest_age(self, now: float) -> float:
        """Return how old at most (s) is what is heard now.

        What is heard after an answer was said after its question, however long a radio kept it. Infinite
        while no answer has come, 0 where none ever will.
        """
        if self._newest_answered_s is not None:
            return now - self._newest_answered_s
        first_s = self._first_s
        return 0.0 if first_s is not None and now - first_s > SILENT_S else math.inf


class StampSense:
    """Sense for stamps that tell no time: they stand still, leap, or run many times too fast or slow."""

    SPAN_S = 1.5
    """Shortest time over which stamps are compared: radios hold messages back for as long."""
    LEAST_COUNT, MOST_COUNT = 4, 256
    """Reports in which the sender has moved: so many have to come, and so many are kept."""
    SLOWEST, FASTEST = 0.02, 50.0
    """Seconds of stamps in a second; what waited in a radio comes faster for no longer than a moment."""
    RIGHT_LOWEST, RIGHT_HIGHEST, RIGHT_S = 0.75, 1.3, 10.0
    """Stamps tell time again once they have run within these rates for so long."""
    LEAPS_S = 3.0
    """Stamps of which none has gone on from another for so long tell no time either."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque(maxlen=self.MOST_COUNT)
        self._place: tuple[float, float] | None = None
        self._right_since = self._leaps_since = math.inf
        self._leaps = 0
        self.fault: str | None = None
        """What is wrong with the stamps, in words; None where they may tell time."""

    def note(self, stamp_s: float, place: tuple[float, float], now: float) -> None:
        """Take a report; one that repeats its place says nothing of the stamps."""
        if place == self._place:
            return
        self._place = place
        seen = self._seen
        if seen and (now < seen[-1][1] or stamp_s < seen[-1][0]):
            # Started anew, or wrapped: what was before is not comparable.
            seen.clear()
            self._right_since = math.inf
        seen.append((stamp_s, now))
        while len(seen) > self.LEAST_COUNT and now - seen[1][1] >= self.SPAN_S:
            seen.popleft()
        passed_s = now - seen[0][1]
        if passed_s >= self.SPAN_S and len(seen) >= self.LEAST_COUNT:
            self._judge((stamp_s - seen[0][0]) / passed_s, now)

    def note_leap(self, now: float) -> None:
        """Take a stamp that goes on from no other."""
        self._leaps_since = min(self._leaps_since, now)
        self._leaps += 1
        if self._leaps >= self.LEAST_COUNT and now - self._leaps_since >= self.LEAPS_S:
            self.fault = self.fault or "leap about"

    def note_going_on(self) -> None:
        """Take a stamp that goes on from others."""
        self._leaps_since, self._leaps = math.inf, 0

    def _judge(self, rate: float, now: float) -> None:
        """Decide by how many seconds of stamps have passed in one."""
        if rate < self.SLOWEST:
            self.fault = "stand still" if rate == 0.0 else f"run {1.0 / rate:.0f} times too slow"
        elif rate > self.FASTEST:
            self.fault = f"run {rate:.0f} times too fast"
        if not self.RIGHT_LOWEST <= rate <= self.RIGHT_HIGHEST:
            self._right_since = math.inf
            return
        self._right_since = min(self._right_since, now)
        if now - self._right_since >= self.RIGHT_S:
            self.fault = None


class Basis(StrEnum):
    """Evidence that times are known by."""

    NOTHING = "nothing"
    ARRIVAL = "arrival"
    STAMPS = "stamps"
    ANSWERS = "answers"


UNCERTAINTY_S = {Basis.NOTHING: math.inf, Basis.ARRIVAL: 1.5, Basis.STAMPS: 0.5}
"""Longest way (s) of a report whose way nothing shows: radios hold some messages back for 1.5 s."""


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """What a report's stamp says."""

    time_s: float
    """When the report was true, s on one's own clock."""
    stamp_s: float
    """The stamp without wraps, for differences, s on the other clock."""
    read_s: float
    """When it was read, s on one's own clock."""
    leap_s: float = 0.0
    """What the other clock has leapt by as it started anew, s; below 0 after a reboot, else 0."""
    is_newer: bool = True
    """Whether it is newer than all before."""

    def slip_s(self, before: "Reading | None") -> float:
        """Return what the other clock was found to have lost since a reading before, s; 0 without one."""
        if before is None:
            return 0.0
        return (self.time_s - before.time_s) - (self.stamp_s - before.stamp_s)


class Lateness(msgspec.Struct, frozen=True, kw_only=True):
    """What reports mean that come late and are not explained by answers."""

    late_s: float
    """Later than the fastest by more than this they may come of a clock that has lost time."""
    lasts_s: float
    """They do, once all have been late for so long."""
    usable: bool
    """Whether such reports are of use meanwhile."""


CABLE = Lateness(late_s=0.25, lasts_s=0.5, usable=True)
"""On the link to one's own autopilot."""

RADIO = Lateness(late_s=5.0, lasts_s=10.0, usable=False)
"""Over a radio: one that becomes slow is no slip, and what is so late is of no use."""


@dataclass(slots=True)
class Run:
    """Reports that agree with each other, and not with those before."""

    since_s: float
    difference: float
    newest: float
    count: int = 1


class OtherClock:
    """Puts the stamps of one sender onto one's own clock."""

    def __init__(self, lateness: Lateness = RADIO, *, least_way_s: float | None = None) -> None:
        """Know nothing yet.

        Args:
            lateness: what late reports mean.
            least_way_s: how long the fastest report takes; None where answers are to show it.
        """
        self._lateness, self._told_way_s = lateness, least_way_s
        self._sense = StampSense()
        self._shift_s = self._arrival_shift_s = 0.0
        self._by_arrival = False
        self._anchor = (0.0, 0.0)
        self.series = 0
        """How often all that was known has been forgotten, as the other clock is another one."""
        self.skew = self.skew_error = 0.0
        """Seconds beyond one that pass for each second of the other clock, and what that may be wrong by."""
        self.least, self.most = -math.inf, math.inf
        """One's own clock less the other one, s, at its rate: at least, and at most."""
        self._narrowed_s = self._newest = self._read = self._answered_s = -math.inf
        self._brackets: deque[Bracket] = deque()
        self._elsewhere: Run | None = None
        self._late: Run | None = None

    @property
    def fault(self) -> str | None:
        """What is wrong with the stamps, in words; None where they tell time."""
        return self._sense.fault

    @property
    def basis(self) -> Basis:
        """What times are known by."""
        if math.isinf(self._newest):
            return Basis.NOTHING
        if self.fault is not None:
            return Basis.ARRIVAL
        return Basis.STAMPS if math.isinf(self.least) else Basis.ANSWERS

    @property
    def least_way_s(self) -> float:
        """How long the fastest report takes, s: as it was told, or by the answers that have come; else 0."""
        if self._told_way_s is not None:
            return self._told_way_s
        if math.isinf(self.least) or math.isinf(self.most):
            return 0.0
        return min(0.5 * (self.most - self.least), LONGEST_WAY_S)

    @property
    def uncertainty_s(self) -> float:
        """What times are wrong by at most, s."""
        if self.basis is not Basis.ANSWERS:
            return UNCERTAINTY_S[self.basis]
        return max(self.least_way_s, self.most - self.least - self.least_way_s)

    def read(
        self, stamp_s: float, now: float, place: tuple[float, float] | None = None
    ) -> Reading | None:
        """Tell when a report that is read now was true; None where its stamp cannot be believed.

        Args:
            stamp_s: of the report, s; begins at 0 again after 2^32 ms.
            now: s on one's own clock.
            place: that is reported with it; None where stamps are known to tell time.
        """
        if place is not None:
            self._sense_stamp(stamp_s, place, now)
        stamp_s = now + self._arrival_shift_s if self.fault else self._going_on(stamp_s)
        leap_s = 0.0
        if not self._follows(stamp_s, now):
            if not self._goes_on_elsewhere(stamp_s, now):
                if place is not None:
                    self._sense.note_leap(now)
                return None
            leap_s = stamp_s - self._newest
            self._forget()
        if self._is_late(now - self._even(stamp_s), stamp_s, now):
            return None
        self._elsewhere = None
        self._sense.note_going_on()
        is_newer = stamp_s > self._newest
        if is_newer:
            self._newest, self._read = stamp_s, now
        self._narrow(-math.inf, now - self._even(stamp_s), now)
        return Reading(
            time_s=self._even(stamp_s) + self.most - self.least_way_s,
            stamp_s=stamp_s,
            read_s=now,
            leap_s=leap_s,
            is_newer=is_newer,
        )

    def answer(self, asked_s: float, other_s: float, now: float) -> None:
        """Take an answer, which the other clock's time came in.

        Args:
            asked_s: when it was asked for, s on one's own clock.
            other_s: what the other clock showed, s.
            now: when the answer is read, s on one's own clock.
        """
        if self.basis in {Basis.NOTHING, Basis.ARRIVAL} or self._elsewhere is not None:
            return
        other_s = self._going_on(other_s)
        even_s = self._even(other_s)
        least, most = asked_s - even_s, now - even_s
        if most < self.most - LEAP_S or least > self.most + FOREIGN_S:
            return
        self._answered_s = now
        if least > self.most + TICK_S:
            self.least, self.most = least, most
        self._narrow(least, most, now)
        self._learn_skew(Bracket(asked_s=asked_s, least=asked_s - other_s, most=now - other_s))

    def _sense_stamp(self, stamp_s: float, place: tuple[float, float], now: float) -> None:
        """Go over to times by arrival where stamps tell no time, and back again; neither is a reboot."""
        self._sense.note(stamp_s, place, now)
        worthless = self.fault is not None
        if worthless == self._by_arrival:
            return
        if worthless:
            # Goes on from the newest that was believed.
            self._arrival_shift_s = 0.0 if math.isinf(self._newest) else self._newest - self._read
            # Arrival is on one's own clock, whose rate needs no correction.
            self._anchor, self.skew, self.skew_error = (0.0, 0.0), 0.0, 0.0
        else:
            self._shift_s = now + self._arrival_shift_s - stamp_s
        self._by_arrival = worthless
        self._forget()

    def _forget(self) -> None:
        """Nothing is known of the other clock any more; its rate is likely to be the same."""
        self.series += 1
        self.least, self.most = -math.inf, math.inf
        self._narrowed_s = self._newest = self._read = self._answered_s = -math.inf
        self._brackets.clear()
        self._elsewhere = self._late = None

    def _going_on(self, stamp_s: float) -> float:
        """A stamp without wraps, after those before."""
        stamp_s += self._shift_s
        if math.isinf(self._newest):
            return stamp_s
        return stamp_s + WRAP_S * round((self._newest - stamp_s) / WRAP_S)

    def _even(self, stamp_s: float) -> float:
        """A stamp in seconds of one's own clock, from an arbitrary zero."""
        anchor_s, even_s = self._anchor
        return even_s + (stamp_s - anchor_s) * (1.0 + self.skew)

    def _follows(self, stamp_s: float, now: float) -> bool:
        """Whether a stamp follows from those before."""
        if math.isinf(self._newest):
            return math.isfinite(stamp_s)
        return -FALL_S <= stamp_s - self._newest <= max(now - self._read, 0.0) + LEAP_S

    def _goes_on_elsewhere(self, stamp_s: float, now: float) -> bool:
        """Whether stamps have gone on from another one for so long that they are the sender's."""
        run, difference = self._elsewhere, now - stamp_s
        if run is None or stamp_s < run.newest or abs(difference - run.difference) > EVEN_S:
            self._elsewhere = Run(now, difference, stamp_s)
            return False
        run.count += stamp_s > run.newest
        run.newest = stamp_s
        lasts_s = min(now - run.since_s, stamp_s - (run.since_s - run.difference))
        return run.count >= CERTAIN_COUNT and lasts_s > CERTAIN_S - TICK_S

    def _is_late(self, difference: float, stamp_s: float, now: float) -> bool:
        """Whether a report is so late that it is of no use; many show a clock that has lost time."""
        late, lateness = self._late, self._lateness
        if difference - self.most <= lateness.late_s:
            self._late = None
            return False
        if late is None or now - self._answered_s <= ANSWERED_S:
            self._late = Run(now, difference, stamp_s)
            return not lateness.usable
        late.difference = min(late.difference, difference)
        late.count += stamp_s > late.newest
        late.newest = max(late.newest, stamp_s)
        if late.count < CERTAIN_COUNT or now - late.since_s < lateness.lasts_s:
            return not lateness.usable
        self.least, self.most, self._late = -math.inf, late.difference, None
        return False

    def _narrow(self, least: float, most: float, now: float) -> None:
        """Take new bounds of the difference; the old ones widen as the clocks may run apart."""
        apart_s = 0.0 if math.isinf(self._narrowed_s) else DRIFT * max(now - self._narrowed_s, 0.0)
        self._narrowed_s = now
        self.most = min(self.most + apart_s, most)
        self.least = max(self.least - apart_s, least)
        if self.least > self.most + TICK_S:
            # It has made up for a stutter, or the answer was none of this clock's.
            self.least = -math.inf
        self.least = min(self.least, self.most)

    def _learn_skew(self, newest: Bracket) -> None:
        """Learn how fast the other clock runs from the answers of the last seconds."""
        brackets = self._brackets
        if brackets and newest.other_s <= brackets[-1].other_s:
            brackets.clear()
        brackets.append(newest)
        while newest.other_s - brackets[0].other_s > RATE_WINDOW_S:
            brackets.popleft()
        if newest.other_s - brackets[0].other_s < RATE_WINDOW_S - APART_S:
            return
        lowest, highest = skew_bounds(brackets)
        if lowest > highest:
            # It does not run evenly: it has just lost time all at once, or has another rate now.
            self.skew_error = math.inf
            return
        # With the new rate everything goes on from the newest report.
        self._anchor = self._newest, self._even(self._newest)
        # While one's own rate is possible it is that: a slower link or an ordinary quartz changes nothing.
        skew = 0.0 if lowest <= 0.0 <= highest else 0.5 * (lowest + highest)
        self.skew = min(max(skew, -GREATEST_SKEW), GREATEST_SKEW)
        self.skew_error = 0.5 * (highest - lowest)
