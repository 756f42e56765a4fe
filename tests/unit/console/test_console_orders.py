"""An order from its rehearsal to what became of it, as the console's pages see it."""

import asyncio
from types import SimpleNamespace
from typing import Any
from unittest.mock import AsyncMock

import pytest

from tests.kit.missions import shipped
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import Manoeuvre
from vfguide.formation.orders import Order
from vfguide.lab.console import orders
from vfguide.lab.console.orders import FRESH_S, BusyError, OrderPanel
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.ordering import OrderOutcome, RehearsedOrder
from vfguide.lab.studies.order import Prediction
from vfguide.link.order_codec import Reply, Verdict
from vfguide.mission import Mission
from vfguide.mission.order_plan import formation_of_mission, resolve

VEE = Order(shape="vee", spacing=30.0)


class Air:
    """In the place of rehearsals and aircraft: what they would say, and how long they take."""

    def __init__(self, mission: Mission, patch: pytest.MonkeyPatch) -> None:
        self.mission = mission
        self.now = 0.0
        self.refusal: str | None = None
        self.waits = asyncio.Event()
        self.waits.set()
        self.verdicts = dict.fromkeys(("leader", "f1", "f2", "f3"), Verdict.FLOWN)
        self.given: list[Manoeuvre] = []
        self.desk = OrderDesk(mission, clock=lambda: self.now)
        self.panel = OrderPanel(mission, self.desk, clock=lambda: self.now, changed=lambda: None)
        self.panel.link = SimpleNamespace(connected=True)
        patch.setattr(orders, "await_formation", AsyncMock())
        patch.setattr(orders, "await_order", AsyncMock())
        patch.setattr(orders, "rehearse_order", self.rehearse)
        patch.setattr(orders, "give_rehearsed", self.give)

    async def rehearse(self, _: Mission, order: Order, *__: object) -> RehearsedOrder:
        await self.waits.wait()
        if self.refusal is not None:
            raise VfguideError(self.refusal)
        formation = formation_of_mission(self.mission)
        arrangement, _ = resolve(self.mission, order, formation, number=1, time_s=10.0)
        prediction = Prediction(
            least_m=14.61, pair=("f1", "f3"), least_s=4.5, settled_s=18.2, moved_s=18.2
        )
        return RehearsedOrder(
            order=order,
            formation=formation,
            arrangement=arrangement,
            prediction=None if order.action == "abort" else prediction,
        )

    async def give(
        self, _: Mission, found: RehearsedOrder, desk: OrderDesk, *__: object, **___: object
    ) -> OrderOutcome:
        await self.waits.wait()
        self.given.append(found.arrangement.flown)
        desk.awaited = frozenset(("leader", "f1", "f2", "f3"))
        desk.replies = {
            name: Reply(number=1, verdict=verdict, check=0, text="too fast" * (verdict == 2))
            for name, verdict in self.verdicts.items()
        }
        return OrderOutcome(
            number=1,
            arrangement=found.arrangement,
            prediction=found.prediction,
            replies=desk.replies,
            silent=tuple(sorted(desk.awaited - set(desk.replies))),
        )

    async def settle(self) -> dict[str, Any]:
        """What is shown once nothing goes on any more."""
        for _ in range(10):
            await asyncio.sleep(0)
        return self.panel.describe()


@pytest.fixture
def air(monkeypatch: pytest.MonkeyPatch) -> Air:
    """A leader and three followers."""
    return Air(shipped("shapes"), monkeypatch)


async def test_what_a_rehearsal_has_found_is_shown_before_the_order_can_be_given(air):
    number = air.panel.rehearse(VEE)
    assert air.panel.describe()["phase"] == "rehearsing"
    with pytest.raises(BusyError):
        air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "rehearsed"
    assert shown["what"] == "vee, spacing 30 m"
    assert shown["outcome"] == {
        "pair": ["f1", "f3"],
        "least_m": 14.6,
        "least_s": 4,
        "settled_s": 18,
        "slots": "vee, 30 m apart",
    }
    assert air.given == []
    air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "flown"
    assert shown["answers"][0] == {"vehicle": "f1", "says": "flown", "text": ""}
    assert air.given == [Manoeuvre.FORMATION]
    # Once is enough.
    with pytest.raises(BusyError):
        air.panel.give(number)


async def test_a_refusal_is_shown_with_its_sentence_and_cannot_be_given(air):
    air.refusal = "f1 and f2 would come within 4.0 m of each other"
    number = air.panel.rehearse(VEE)
    shown = await air.settle()
    assert (shown["phase"], shown["text"]) == ("refused", air.refusal)
    with pytest.raises(BusyError):
        air.panel.give(number)


async def test_only_the_rehearsal_that_was_shown_and_not_one_of_long_ago_is_given(air):
    first = air.panel.rehearse(VEE)
    await air.settle()
    second = air.panel.rehearse(Order(shape="trail"))
    await air.settle()
    with pytest.raises(BusyError, match="rehearse it again"):
        air.panel.give(first)
    air.now += FRESH_S + 1.0
    with pytest.raises(BusyError, match="too old"):
        air.panel.give(second)
    assert air.given == []


async def test_there_is_one_order_at_a_time_and_an_abort_waits_for_none(air):
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.waits.clear()
    air.panel.give(number)
    with pytest.raises(BusyError, match="vee, spacing 30 m"):
        air.panel.rehearse(Order(shape="trail"))
    air.panel.abort()
    air.waits.set()
    shown = await air.settle()
    assert (shown["phase"], shown["what"]) == ("flown", "abort")
    assert air.given == [Manoeuvre.ABORT]


async def test_who_says_no_and_who_is_silent_is_shown_of_an_order_that_is_void(air):
    air.verdicts = {"leader": Verdict.VOID, "f1": Verdict.VOID, "f2": Verdict.REFUSED}
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.panel.give(number)
    shown = await air.settle()
    assert shown["phase"] == "void"
    assert [(one["vehicle"], one["says"], one["text"]) for one in shown["answers"]] == [
        ("f1", "void", ""),
        ("f2", "refused", "too fast"),
        ("f3", "silent", ""),
        ("leader", "void", ""),
    ]


async def test_a_fault_of_the_console_itself_ends_no_stream(air):
    air.panel.link = None
    air.panel.rehearse(VEE)
    shown = await air.settle()
    assert (shown["phase"], shown["text"]) == ("refused", "the link is not open yet: try again")


async def test_an_order_that_nobody_wants_is_dropped_while_it_is_rehearsed_and_after(air):
    air.waits.clear()
    number = air.panel.rehearse(VEE)
    await asyncio.sleep(0)
    air.panel.drop(number)
    air.waits.set()
    assert (await air.settle())["phase"] == "none"
    number = air.panel.rehearse(VEE)
    assert (await air.settle())["phase"] == "rehearsed"
    with pytest.raises(BusyError):
        air.panel.drop(number - 1)
    air.panel.drop(number)
    with pytest.raises(BusyError):
        air.panel.give(number)
    assert air.given == []


async def test_a_new_rehearsal_takes_the_place_of_one_that_still_runs(air):
    air.waits.clear()
    air.panel.rehearse(VEE)
    await asyncio.sleep(0)
    number = air.panel.rehearse(Order(shape="trail", spacing=30.0))
    air.waits.set()
    shown = await air.settle()
    assert (shown["number"], shown["what"]) == (number, "trail, spacing 30 m")
    assert shown["phase"] == "rehearsed"


async def test_an_order_that_is_being_given_is_neither_dropped_nor_replaced(air):
    number = air.panel.rehearse(VEE)
    await air.settle()
    air.waits.clear()
    air.panel.give(number)
    with pytest.raises(BusyError):
        air.panel.drop(number)
    with pytest.raises(BusyError):
        air.panel.rehearse(VEE)
    air.waits.set()
    assert (await air.settle())["phase"] == "flown"
