"""The time table of a mission on a live flight: each order rehearsed, given and answered at its time."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from random import Random

from vfguide.errors import VfguideError
from vfguide.lab.ordering import (
    OrderDesk,
    Tell,
    at_desk,
    await_formation,
    await_order,
    give_rehearsed,
    rehearse_order,
)
from vfguide.link.opening import Link
from vfguide.link.watch import WatchedFormation
from vfguide.mission.model import Mission
from vfguide.mission.orders import TimedOrder

REHEARSED_S = 20.0
"""So long before it is given an order is rehearsed."""

LOOK_S = 0.1
"""Between two looks at the clock."""


@asynccontextmanager
async def timetable_given(
    mission: Mission, watched: WatchedFormation, *, time_s: Callable[[], float], tell: Tell
) -> AsyncIterator[None]:
    """Give the orders of a mission's time table for as long as the context lasts.

    An order that cannot be carried out, or for which the formation is not heard, is not given; a line says
    why, and the next one has its turn.

    Args:
        mission: of the formation.
        watched: its links, and the operator's key.
        time_s: tells the time of the flight, s.
        tell: takes a line for each thing that happens.
    """
    operator = _Operator(mission, watched, time_s, tell)
    task = asyncio.create_task(operator.give_all())
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


@dataclass(frozen=True, slots=True)
class _Operator:
    """Who gives the orders of a time table; see there."""

    mission: Mission
    watched: WatchedFormation
    time_s: Callable[[], float]
    tell: Tell

    async def give_all(self) -> None:
        """Give one order after the other."""
        for index, timed in enumerate(self.mission.orders):
            name = f"orders[{index}], at {timed.at_s:g} s"
            try:
                async with at_desk(self.mission, self.watched, Random()) as (desk, link):
                    await self._give(timed, desk, link, partial(self._tell_of, name))
            except VfguideError as error:
                self._tell_of(name, f"not given: {error}")

    def _tell_of(self, name: str, text: str) -> None:
        self.tell(f"{name}: {text}")

    async def _give(self, timed: TimedOrder, desk: OrderDesk, link: Link, tell: Tell) -> None:
        """Give one order so that it begins at its time, or as soon after it as it can."""
        aborts = timed.action == "abort"
        given_s = timed.at_s - (0.0 if aborts else link.order_lead_s)
        await self._until(given_s - REHEARSED_S)
        await await_formation(desk, calls_off=aborts)
        await await_order(desk, link)
        found = await rehearse_order(self.mission, timed.order, desk, link)
        await self._until(given_s)
        outcome = await give_rehearsed(self.mission, found, desk, link, tell=tell)
        tell("flown" if outcome.flown else "NOT flown by all")

    async def _until(self, due_s: float) -> None:
        while self.time_s() < due_s:
            await asyncio.sleep(LOOK_S)
