"""How far an aircraft banks, learned where it stays at one bank although clearly more is asked of it.

A plateau counts where the bank hardly moves for `PLATEAU_S` while every bank that was asked for meanwhile,
and as long before as the aircraft is late, is more, even by the least gain that it may have. Several of
them at the same bank, and never a greater bank, are its limit. What is flown further than that is none.
"""

import math
from collections import deque

import msgspec

PLATEAU_S = 2.0
"""So long the bank hardly moves, s."""

STEADY = math.radians(3.0)
"""From the least to the greatest bank of a plateau, rad."""

MORE = math.radians(4.0)
"""rad by which more is asked for."""

LEAST_BANK = math.radians(10.0)
"""What is less is no limit of any aircraft."""

SAME = math.radians(2.5)
"""Plateaus that differ by less are of one limit; what goes further by more is beyond it, rad."""

APART_S = 3.0
"""Two plateaus have so long between them, s."""

LEAST_S, LEAST_PLATEAUS = 4.0, 2
"""Evidence that it takes: s beyond `PLATEAU_S` of each, and plateaus."""

GAP_S = 1.0
"""After a longer silence nothing is known of the moments before, s."""


class BankMoment(msgspec.Struct, frozen=True, kw_only=True):
    """One report."""

    time_s: float
    """s."""
    bank: float
    """rad, positive right."""
    asked: float
    """Least bank that the setpoint may have asked for, rad, of the same sign as the turn."""


class BankLimit:
    """Learns how far one aircraft banks."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._moments: deque[BankMoment] = deque()
        self._level = 0.0
        self._seconds = 0.0
        self._plateaus = 0
        self._plateau_s = -math.inf

    @property
    def value(self) -> float | None:
        """The limit, rad; None while none is known."""
        known = self._seconds >= LEAST_S and self._plateaus >= LEAST_PLATEAUS
        return self._level if known else None

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
        before = moments[-1].time_s if moments else -math.inf
        if not 0.0 <= now - before <= GAP_S:
            moments.clear()
        moments.append(moment)
        while now - moments[0].time_s > PLATEAU_S + late:
            moments.popleft()
        if now - moments[0].time_s < 0.95 * (PLATEAU_S + late):
            return
        banks = [one.bank for one in moments if now - one.time_s <= PLATEAU_S]
        level = sum(banks) / len(banks)
        if abs(level) > self._level + SAME:
            # It goes further: what was taken for a limit is none.
            self._level, self._seconds, self._plateaus = 0.0, 0.0, 0
        if max(banks) - min(banks) > STEADY or abs(level) < LEAST_BANK:
            return
        side = math.copysign(1.0, level)
        if min(side * one.asked for one in moments) < abs(level) + MORE:
            return
        if self._plateaus and abs(level) < self._level - SAME:
            return
        if now - self._plateau_s > APART_S:
            self._plateaus += 1
        self._plateau_s = now
        period = max(now - before, 0.0)
        self._seconds += period
        self._level += (
            (abs(level) - self._level) * period / self._seconds if self._level else abs(level)
        )
