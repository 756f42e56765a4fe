"""The time table of a mission on a live flight: each order rehearsed, given and answered at its time."""

import asyncio
import logging
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from functools import partial
from random import Random

from vfguide.errors import InputError, VfguideError, described_error
from vfguide.lab.order_desk import (
    CLOCK_LOOK_S,
    OrderDesk,
    at_desk,
    await_formation,
    await_present,
    await_rest,
)
from vfguide.lab.ordering import RehearsedOrder, Tell, conclusion, give_rehearsed, rehearse_order
from vfguide.link.opening import Link, WatchedFormation, check_connected
from vfguide.mission.model import Mission
from vfguide.mission.orders import TimedOrder

logger = logging.getLogger(__name__)

REHEARSED_S = 20.0
"""So long before it is given an order is rehearsed."""

OPENED_S = 40.0
"""So long before an order's time the link is opened for it; what is not heard is waited for as long."""

RETRY_S = 1.0
"""Interval of tries to hear the formation."""


@asynccontextmanager
async def timetable_given(
    mission: Mission, watched: WatchedFormation, *, time_s: Callable[[], float], tell: Tell
) -> AsyncIterator[None]:
    """Give the orders of a mission's time table for as long as the context lasts.

    An order that cannot be carried out, or for which the formation is not heard, is not given; a line says
    why, and the next one has its turn. At the end a line names each order that is left.

    Args:
        mission: of the formation.
        watched: its links, and the operator's key.
        time_s: tells the time of the flight, s.
        tell: takes a line for each thing that happens.
    """
    left = deque(
        (f"orders[{index}], at {timed.at_s:g} s", timed)
        for index, timed in enumerate(mission.orders)
    )
    operator = _Operator(mission, watched, time_s, tell, left)
    task = asyncio.create_task(operator.give_all())
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        for name, _ in left:
            tell(f"{name}: left, the flight has ended")


@dataclass(frozen=True, slots=True)
class _Operator:
    """Who gives the orders of a time table; see there."""

    mission: Mission
    watched: WatchedFormation
    time_s: Callable[[], float]
    tell: Tell
    left: deque[tuple[str, TimedOrder]]
    """Names of the orders that have not come to an end, and the orders."""

    async def give_all(self) -> None:
        """Give one order after the other."""
        while self.left:
            name, timed = self.left[0]
            tell = partial(self._tell_of, name)
            begun = asyncio.Event()
            try:
                await self._give(timed, tell, begun)
            except VfguideError as error:
                known = "given, and its end not heard" if begun.is_set() else "not given"
                tell(f"{known}: {error}")
            except Exception as error:
                # The flight and the orders after this one must not end by it.
                logger.exception("%s: failed", name)
                tell(f"failed, see the log: {described_error(error)}")
            self.left.popleft()

    def _tell_of(self, name: str, text: str) -> None:
        self.tell(f"{name}: {text}")

    async def _give(self, timed: TimedOrder, tell: Tell, begun: asyncio.Event) -> None:
        """Give one order, and try again while the formation is not heard; arguments as of `_try`.

        Raises:
            RefusedOrderError: it cannot be carried out.
            VfguideError: until its time no link stood, or the formation was not heard.
        """
        await self._until(timed.at_s - OPENED_S)
        last_s = self.time_s() + OPENED_S
        while True:
            try:
                return await self._try(timed, tell, begun)
            except InputError:
                raise
            except VfguideError:
                # An order that was given once may be flown: a second one would be another.
                if begun.is_set() or self.time_s() >= last_s:
                    raise
            await asyncio.sleep(RETRY_S)

    async def _try(self, timed: TimedOrder, tell: Tell, begun: asyncio.Event) -> None:
        """Give one order so that it begins at its time, or as soon after it as it can.

        Args:
            timed: the order.
            tell: takes a line for each thing that happens.
            begun: set before the order is said for the first time.
        """
        aborts = timed.action == "abort"
        async with at_desk(self.mission, self.watched, Random()) as (desk, link):
            given_s = timed.at_s - (0.0 if aborts else link.order_lead_s)
            await self._until(given_s - REHEARSED_S)
            found = await self._rehearse(timed, desk, link)
            await self._until(given_s)
            if not aborts:
                await await_rest(desk, link)
                check_connected(link)
                await await_formation(desk, calls_off=False)
                if desk.newest_number != found.formation.number:
                    tell(f"order {desk.newest_number} has been given meanwhile: rehearsing again")
                    found = await self._rehearse(timed, desk, link)
                    await await_rest(desk, link)
            begun.set()
            outcome = await give_rehearsed(self.mission, found, desk, link, tell=tell)
        for line in conclusion(outcome):
            tell(line)

    async def _rehearse(self, timed: TimedOrder, desk: OrderDesk, link: Link) -> RehearsedOrder:
        await await_present(desk, link, calls_off=timed.action == "abort")
        return await rehearse_order(self.mission, timed.order, desk, link)

    async def _until(self, due_s: float) -> None:
        while self.time_s() < due_s:
            await asyncio.sleep(CLOCK_LOOK_S)
