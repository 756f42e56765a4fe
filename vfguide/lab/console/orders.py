"""Orders from the console's pages: rehearsed, shown, given and answered, one at a time.

All pages see the same order: any operator can give what another has rehearsed. An abort waits for none of
this.
"""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from vfguide.errors import VfguideError
from vfguide.formation.arrangement import slots_in_words
from vfguide.formation.orders import Order
from vfguide.lab.order_desk import OrderDesk, await_formation, await_order
from vfguide.lab.ordering import OrderOutcome, RehearsedOrder, give_rehearsed, rehearse_order
from vfguide.link.opening import Link, check_connected
from vfguide.link.order_codec import Verdict
from vfguide.mission import Mission
from vfguide.mission.model import WrittenOrder

logger = logging.getLogger(__name__)

FRESH_S = 120.0
"""Age from which a rehearsal must be repeated: it predicts from where the formation was."""

Phase = Literal[
    "none", "rehearsing", "rehearsed", "refused", "giving", "flown", "void", "not flown"
]
"""Progress of an order. `refused`: it cannot be carried out; `void`: not all have agreed to it."""

ABORT = Order(action="abort")

REMEDIES = {
    "shape": "This shape is not known: choose one from the list.",
    "spacing_m": "The spacing has to be a number from 1 to 1000 m: correct it and rehearse again.",
    "swap": "Two followers change places: choose both by name.",
    "slots": "A slot has to lie within 10 km of the leader: correct it and rehearse again.",
    "leave": "This names no follower: choose who is to leave from the list.",
    "join": "This names no follower: choose who is to join from the list.",
    "path": "This path has no name of the mission: choose one from the list.",
    "lead": "This names no vehicle that may lead: choose one from the list.",
    "action": "This action is not known: choose hold, resume or ABORT.",
    "number": "This is no rehearsed order: rehearse it again.",
}
"""Remedies of faults, by the faulty field of the order."""

UNREADABLE = "This is no order that the console can read: reload the page and choose it again."


class RehearsalChoice(BaseModel):
    """Number of a rehearsal that a page has shown, to be given or dropped."""

    model_config = ConfigDict(extra="forbid", strict=True)

    number: int = Field(ge=1, le=2**31)


class EmptyRequest(BaseModel):
    """Request of a page without content."""

    model_config = ConfigDict(extra="forbid", strict=True)


class BusyError(VfguideError):
    """An order is being given, or the chosen rehearsal is no longer current."""


class OrderPanel:
    """Order that the console's pages show, from its rehearsal to its outcome."""

    def __init__(
        self,
        mission: Mission,
        desk: OrderDesk,
        *,
        clock: Callable[[], float],
        changed: Callable[[], None],
    ) -> None:
        """Begin without an order; `changed` is called after every change of what pages show."""
        self._mission, self._desk = mission, desk
        deputies = list(mission.deputies)
        self._may_lead = [mission.leader.vehicle, *deputies] if deputies else []
        self._clock, self._changed = clock, changed
        self.link: Link | None = None
        """Link over which orders are given; None until it is opened."""
        self._task: asyncio.Task[None] | None = None
        self._count = 0
        self._forget()

    def _forget(self, phase: Phase = "none", what: str = "") -> None:
        self._phase: Phase = phase
        self._what, self._text = what, ""
        self._found: RehearsedOrder | None = None
        self._found_s = -math.inf
        self._outcome: OrderOutcome | None = None
        # Answers to the order before are none to this one.
        self._desk.awaited, self._desk.replies = frozenset(), {}

    def rehearse(self, order: Order) -> int:
        """Begin to rehearse an order in place of the last, and return the number of the rehearsal.

        Raises:
            BusyError: an order is being given.
        """
        self._check_not_giving()
        self.stop()
        self._count += 1
        self._forget("rehearsing", order_in_words(order))
        self._begin(partial(self._rehearse, order))
        return self._count

    def drop(self, number: int) -> None:
        """Forget an order that has not been given.

        Raises:
            BusyError: the order is not the current one, or is being given.
        """
        self._check_not_giving()
        if number != self._count:
            raise BusyError("another order has been rehearsed meanwhile: look at that one first")
        self.stop()
        self._forget()
        self._changed()

    def give(self, number: int) -> None:
        """Begin to give an order that was rehearsed.

        Raises:
            BusyError: the order is not the current one, not rehearsed yet, too old, or being given.
        """
        self._check_not_giving()
        found = self._found
        if number != self._count or self._phase != "rehearsed" or found is None:
            raise BusyError("this order is not the one that was rehearsed last: rehearse it again")
        if self._clock() - self._found_s > FRESH_S:
            raise BusyError("this rehearsal is too old: rehearse the order again")
        self._phase = "giving"
        self._begin(partial(self._give, found))

    def abort(self) -> int:
        """Call everything off, whatever else is under way, and return the number of the order."""
        self.stop()
        self._count += 1
        self._forget("giving", order_in_words(ABORT))
        self._begin(self._abort)
        return self._count

    def stop(self) -> None:
        """Cancel the work that is under way."""
        if self._task is not None:
            self._task.cancel()
            self._task = None

    def _check_not_giving(self) -> None:
        if self._phase == "giving":
            raise BusyError(f"an order ({self._what}) is being given: wait for the answers")

    def _begin(self, work: Callable[[], Awaitable[None]]) -> None:
        self._task = asyncio.create_task(self._guarded(work), name="order")
        self._changed()

    async def _guarded(self, work: Callable[[], Awaitable[None]]) -> None:
        """Run the work for an order, and show whatever error stops it."""
        try:
            await work()
        except VfguideError as error:
            self._phase, self._text = "refused", str(error)
        except Exception:
            logger.exception("an order could not be given")
            self._phase, self._text = (
                "refused",
                "the console has failed: see its log, and use vfguide order",
            )
        self._changed()

    def _open_link(self) -> Link:
        if self.link is None:
            raise VfguideError("the link is not open yet: try again")
        return self.link

    async def _rehearse(self, order: Order) -> None:
        link = self._open_link()
        check_connected(link)
        await await_formation(self._desk, calls_off=False)
        await await_order(self._desk, link)
        self._found = await rehearse_order(self._mission, order, self._desk, link)
        self._phase, self._found_s = "rehearsed", self._clock()

    async def _give(self, found: RehearsedOrder) -> None:
        link = self._open_link()
        check_connected(link)
        self._conclude(
            await give_rehearsed(self._mission, found, self._desk, link, tell=self._tell)
        )

    async def _abort(self) -> None:
        """Give the abort even without a link, which may return within seconds."""
        link = self._open_link()
        await await_formation(self._desk, calls_off=True)
        found = await rehearse_order(self._mission, ABORT, self._desk, link)
        self._conclude(
            await give_rehearsed(self._mission, found, self._desk, link, tell=self._tell)
        )

    def _tell(self, _: str) -> None:
        self._changed()

    def _conclude(self, outcome: OrderOutcome) -> None:
        self._outcome = outcome
        verdicts = {reply.verdict for reply in outcome.replies.values()}
        if outcome.flown:
            self._phase = "flown"
        elif Verdict.FLOWN not in verdicts:
            self._phase = "void"
        else:
            self._phase = "not flown"
        if outcome.is_led_otherwise:
            self._text = f"{outcome.arrangement.lead} does not lead: {outcome.leads} does"

    def describe(self) -> dict[str, object]:
        """Return what the pages show, ready for JSON."""
        content: dict[str, object] = {
            "number": self._count,
            "phase": self._phase,
            "what": self._what,
            "text": self._text,
            "fresh_s": FRESH_S,
            "paths": list(self._mission.paths_by_name),
            "may_lead": self._may_lead,
        }
        if self._found is not None:
            content |= outcome_of(self._found)
        if self._phase in {"giving", "flown", "void", "not flown"}:
            content["answers"] = self._answers()
        return content

    def _answers(self) -> list[dict[str, str]]:
        desk, silent = self._desk, "silent" if self._outcome is not None else "asked"
        answers = []
        for name in sorted(desk.awaited):
            reply = desk.replies.get(name)
            answers.append(
                {
                    "vehicle": name,
                    "says": silent if reply is None else reply.verdict.name.lower(),
                    "text": "" if reply is None else reply.text,
                }
            )
        return answers


def outcome_of(found: RehearsedOrder) -> dict[str, object]:
    """Return the outcome of a rehearsal, ready for JSON."""
    prediction = found.prediction
    if prediction is None:
        return {}
    first, second = prediction.pair
    return {
        "outcome": {
            "pair": [first, second] if first else [],
            "least_m": round(prediction.least_m, 1) if first else None,
            "least_s": round(prediction.least_s),
            "settled_s": None if prediction.settled_s is None else round(prediction.settled_s),
            "slots": slots_in_words(found.arrangement.places),
        }
    }


def order_in_words(order: Order) -> str:
    """Return an order in the words of `vfguide order`."""
    words: list[str] = []
    if order.action is not None:
        words.append(order.action)
    if order.shape is not None:
        words.append(order.shape)
    if order.spacing is not None:
        words.append(f"spacing {order.spacing:g} m")
    if order.swap is not None:
        words.append(f"swap {' '.join(order.swap)}")
    if order.path is not None:
        words.append(f"path {order.path}")
    if order.lead is not None:
        words.append(f"lead {order.lead}")
    if order.slots:
        words.append(f"slot {' '.join(order.slots)}")
    for name, vehicles in (("leave", order.leave), ("join", order.join)):
        if vehicles:
            words.append(f"{name} {' '.join(vehicles)}")
    return ", ".join(words)


def fault_in_words(error: ValidationError) -> str:
    """Return the fault of an order from a page, in one sentence with the remedy."""
    place = error.errors(include_url=False, include_input=False)[0]["loc"]
    return REMEDIES.get(str(place[0]), UNREADABLE) if place else UNREADABLE


def order_from(text: bytes) -> Order:
    """Parse an order from a page.

    Raises:
        pydantic.ValidationError: the text is no order.
    """
    return WrittenOrder.model_validate_json(text, strict=True).order


def use_number(use: Callable[[int], None], body: bytes) -> int:
    """Apply `use` to the rehearsal number that a page has sent, and return the number.

    Raises:
        pydantic.ValidationError: the body holds no number.
        BusyError: the order is not the current one, or cannot be used now.
    """
    number = RehearsalChoice.model_validate_json(body).number
    use(number)
    return number
