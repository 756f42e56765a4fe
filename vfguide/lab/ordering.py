"""An order, from its rehearsal to what becomes of it: what `vfguide order` and the console do.

The time table of a mission on a live flight: each order rehearsed, given and answered at its time.
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
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    check_of,
    encode_order,
)
from vfguide.mission.model import Mission, TimedOrder
from vfguide.mission.order_plan import formation_of_mission, resolve

LAST_S = 6.0
"""After an order's time answers are awaited for so long."""

DECIDED = frozenset({Verdict.REFUSED, Verdict.FLOWN, Verdict.VOID})


@dataclass(frozen=True, slots=True, kw_only=True)
class RehearsedOrder:
    """An order that was rehearsed, and can be given."""

    order: Order
    """What is wanted."""
    formation: Formation
    """The formation from which it was rehearsed."""
    arrangement: Arrangement
    """What it came to then."""
    prediction: Prediction | None
    """What the rehearsal says; None of an order to call everything off, for which none is awaited."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OrderOutcome:
    """What became of an order."""

    number: int
    """Number of the order; 0 if it was not given."""
    arrangement: Arrangement
    """What was ordered."""
    prediction: Prediction | None
    """What its rehearsal showed; None for an order to call everything off, which is not rehearsed."""
    replies: dict[str, Reply] = field(default_factory=dict)
    """The newest answer of each vehicle."""
    silent: tuple[str, ...] = ()
    """Vehicles that have not answered."""
    leads: str = ""
    """Name of the vehicle that leads afterwards, as far as is heard."""

    @property
    def flown(self) -> bool:
        """Whether it is flown by all who have answered, all have, and the one leads that is to lead by it."""
        verdicts = {reply.verdict for reply in self.replies.values()}
        return verdicts == {Verdict.FLOWN} and not (self.silent or self.is_led_otherwise)

    @property
    def is_led_otherwise(self) -> bool:
        """Whether all who have answered fly it, and another leads than the one that was ordered to."""
        verdicts = {reply.verdict for reply in self.replies.values()}
        return verdicts == {Verdict.FLOWN} and self.arrangement.lead not in {"", self.leads}


Tell = Callable[[str], None]
"""Takes a line for people."""


async def give_order(
    mission: Mission,
    order: Order,
    watched: WatchedFormation,
    *,
    tell: Tell,
    dry_run: bool = False,
    random: Random | None = None,
) -> OrderOutcome:
    """Rehearse an order from the formation as it is, give it, and wait for what becomes of it.

    Args:
        mission: of the formation.
        order: what is wanted.
        watched: its links, and the operator's key.
        tell: takes a line for each thing that happens.
        dry_run: whether to rehearse it only.
        random: keeps those who lost the same broker from coming back in step.

    Raises:
        RefusedOrderError: it cannot be carried out; one sentence says why.
        VfguideError: no link stands, or the formation is not heard.
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
    """Fly an order in virtual time from the formation as it is; an order to abort is not flown.

    It is flown in a thread, which ends soon after the rehearsal is cancelled.

    Raises:
        RefusedOrderError: it cannot be carried out; one sentence says why.
        VfguideError: the order that is flown is not known.
    """
    # To call everything off the formation need not be known.
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
    """Give an order that was rehearsed, and wait for what becomes of it.

    Raises:
        RefusedOrderError: it cannot be carried out any more; one sentence says why.
        VfguideError: another order has been given since.
    """
    aborts = found.arrangement.flown is Manoeuvre.ABORT
    if not aborts and desk.newest_number != found.formation.number:
        raise VfguideError(
            f"order {desk.newest_number} has been given since this one was rehearsed: rehearse it again"
        )
    number = new_number(desk.newest_number, time.time(), SystemRandom())
    # The leader has flown on since.
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
    """A rehearsal in one line."""
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
    """The arrangement of an order that begins so many seconds from now."""
    time_s = desk.time_s + lead_s
    found, _ = resolve(
        mission,
        order,
        formation,
        number=number,
        time_s=time_s,
        leader=desk.leader_place(time_s),
    )
    return found


async def _give(
    desk: OrderDesk, link: Link, order: Arrangement, formation: Formation, tell: Tell
) -> None:
    """Give an order again and again until all have said what becomes of it, and tell what they say."""
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
    """A vehicle's answer in one line."""
    words = {
        Verdict.READY: "yes",
        Verdict.REFUSED: "no",
        Verdict.FLOWN: "flies it",
        Verdict.VOID: "void",
    }[reply.verdict]
    return f"{vehicle}: {words}{f', {reply.text}' if reply.text else ''}"


def conclusion(outcome: OrderOutcome) -> list[str]:
    """What became of an order, in lines: who is silent, who leads instead, and whether it is flown."""
    lines = [f"{vehicle}: does not answer" for vehicle in outcome.silent]
    if outcome.is_led_otherwise:
        lines.append(f"{outcome.arrangement.lead}: does not lead; {outcome.leads} leads")
    lines.append(f"order {outcome.number}: {'flown' if outcome.flown else 'NOT flown by all'}")
    return lines


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
