"""The time table of a live flight: each order is rehearsed early and given so that it begins at its time."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from types import SimpleNamespace
from typing import Any

import pytest

from tests.kit.missions import shipped
from tests.kit.states import leader_message
from vfguide.errors import InputError, VfguideError
from vfguide.formation.arrangement import Arrangement
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab import ordering
from vfguide.lab.order_desk import OrderDesk
from vfguide.lab.ordering import rehearse_order, timetable_given
from vfguide.lab.studies.order import Prediction, rehearsed
from vfguide.link.codec import Kind, encode
from vfguide.link.opening import WatchedFormation
from vfguide.link.order_codec import Reply, Verdict, check_of, decode_order, encode_reply
from vfguide.mission.order_plan import formation_of_mission, resolve

WATCHED = WatchedFormation(addresses=(), formation="any", leader="leader", roster=None)
VEHICLES = ("leader", "f1", "f2", "f3")
AHEAD_S = 1000.0
"""The formation's clock shows so much more than the flight's."""


class Flight:
    """Four aircraft in virtual time that fly what they are ordered, on the link of a true desk."""

    order_lead_s = 6.0
    connected = True

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *, rehearsal_s: float = 5.0) -> None:
        self.mission = shipped("shapes")
        self.now = 0.0
        self.rehearsal_s = rehearsal_s
        self.refused: set[int] = set()
        """Rehearsals that find that the order cannot be carried out, counted from 0."""
        self.silent: set[str] = set()
        self.down: Callable[[], bool] = lambda: False
        """Whether no link stands."""
        self.fails_at_close = False
        """Whether the link is lost when it is closed."""
        self.while_rehearsing: Callable[[int], None] = lambda _: None
        self.rehearsals: list[float] = []
        self.given: list[tuple[float, float]] = []
        """When each order was given first, and when it began, on the flight's clock."""
        self.orders: list[Arrangement] = []
        self.flown: Arrangement | None = None
        self.said: list[str] = []
        self._sealed = b""
        self._pause = asyncio.sleep
        monkeypatch.setattr(ordering, "at_desk", self.at_desk)
        monkeypatch.setattr(ordering, "rehearsed", self.rehearse)
        monkeypatch.setattr(asyncio, "sleep", self.sleep)

    @asynccontextmanager
    async def at_desk(self, *_: object) -> AsyncIterator[tuple[OrderDesk, Any]]:
        if self.down():
            raise VfguideError("no link")
        self.desk = OrderDesk(self.mission, clock=lambda: self.now)
        member: Any = SimpleNamespace(
            trust=SimpleNamespace(leader="leader"), formation_time=lambda: self.now + AHEAD_S
        )
        self.desk.member = member
        self.speak()
        yield self.desk, self
        if self.fails_at_close:
            raise VfguideError("the link was lost")

    def speak(self) -> None:
        """Let everybody say where it is."""
        number = 0 if self.flown is None else self.flown.number
        state = leader_message(time_s=self.now + AHEAD_S, term=0, arrangement=number)
        for vehicle in VEHICLES:
            self.desk.heard_state(vehicle, encode(state))

    def say(self, kind: Kind, body: bytes) -> None:
        """Take an order, or a question for the one that is flown."""
        if kind is not Kind.ORDER:
            self.desk.heard_order(self._sealed, b"", repeated=True)
            return
        order = decode_order(body)
        if order.number not in {one.number for one in self.orders}:
            self.orders.append(order)
            self.given.append((round(self.now), round(order.time_s - AHEAD_S)))
        moves = (
            self.flown is not None
            and self.flown.number != order.number
            and order.time_s < self.flown.time_s + self.flown.duration_s
        )
        verdict = Verdict.REFUSED if moves else Verdict.READY
        if not moves and self.now + AHEAD_S >= order.time_s:
            self.flown, self._sealed, verdict = order, body, Verdict.FLOWN
        for name in set(VEHICLES) - self.silent:
            reply = Reply(number=order.number, verdict=verdict, check=check_of(body))
            self.desk.heard_reply(name, encode_reply(reply))

    def order_by_another(self) -> None:
        """Have another operator's order flown, the first of all."""
        present, now = formation_of_mission(self.mission), self.now + AHEAD_S
        self.flown, _ = resolve(self.mission, Order(shape="vee"), present, number=1, time_s=now)
        self._sealed = ordering.encode_order(self.flown)
        self.speak()

    def rehearse(self, *_: object, **__: object) -> Prediction:
        count = len(self.rehearsals)
        self.rehearsals.append(round(self.now))
        self.now += self.rehearsal_s
        self.while_rehearsing(count)
        if count in self.refused:
            raise RefusedOrderError("two would come near")
        return Prediction(least_m=20.0, pair=("f1", "f2"), least_s=1.0, settled_s=9.0, moved_s=9.0)

    async def sleep(self, seconds: float) -> None:
        self.now += seconds
        if hasattr(self, "desk"):
            self.speak()
        await self._pause(0)

    def fly(self, *, until_s: float = 1e4) -> None:
        """To the end of the time table, or of the flight."""

        async def flight() -> None:
            async with timetable_given(
                self.mission, WATCHED, time_s=lambda: self.now, tell=self.said.append
            ):
                task = next(one for one in asyncio.all_tasks() if one is not asyncio.current_task())
                while not task.done() and self.now < until_s:
                    await self._pause(0)

        asyncio.run(flight())


@pytest.fixture
def flight(monkeypatch: pytest.MonkeyPatch) -> Flight:
    """Of the mission `shapes`, orders at 60, 120, ... 360 s."""
    return Flight(monkeypatch)


def test_each_order_is_rehearsed_20_s_before_it_is_given_6_s_before_its_time(flight):
    flight.refused = {2}
    flight.fly()
    # A second goes by until all are heard, and half a second until the order that is flown is known.
    assert flight.rehearsals[:3] == [35, 96, 156]
    # What cannot be flown is passed over in a line, and the next one has its turn.
    times = [60, 120, 240, 300, 360]
    assert flight.given == [(time_s - 6, time_s) for time_s in times]
    assert "orders[2], at 180 s: not given: two would come near" in flight.said
    flown = [line for line in flight.said if line.endswith(": flown")]
    assert [line.partition(",")[0] for line in flown] == [f"orders[{n}]" for n in (0, 1, 3, 4, 5)]
    assert not any("left" in line for line in flight.said)


def test_an_order_is_late_where_its_rehearsal_takes_longer_and_who_does_not_answer_is_named(flight):
    flight.rehearsal_s = 30.0
    flight.silent = {"f2"}
    flight.fly(until_s=115.0)
    assert flight.given[0] == (65, 71)
    number = flight.orders[0].number
    assert "orders[0], at 60 s: f2: does not answer" in flight.said
    assert f"orders[0], at 60 s: order {number}: NOT flown by all" in flight.said


@pytest.mark.parametrize("error", [ValueError("too long"), RuntimeError("anything")])
def test_an_error_that_nobody_has_foreseen_costs_one_order_and_not_the_flight(
    flight, monkeypatch, error
):
    encode_order, failures = ordering.encode_order, [error]

    def encode_but_once(order: Arrangement) -> bytes:
        if failures:
            raise failures.pop()
        return encode_order(order)

    monkeypatch.setattr(ordering, "encode_order", encode_but_once)
    flight.fly()
    assert [begun_s for _, begun_s in flight.given] == [120, 180, 240, 300, 360]
    (line,) = [line for line in flight.said if line.startswith("orders[0], at 60 s: failed")]
    assert line.endswith(f": {error}")


def test_a_link_that_is_gone_for_a_while_costs_no_order_that_it_is_back_for(flight):
    # At the end of the first order, and from before the fourth is opened until after its time.
    flight.down = lambda: 66.0 < flight.now < 100.0 or 190.0 < flight.now < 245.0
    flight.fly()
    assert [begun_s for _, begun_s in flight.given] == [60, 120, 180, 300, 360]
    assert "orders[3], at 240 s: not given: no link" in flight.said


def test_an_order_that_was_given_is_not_given_again_where_the_link_is_lost_after_it(flight):
    flight.fails_at_close = True
    flight.fly(until_s=110.0)
    assert [begun_s for _, begun_s in flight.given] == [60]
    assert "orders[0], at 60 s: given, and its end not heard: the link was lost" in flight.said


def test_after_a_late_order_the_next_one_is_late_too_and_not_refused(flight):
    def take_longer(count: int) -> None:
        flight.now += 60.0 if count == 0 else 0.0

    flight.while_rehearsing = take_longer
    flight.mission = flight.mission.model_copy(update={"orders": flight.mission.orders[:2]})
    flight.fly()
    first, second = flight.orders
    assert first.time_s == pytest.approx(AHEAD_S + 106.0, abs=0.5)
    # Later than at 120 s, and as soon as the slots of the first are at rest.
    assert first.time_s + first.duration_s > AHEAD_S + 120.0
    assert second.time_s == pytest.approx(first.time_s + first.duration_s, abs=0.2)
    assert flight.flown == second


def test_where_another_operator_orders_meanwhile_the_order_is_rehearsed_once_more_and_given(flight):
    def order_otherwise(count: int) -> None:
        if count == 0:
            flight.order_by_another()

    flight.while_rehearsing = order_otherwise
    flight.fly(until_s=80.0)
    # The other order's slots are at rest by then; the second rehearsal takes five seconds.
    assert len(flight.rehearsals) == 2
    assert flight.flown == flight.orders[0]
    assert any("has been given meanwhile: rehearsing again" in line for line in flight.said)


def test_orders_that_are_left_at_the_end_of_the_flight_are_named(flight):
    flight.fly(until_s=250.0)
    assert [line for line in flight.said if "left" in line] == [
        f"orders[{index}], at {at_s} s: left, the flight has ended"
        for index, at_s in ((4, 300), (5, 360))
    ]


async def test_a_cancelled_rehearsal_ends_in_its_thread(monkeypatch):
    mission = shipped("shapes")
    begun, ended = threading.Event(), threading.Event()

    def fly(*_: object, stop: Callable[[], bool], **__: object) -> None:
        begun.set()
        for _ in range(10_000_000):
            if stop():
                ended.set()
                return

    monkeypatch.setattr(ordering, "rehearsed", fly)
    desk = OrderDesk(mission, clock=lambda: 0.0)
    member: Any = SimpleNamespace(formation_time=lambda: 100.0)
    desk.member = member
    link: Any = SimpleNamespace(order_lead_s=6.0)
    task = asyncio.create_task(rehearse_order(mission, Order(shape="trail"), desk, link))
    await asyncio.to_thread(begun.wait, 5.0)
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task
    assert await asyncio.to_thread(ended.wait, 5.0)


def test_a_rehearsal_looks_at_its_stop_flag():
    mission = shipped("shapes")
    present = formation_of_mission(mission)
    order, _ = resolve(mission, Order(shape="trail"), present, number=1, time_s=8.0)
    looks = iter((False, False, True))
    with pytest.raises(VfguideError, match="stopped"):
        rehearsed(mission, present, order, stop=lambda: next(looks))


def test_orders_have_no_time_table_where_time_runs_faster():
    from vfguide.commands.fly_live import check_live

    check_live(shipped("shapes"))
    with pytest.raises(InputError, match="leave --speedup out"):
        check_live(shipped("shapes"), speedup=4.0)
