"""Another clock relative to the local one: offset, rate, steps and uncertainty.

No report arrives before it was made. So the smallest difference between the local clock and the stamps
belongs to the report with the least delay; others arrive later by the rest. A question asked at t0 and
answered at t3 with the other clock's time c bounds the difference: between t0 - c and t3 - c. Both kinds of
evidence narrow one interval, which widens with the possible drift of two quartz clocks. Evidence outside it
shows a step of the other clock. Two answers bound its rate.

| basis | time of a report | largest error |
|---|---|---|
| nothing | unknown | infinite |
| arrival: stamps stand still, jump, or count in another unit | arrival, less the given delay | 1.5 s |
| stamps: no question is answered | stamp plus least difference, less the given delay | 0.5 s |
| answers | the same, less half of the fastest round trip | the farther end of the interval |

Stamps of 32 bits of milliseconds wrap and continue. Stamps that fall or jump show a restarted clock once they
have continued for a second at the rate of time, without former ones between. Repeated or forged frames come
singly, all at once, or among the true ones.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import StrEnum

import msgspec

DRIFT = 100e-6
"""Largest drift between two quartz clocks, s/s: 50 ppm each."""

TICK_S = 1e-3
"""Tolerance of contradictions, s: stamps are in milliseconds."""

NANOSECOND = 1e-9

WRAP_S = 2**32 * 1e-3
"""Period of stamps with 32 bits of milliseconds, s: 49.7 days."""

FALL_S, LEAP_S = 1.0, 2.0
"""Largest fall of a stamp, and largest advance over the elapsed time, that continue a series, s."""

CERTAIN_COUNT, CERTAIN_S = 3, 1.0
"""Number of stamps in a new series, and its duration (s), that prove a restart of the other clock."""

EVEN_S = 1.0
"""Largest disagreement of a new series' stamps with the elapsed time, s."""

LONGEST_WAY_S = 5.0
"""Upper bound of the fastest report's delay as shown by answers, s."""

FOREIGN_S = 30.0
"""Contradiction between answers and reports, s, above which answers come from another or restarted clock."""

ANSWERED_S = 3.0
"""Age of the last answer, s, up to which answers alone distinguish a step from a slower link."""

SILENT_S = 5.0
"""Time after the first question without an answer, s, after which none is expected."""

RATE_WINDOW_S, APART_S = 10.0, 2.0
"""Window of the answers that show the rate, and least interval between two of them, s."""

GREATEST_SKEW = 0.2
"""Largest skew of a clock that runs evenly; a slower clock stops now and then."""


class Bracket(msgspec.Struct, frozen=True, kw_only=True):
    """Bounds of the clock difference (local minus other) from one answer."""

    asked_s: float
    """Time of the question on the local clock, s."""
    least: float
    """Lower bound, s: time of the question minus the answer's stamp."""
    most: float
    """Upper bound, s: time of reading minus the answer's stamp."""

    @property
    def other_s(self) -> float:
        """Answered time on the other clock, s."""
        return self.asked_s - self.least

    @property
    def middle(self) -> float:
        """Most likely difference, s."""
        return 0.5 * (self.least + self.most)

    def bound_s(self, now: float) -> float:
        """Return the largest error of the middle at a time, s, if neither clock has stepped."""
        return 0.5 * (self.most - self.least) + DRIFT * abs(now - self.asked_s)


def skew_bounds(brackets: "deque[Bracket]") -> tuple[float, float]:
    """Return bounds of the difference's growth per second of the other clock, from all answers.

    The lower bound exceeds the upper one where the other clock did not run evenly.
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
    """Questions for another clock's time, stamped with local time in nanoseconds."""

    def __init__(self, *, every_s: float, most_open: int) -> None:
        """Start without questions: one each `every_s` seconds at most, the newest `most_open` kept open."""
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
        """Return the time at which an answered question was asked, once; None for an unknown stamp."""
        asked_s = self._open.pop(stamp, None)
        if asked_s is not None:
            self._newest_answered_s = max(asked_s, self._newest_answered_s or asked_s)
        return asked_s

    def greatest_age(self, now: float) -> float:
        """Return the largest possible age (s) of what is received now.

        What arrives after an answer was sent after its question, however long a radio kept it. The age is
        infinite before the first answer, and 0 where none is expected.
        """
        if self._newest_answered_s is not None:
            return now - self._newest_answered_s
        first_s = self._first_s
        return 0.0 if first_s is not None and now - first_s > SILENT_S else math.inf


class StampSense:
    """Detector of stamps that do not tell time: standing still, jumping, or far too fast or slow."""

    SPAN_S = 1.5
    """Shortest time over which stamps are compared, s: radios hold messages back for as long."""
    LEAST_COUNT, MOST_COUNT = 4, 256
    """Number of reports with a moved position that a decision needs, and number kept."""
    SLOWEST, FASTEST = 0.02, 50.0
    """Plausible stamp rates, s/s; messages queued in a radio come faster only for a moment."""
    RIGHT_LOWEST, RIGHT_HIGHEST, RIGHT_S = 0.75, 1.3, 10.0
    """Stamp rates, s/s, and the time (s) within them, that restore trust."""
    LEAPS_S = 3.0
    """Time without any continued stamp, s, after which stamps do not tell time."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque(maxlen=self.MOST_COUNT)
        self._place: tuple[float, float] | None = None
        self._right_since = self._leaps_since = math.inf
        self._leaps = 0
        self.fault: str | None = None
        """Description of the stamps' fault; None while they tell time."""

    def note(self, stamp_s: float, place: tuple[float, float], now: float) -> None:
        """Add a report; one that repeats its position tells nothing about its stamp."""
        if place == self._place:
            return
        self._place = place
        seen = self._seen
        if seen and (now < seen[-1][1] or stamp_s < seen[-1][0]):
            # A restart or wrap: earlier stamps are not comparable.
            seen.clear()
            self._right_since = math.inf
        seen.append((stamp_s, now))
        while len(seen) > self.LEAST_COUNT and now - seen[1][1] >= self.SPAN_S:
            seen.popleft()
        passed_s = now - seen[0][1]
        if passed_s >= self.SPAN_S and len(seen) >= self.LEAST_COUNT:
            self._judge((stamp_s - seen[0][0]) / passed_s, now)

    def note_leap(self, now: float) -> None:
        """Add a stamp that continues no other."""
        self._leaps_since = min(self._leaps_since, now)
        self._leaps += 1
        if self._leaps >= self.LEAST_COUNT and now - self._leaps_since >= self.LEAPS_S:
            self.fault = self.fault or "leap about"

    def note_going_on(self) -> None:
        """Add a stamp that continues others."""
        self._leaps_since, self._leaps = math.inf, 0

    def _judge(self, rate: float, now: float) -> None:
        """Update the fault from the stamps' rate, s/s."""
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
    """Evidence for the times of reports."""

    NOTHING = "nothing"
    ARRIVAL = "arrival"
    STAMPS = "stamps"
    ANSWERS = "answers"


UNCERTAINTY_S = {Basis.NOTHING: math.inf, Basis.ARRIVAL: 1.5, Basis.STAMPS: 0.5}
"""Largest delay (s) of a report without evidence of it: radios hold some messages back for 1.5 s."""


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """Interpretation of a report's stamp."""

    time_s: float
    """Time of the report on the local clock, s."""
    stamp_s: float
    """Stamp without wraps on the other clock, for differences, s."""
    read_s: float
    """Time of reading on the local clock, s."""
    leap_s: float = 0.0
    """Step of the other clock at a restart, s; below 0 after a reboot, else 0."""
    is_newer: bool = True
    """Whether the stamp is newer than all before."""

    def slip_s(self, before: "Reading | None") -> float:
        """Return the time that the other clock has lost since an earlier reading, s; 0 without one."""
        if before is None:
            return 0.0
        return (self.time_s - before.time_s) - (self.stamp_s - before.stamp_s)


class Lateness(msgspec.Struct, frozen=True, kw_only=True):
    """Interpretation of late reports that no answer explains."""

    late_s: float
    """Excess over the fastest delay, s, beyond which the other clock may have lost time."""
    lasts_s: float
    """Duration of lateness that proves the loss, s."""
    usable: bool
    """Whether late reports are usable meanwhile."""


CABLE = Lateness(late_s=0.25, lasts_s=0.5, usable=True)
"""Lateness on the cable to the vehicle's own autopilot."""

RADIO = Lateness(late_s=5.0, lasts_s=10.0, usable=False)
"""Lateness over a radio: a slower radio is no clock step, and very late reports are useless."""


@dataclass(slots=True)
class Run:
    """Series of reports that agree with each other but not with those before."""

    since_s: float
    difference: float
    newest: float
    count: int = 1


class OtherClock:
    """Conversion of one sender's stamps to the local clock."""

    def __init__(self, lateness: Lateness = RADIO, *, least_way_s: float | None = None) -> None:
        """Start without knowledge; `least_way_s` is the fastest report's delay, None to learn it."""
        self._lateness, self._told_way_s = lateness, least_way_s
        self._sense = StampSense()
        self._shift_s = self._arrival_shift_s = 0.0
        self._by_arrival = False
        self._anchor = (0.0, 0.0)
        self.series = 0
        """Number of times that the knowledge was discarded for a restarted or different clock."""
        self.skew = self.skew_error = 0.0
        """Local seconds beyond one per second of the other clock, and the error bound of that."""
        self.least, self.most = -math.inf, math.inf
        """Bounds of local minus other clock at its rate, s."""
        self._narrowed_s = self._newest = self._read = self._answered_s = -math.inf
        self._brackets: deque[Bracket] = deque()
        self._elsewhere: Run | None = None
        self._late: Run | None = None

    @property
    def fault(self) -> str | None:
        """Description of the stamps' fault; None while they tell time."""
        return self._sense.fault

    @property
    def basis(self) -> Basis:
        """Present evidence for times."""
        if math.isinf(self._newest):
            return Basis.NOTHING
        if self.fault is not None:
            return Basis.ARRIVAL
        return Basis.STAMPS if math.isinf(self.least) else Basis.ANSWERS

    @property
    def least_way_s(self) -> float:
        """Delay of the fastest report, s: as given, or from answers; else 0."""
        if self._told_way_s is not None:
            return self._told_way_s
        if math.isinf(self.least) or math.isinf(self.most):
            return 0.0
        return min(0.5 * (self.most - self.least), LONGEST_WAY_S)

    @property
    def uncertainty_s(self) -> float:
        """Largest error of times, s."""
        if self.basis is not Basis.ANSWERS:
            return UNCERTAINTY_S[self.basis]
        return max(self.least_way_s, self.most - self.least - self.least_way_s)

    def read(
        self, stamp_s: float, now: float, place: tuple[float, float] | None = None
    ) -> Reading | None:
        """Return the reading of a report at `now`; None for an implausible stamp.

        Stamps (s) restart at 0 after 2^32 ms. `place` is the position, or None where stamps surely tell time.
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
        """Add an answer read at `now`: the other clock's time `other_s`, asked for at `asked_s`, all in s."""
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
        """Switch to times by arrival while stamps do not tell time, and back; neither counts as a reboot."""
        self._sense.note(stamp_s, place, now)
        worthless = self.fault is not None
        if worthless == self._by_arrival:
            return
        if worthless:
            # Continue from the newest believed stamp.
            self._arrival_shift_s = 0.0 if math.isinf(self._newest) else self._newest - self._read
            # Arrival times are on the local clock, whose rate needs no correction.
            self._anchor, self.skew, self.skew_error = (0.0, 0.0), 0.0, 0.0
        else:
            self._shift_s = now + self._arrival_shift_s - stamp_s
        self._by_arrival = worthless
        self._forget()

    def _forget(self) -> None:
        """Discard all knowledge of the other clock but its rate."""
        self.series += 1
        self.least, self.most = -math.inf, math.inf
        self._narrowed_s = self._newest = self._read = self._answered_s = -math.inf
        self._brackets.clear()
        self._elsewhere = self._late = None

    def _going_on(self, stamp_s: float) -> float:
        """Return a stamp without wraps, near the newest."""
        stamp_s += self._shift_s
        if math.isinf(self._newest):
            return stamp_s
        return stamp_s + WRAP_S * round((self._newest - stamp_s) / WRAP_S)

    def _even(self, stamp_s: float) -> float:
        """Return a stamp in seconds of the local clock, from an arbitrary zero."""
        anchor_s, even_s = self._anchor
        return even_s + (stamp_s - anchor_s) * (1.0 + self.skew)

    def _follows(self, stamp_s: float, now: float) -> bool:
        """Check whether a stamp continues the series."""
        if math.isinf(self._newest):
            return math.isfinite(stamp_s)
        return -FALL_S <= stamp_s - self._newest <= max(now - self._read, 0.0) + LEAP_S

    def _goes_on_elsewhere(self, stamp_s: float, now: float) -> bool:
        """Check whether stamps have continued a new series long enough to be the sender's."""
        run, difference = self._elsewhere, now - stamp_s
        if run is None or stamp_s < run.newest or abs(difference - run.difference) > EVEN_S:
            self._elsewhere = Run(now, difference, stamp_s)
            return False
        run.count += stamp_s > run.newest
        run.newest = stamp_s
        lasts_s = min(now - run.since_s, stamp_s - (run.since_s - run.difference))
        return run.count >= CERTAIN_COUNT and lasts_s > CERTAIN_S - TICK_S

    def _is_late(self, difference: float, stamp_s: float, now: float) -> bool:
        """Check whether a report is too late to use; many late reports show a clock that has lost time."""
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
        """Intersect the bounds of the difference with new ones, after widening the old ones by the drift."""
        apart_s = 0.0 if math.isinf(self._narrowed_s) else DRIFT * max(now - self._narrowed_s, 0.0)
        self._narrowed_s = now
        self.most = min(self.most + apart_s, most)
        self.least = max(self.least - apart_s, least)
        if self.least > self.most + TICK_S:
            # The clock has made up for a stutter, or the answer came from another clock.
            self.least = -math.inf
        self.least = min(self.least, self.most)

    def _learn_skew(self, newest: Bracket) -> None:
        """Learn the other clock's rate from the latest answers."""
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
            # An uneven clock: it has just lost time, or its rate has changed.
            self.skew_error = math.inf
            return
        # The new rate applies from the newest report.
        self._anchor = self._newest, self._even(self._newest)
        # While equal rates are possible, assume them: a slower link or an ordinary quartz changes nothing.
        skew = 0.0 if lowest <= 0.0 <= highest else 0.5 * (lowest + highest)
        self.skew = min(max(skew, -GREATEST_SKEW), GREATEST_SKEW)
        self.skew_error = 0.5 * (highest - lowest)
