"""The time table of a live flight: each order is rehearsed early and given so that it begins at its time."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from vfguide.errors import InputError
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab import live_timetable
from vfguide.lab.live_timetable import timetable_given
from vfguide.link.watch import WatchedFormation
from vfguide.mission import Mission, load_mission

MISSIONS = Path(__file__).parents[3] / "missions"
WATCHED = WatchedFormation(addresses=(), formation="any", leader="leader", roster=None)


class Operator:
    """Gives orders in no time but the clock's; what cannot be flown is refused."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, *, rehearsal_s: float, refused: str
    ) -> None:
        self.now = 0.0
        self.rehearsal_s = rehearsal_s
        self.refused = refused
        self.rehearsed: list[tuple[float, str | None]] = []
        self.given: list[tuple[float, str | None]] = []
        self.said: list[str] = []
        for name in ("at_desk", "await_formation", "await_order", "rehearse_order"):
            monkeypatch.setattr(live_timetable, name, getattr(self, name))
        monkeypatch.setattr(live_timetable, "give_rehearsed", self.give_rehearsed)
        monkeypatch.setattr(live_timetable.asyncio, "sleep", self.sleep)

    @asynccontextmanager
    async def at_desk(self, *_: object) -> AsyncIterator[tuple[Any, Any]]:
        yield None, SimpleNamespace(order_lead_s=6.0)

    async def await_formation(self, _: object, *, calls_off: bool) -> None:
        del calls_off

    async def await_order(self, *_: object) -> None:
        pass

    async def rehearse_order(self, _: object, order: Order, *__: object) -> Order:
        self.rehearsed.append((round(self.now), order.shape))
        self.now += self.rehearsal_s
        if order.shape == self.refused:
            raise RefusedOrderError("two would come near")
        return order

    async def give_rehearsed(self, _: object, found: Order, *__: object, **___: object) -> Any:  # noqa: ANN401
        self.given.append((round(self.now), found.shape))
        return SimpleNamespace(flown=True)

    async def sleep(self, seconds: float) -> None:
        self.now += seconds

    def fly(self, mission: Mission) -> None:
        """To the end of the time table."""

        async def flight() -> None:
            async with timetable_given(
                mission, WATCHED, time_s=lambda: self.now, tell=self.said.append
            ):
                await next(one for one in asyncio.all_tasks() if one is not asyncio.current_task())

        asyncio.run(flight())


def test_each_order_is_rehearsed_20_s_before_it_is_given_6_s_before_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    operator = Operator(monkeypatch, rehearsal_s=5.0, refused="trail")
    operator.fly(load_mission(MISSIONS / "shapes.yaml"))
    assert operator.rehearsed[:3] == [(34, "line-abreast"), (94, "echelon-left"), (154, "trail")]
    # What cannot be flown is passed over in a line, and the next one has its turn.
    times = [(54, "line-abreast"), (114, "echelon-left"), (234, "diamond"), (294, "echelon-right")]
    assert operator.given == [*times, (354, "vee")]
    assert "orders[2], at 180 s: not given: two would come near" in operator.said


def test_an_order_is_late_where_its_rehearsal_takes_longer(monkeypatch: pytest.MonkeyPatch) -> None:
    operator = Operator(monkeypatch, rehearsal_s=30.0, refused="")
    operator.fly(load_mission(MISSIONS / "shapes.yaml"))
    assert operator.given[0] == (64, "line-abreast")


def test_orders_have_no_time_table_where_time_runs_faster() -> None:
    from vfguide.commands.fly_live import check_live

    check_live(load_mission(MISSIONS / "shapes.yaml"))
    with pytest.raises(InputError, match="leave --speedup out"):
        check_live(load_mission(MISSIONS / "shapes.yaml"), speedup=4.0)
