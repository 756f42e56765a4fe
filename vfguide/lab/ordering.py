"""Rehearse an order, give it and collect the answers, for `vfguide order` and the console.

`timetable_given` does so for each order of a mission's time table during a live flight.
"""

import asyncio
import logging
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from random import Random, SystemRandom

from vfguide.errors import InputError, VfguideError, described_error
from vfguide.formation.arrangement import Arrangement, Manoeuvre
from vfguide.formation.orders import Formation, Order, new_number
from vfguide.lab.order_desk import (
    CLOCK_LOOK_S,
    REPEAT_S,
    OrderDesk,
    at_desk,
    await_formation,
    await_present,
    await_rest,
)
from vfguide.lab.studies.order import Prediction, rehearsed
from vfguide.link.codec import Kind
from vfguide.link.opening import Link, WatchedFormation, check_connected
from vfguide.link.order_codec import Reply, Verdict, check_of, encode_order
from vfguide.mission.model import Mission, TimedOrder
from vfguide.mission.order_plan import formation_of_mission, resolve

LAST_S = 6.0
"""Time for which answers are awaited after an order's start, s."""

DECIDED = frozenset({Verdict.REFUSED, Verdict.FLOWN, Verdict.VOID})


@dataclass(frozen=True, slots=True, kw_only=True)
class RehearsedOrder:
    """Rehearsed order with the formation and arrangement of its rehearsal, ready to be given."""

    order: Order
    formation: Formation
    arrangement: Arrangement
    prediction: Prediction | None
    """Result of the rehearsal; None for an abort, which is not rehearsed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderOutcome:
    """Outcome of an order."""

    number: int
    """Number of the order; 0 if it was not given."""
    arrangement: Arrangement
    prediction: Prediction | None
    """Result of the rehearsal; None for an abort, which is not rehearsed."""
    replies: dict[str, Reply] = field(default_factory=dict)
    """Newest answer of each vehicle."""
    silent: tuple[str, ...] = ()
    leads: str = ""
    """Name of the vehicle that leads afterwards, as heard."""

    @property
    def flown(self) -> bool:
        """Whether all vehicles have answered that they fly the order, and the ordered leader leads."""
        verdicts = {reply.verdict for reply in self.replies.values()}
        return verdicts == {Verdict.FLOWN} and not (self.silent or self.is_led_otherwise)

    @property
    def is_led_otherwise(self) -> bool:
        """Whether all answers say that the order is flown, but another than the ordered leader leads."""
        verdicts = {reply.verdict for reply in self.replies.values()}
        return verdicts == {Verdict.FLOWN} and self.arrangement.lead not in {"", self.leads}


Tell = Callable[[str], None]
"""Receiver of a line of text for people."""


async def give_order(
    mission: Mission,
    order: Order,
    watched: WatchedFormation,
    *,
    tell: Tell,
    dry_run: bool = False,
    random: Random | None = None,
) -> OrderOutcome:
    """Rehearse an order from the present formation, give it unless `dry_run`, and wait for its outcome.

    `tell` gets a line for each event. `random` keeps clients of a lost broker from reconnecting in step.

    Raises:
        RefusedOrderError: the order cannot be carried out; one sentence says why.
        VfguideError: no link stands, the formation is not heard, or the private key is missing.
    """
    if watched.roster is not None and watched.key is None:
        raise InputError(
            "an order is signed by an operator: give a private key with --key, or make keys with"
            " `vfguide keys make MISSION`"
        )
    async with at_desk(mission, watched, random or Random()) as (desk, link):
        await await_present(desk, link, calls_off=order.action == "abort")
        found = await rehearse_order(mission, order, desk, link)
        if found.prediction is not None:
            tell(predicted(found.prediction))
        if dry_run:
            return OrderOutcome(
                number=0, arrangement=found.arrangement, prediction=found.prediction
            )
        return await give_rehearsed(mission, found, desk, link, tell=tell)


async def rehearse_order(
    mission: Mission, order: Order, desk: OrderDesk, link: Link
) -> RehearsedOrder:
    """Fly an order in virtual time from the present formation; an abort is not flown.

    The rehearsal runs in a thread, which ends soon after cancellation.

    Raises:
        RefusedOrderError: the order cannot be carried out; one sentence says why.
        VfguideError: the order that is flown now is not known.
    """
    # An abort does not need the present formation.
    aborts = order.action == "abort"
    formation = formation_of_mission(mission) if aborts else desk.formation()
    arrangement = _resolved(
        mission, order, desk, formation, number=formation.number + 1, lead_s=link.order_lead_s
    )
    prediction = None
    if arrangement.flown is not Manoeuvre.ABORT:
        stopped = threading.Event()
        try:
            prediction = await asyncio.to_thread(
                rehearsed,
                mission,
                formation,
                arrangement,
                leader=desk.leader_place(desk.time_s),
                joining=desk.places(),
                stop=stopped.is_set,
            )
        finally:
            stopped.set()
    return RehearsedOrder(
        order=order, formation=formation, arrangement=arrangement, prediction=prediction
    )


async def give_rehearsed(
    mission: Mission, found: RehearsedOrder, desk: OrderDesk, link: Link, *, tell: Tell
) -> OrderOutcome:
    """Give a rehearsed order, and wait for its outcome.

    Raises:
        RefusedOrderError: the order cannot be carried out any more; one sentence says why.
        VfguideError: another order has been given since the rehearsal.
    """
    aborts = found.arrangement.flown is Manoeuvre.ABORT
    if not aborts and desk.newest_number != found.formation.number:
        raise VfguideError(
            f"order {desk.newest_number} has been given since this one was rehearsed: rehearse it again"
        )
    number = new_number(desk.newest_number, time.time(), SystemRandom())
    # Resolved again, since the leader has flown on.
    arrangement = _resolved(
        mission, found.order, desk, found.formation, number=number, lead_s=link.order_lead_s
    )
    tell(f"order {number}: given, to begin in {link.order_lead_s:g} s")
    await _give(desk, link, arrangement, found.formation, tell)
    return OrderOutcome(
        number=number,
        arrangement=arrangement,
        prediction=found.prediction,
        replies=dict(desk.replies),
        silent=tuple(sorted(desk.awaited - set(desk.replies))),
        leads=desk.leads,
    )


def predicted(prediction: Prediction) -> str:
    """Describe the result of a rehearsal in one line."""
    first, second = prediction.pair
    settled = prediction.settled_s
    rest = (
        "not all within 1 m in time" if settled is None else f"all within 1 m after {settled:.0f} s"
    )
    if not first:
        return f"rehearsed: {rest}"
    return (
        f"rehearsed: nearest {first} and {second}, {prediction.least_m:.1f} m,"
        f" {prediction.least_s:.0f} s after it begins; {rest}"
    )


def _resolved(
    mission: Mission,
    order: Order,
    desk: OrderDesk,
    formation: Formation,
    *,
    number: int,
    lead_s: float,
) -> Arrangement:
    """Resolve an order that begins `lead_s` seconds from now."""
    time_s = desk.time_s + lead_s
    found, _ = resolve(
        mission, order, formation, number=number, time_s=time_s, leader=desk.leader_place(time_s)
    )
    return found


async def _give(
    desk: OrderDesk, link: Link, order: Arrangement, formation: Formation, tell: Tell
) -> None:
    """Repeat an order until every vehicle has decided on it or the time is over, and report the answers."""
    data = encode_order(order)
    desk.awaited = frozenset(desk.awaited_from(formation, order))
    desk.given, desk.replies = (order.number, check_of(data)), {}
    desk.note_order(order)
    told: dict[str, Reply] = {}
    last_s = order.time_s + LAST_S
    while desk.time_s < last_s:
        link.say(Kind.ORDER, data)
        await asyncio.sleep(REPEAT_S)
        for vehicle, reply in sorted(desk.replies.items()):
            if told.get(vehicle) != reply:
                told[vehicle] = reply
                tell(reply_line(vehicle, reply))
        verdicts = {vehicle: reply.verdict for vehicle, reply in desk.replies.items()}
        decided = all(verdicts.get(vehicle) in DECIDED for vehicle in desk.awaited)
        hands_over = set(verdicts.values()) == {Verdict.FLOWN} and order.lead not in {
            "",
            desk.leads,
        }
        if decided and not hands_over:
            return


def reply_line(vehicle: str, reply: Reply) -> str:
    """Describe a vehicle's answer in one line."""
    words = {
        Verdict.READY: "yes",
        Verdict.REFUSED: "no",
        Verdict.FLOWN: "flies it",
        Verdict.VOID: "void",
    }[reply.verdict]
    return f"{vehicle}: {words}{f', {reply.text}' if reply.text else ''}"


def conclusion(outcome: OrderOutcome) -> list[str]:
    """Describe an outcome in lines: silent vehicles, an unexpected leader, and whether the order is flown."""
    lines = [f"{vehicle}: does not answer" for vehicle in outcome.silent]
    if outcome.is_led_otherwise:
        lines.append(f"{outcome.arrangement.lead}: does not lead; {outcome.leads} leads")
    lines.append(f"order {outcome.number}: {'flown' if outcome.flown else 'NOT flown by all'}")
    return lines


logger = logging.getLogger(__name__)

REHEARSED_S = 20.0
"""Time of the rehearsal before the order is given, s."""

OPENED_S = 40.0
"""Time before an order's start at which its link is opened, s; a silent formation is awaited as long."""

RETRY_S = 1.0
"""Interval of tries to hear the formation, s."""


@asynccontextmanager
async def timetable_given(
    mission: Mission, watched: WatchedFormation, *, time_s: Callable[[], float], tell: Tell
) -> AsyncIterator[None]:
    """Give the orders of a mission's time table, by the flight's time, for as long as the context lasts.

    An order is not given if it cannot be carried out or the formation is not heard. `tell` gets a line that
    says why, and the next order follows. At the end it gets a line for each order that is left.
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
    """Operator that gives the orders of a time table."""

    mission: Mission
    watched: WatchedFormation
    time_s: Callable[[], float]
    tell: Tell
    left: deque[tuple[str, TimedOrder]]
    """(name, order) of the orders that have not been completed."""

    async def give_all(self) -> None:
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
                # A failure must not end the flight or stop later orders.
                logger.exception("%s: failed", name)
                tell(f"failed, see the log: {described_error(error)}")
            self.left.popleft()

    def _tell_of(self, name: str, text: str) -> None:
        self.tell(f"{name}: {text}")

    async def _give(self, timed: TimedOrder, tell: Tell, begun: asyncio.Event) -> None:
        """Give one order, with retries while the formation is not heard; for the arguments see `_try`.

        Raises:
            RefusedOrderError: the order cannot be carried out.
            VfguideError: no link stood, or the formation was not heard, until the order's time.
        """
        await self._until(timed.at_s - OPENED_S)
        last_s = self.time_s() + OPENED_S
        while True:
            try:
                return await self._try(timed, tell, begun)
            except InputError:
                raise
            except VfguideError:
                # No retry once the order was sent: it may be flown, and a retry would be a new order.
                if begun.is_set() or self.time_s() >= last_s:
                    raise
            await asyncio.sleep(RETRY_S)

    async def _try(self, timed: TimedOrder, tell: Tell, begun: asyncio.Event) -> None:
        """Give one order to begin at its time, or soon after; set `begun` before it is sent first."""
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
