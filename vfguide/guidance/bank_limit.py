"""How far an aircraft banks, learned where it stays at one bank although clearly more is asked of it.

While its bank hardly moves for `PLATEAU_S` the aircraft is on a plateau. Below its limit the bank is in
proportion to the error of the course, whatever alpha is: plateaus of smaller banks show how much error one
takes. Where every error meanwhile, and as long before as the aircraft is late, is `MORE` times what its bank
takes, more is asked than it gives. Several such plateaus at the same bank, or a long one, and never a greater
bank, are its limit.
"""

import math
from collections import deque

import msgspec

from vfguide.state import GAP_S

PLATEAU_S = 2.0
"""So long the bank hardly moves, s."""

STEADY = math.radians(3.0)
"""From the least to the greatest bank of a plateau, rad."""

MORE = 1.3
"""Times the error that a bank usually takes: so much is more than the aircraft gives."""

LEAST_BANK, LEAST_LIMIT = math.radians(3.0), math.radians(10.0)
"""rad; banks that are less tell nothing, and are no limit of any aircraft."""

SMALLER = math.radians(3.0)
"""rad by which a bank has to be smaller to tell what is usual."""

USUAL_S = 3.0
"""s of smaller banks that tell it."""

TAKE_S = 0.25
"""Moments on plateaus are taken so far apart, s."""

MOST_MOMENTS = 480
"""Of them, the newest."""

SAME = math.radians(2.5)
"""Plateaus that differ by less are of one limit; what goes further by more is beyond it, rad."""

APART_S = 3.0
"""Two plateaus at the same bank have so long between them, s."""

MUCH_MORE = 2.0
"""The same where no smaller banks were flown: an aircraft whose error grows twice as great at one bank."""

LEAST_S, LONG_S = 4.0, 10.0
"""Evidence that it takes, s beyond `PLATEAU_S` of each: on several plateaus, or on one."""


class BankMoment(msgspec.Struct, frozen=True, kw_only=True):
    """One report."""

    time_s: float
    """s."""
    bank: float
    """rad, positive right."""
    asked: float
    """Error of the course times V / g, s: times alpha it is the tangent of the bank that is asked for."""


class PlateauMoment(msgspec.Struct, frozen=True, kw_only=True):
    """A moment on a plateau."""

    level: float
    """Its bank to either side, rad."""
    usual: float
    """Mean error of the course over the plateau, over the tangent of the bank, as of `BankMoment`."""
    least: float
    """The least of that."""
    number: int
    """Of the plateau."""


class BankLimit:
    """Learns how far one aircraft banks."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self.value: float | None = None
        """The limit, rad; None while none is known."""
        self._moments: deque[BankMoment] = deque()
        self._plateaus: deque[PlateauMoment] = deque(maxlen=MOST_MOMENTS)
        self._number = 0
        self._taken_s = -math.inf
        self._level = 0.0
        self._greatest = 0.0

    def interrupt(self) -> None:
        """Forget the last moments: nothing is asked of it now."""
        self._moments.clear()

    def observe(self, moment: BankMoment, late: float) -> None:
        """Take a report.

        Args:
            moment: of the report.
            late: dead time and lag of the course at most, s.
        """
        now, moments = moment.time_s, self._moments
        if moments and not 0.0 <= now - moments[-1].time_s <= GAP_S:
            moments.clear()
        moments.append(moment)
        while now - moments[0].time_s > PLATEAU_S + late:
            moments.popleft()
        if now - self._taken_s < TAKE_S or now - moments[0].time_s < 0.9 * (PLATEAU_S + late):
            return
        banks = [one.bank for one in moments if now - one.time_s <= PLATEAU_S]
        level = sum(banks) / len(banks)
        self._greatest = max(self._greatest, abs(level))
        if max(banks) - min(banks) <= STEADY and abs(level) >= LEAST_BANK:
            tangent = math.tan(level)
            ratios = [one.asked / tangent for one in moments]
            is_same = abs(level - self._level) < SMALLER and now - self._taken_s < APART_S
            self._number += not is_same
            self._taken_s, self._level = now, level
            self._plateaus.append(
                PlateauMoment(
                    level=abs(level),
                    usual=sum(ratios) / len(ratios),
                    least=min(ratios),
                    number=self._number,
                )
            )
        self.value = self._limit()

    def _limit(self) -> float | None:
        """Return the bank of all that was most, where more was asked for; None where it was not."""
        if self._greatest < LEAST_LIMIT:
            return None
        smaller = [one.usual for one in self._plateaus if one.level < self._greatest - SMALLER]
        top = [one for one in self._plateaus if one.level >= self._greatest - SAME]
        if len(smaller) * TAKE_S >= USUAL_S:
            enough = MORE * max(sum(smaller) / len(smaller), 0.0)
        else:
            enough = MUCH_MORE * max(min((one.usual for one in top), default=math.inf), 0.0)
        most = [one for one in top if one.least > enough]
        several = len({one.number for one in most}) > 1
        if len(most) * TAKE_S < (LEAST_S if several else LONG_S):
            return None
        return sum(one.level for one in most) / len(most)
