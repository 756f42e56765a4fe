"""The console on live rehearsals: what it shows while aircraft fly, companions die and the broker goes."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import TypedDict

import pytest
from playwright.async_api import Locator, Page, expect

from tests.integration.live.conftest import Broker
from vfguide.commands.console import live_console
from vfguide.lab.console.server import Address
from vfguide.lab.rehearsal.live import LiveFlight, live_flight
from vfguide.mission import Mission, load_mission

OpenPage = Callable[..., AbstractAsyncContextManager[Page]]

MISSION = Path(__file__).parents[3] / "missions" / "circle-wind.yaml"

PATIENCE_MS = 120_000

SPEEDUP = 2.0


class Shown(TypedDict):
    """A vehicle as the page shows it."""

    east_m: float
    north_m: float


@pytest.fixture
def mission() -> Mission:
    """The article's circle in wind, with everyone in place at the beginning."""
    content = load_mission(MISSION).model_dump(exclude_unset=True)
    followers = [follower["vehicle"] for follower in content["followers"]]
    leader = {"north_m": 0.0, "east_m": 0.0, "course_deg": 270.0}
    content["rehearsal"]["start"] = {"leader": leader, **{name: {} for name in followers}}
    return Mission.model_validate(content)


@asynccontextmanager
async def watched(
    mission: Mission, broker: Broker, directory: Path
) -> AsyncIterator[tuple[LiveFlight, str]]:
    """A live flight and the address of its console."""
    async with (
        live_flight(mission, directory=directory, links=[broker.url], speedup=SPEEDUP) as flight,
        live_console(mission, flight.watched, address=Address(port=0)) as url,
    ):
        yield flight, url


@asynccontextmanager
async def running(program: str, directory: Path) -> AsyncIterator[Broker]:
    """A broker."""
    broker = Broker(program, directory)
    await broker.start()
    try:
        yield broker
    finally:
        await broker.kill()


def card(page: Page, name: str) -> Locator:
    return page.get_by_role("article", name=name, exact=True)


async def place(page: Page, name: str) -> tuple[float, float]:
    """(north, east) of an aircraft in the picture, m."""
    shown: Shown = await page.evaluate(
        """name => {
            const { flight, time } = document.getElementById("replay").player;
            return flight.formationAt(time).find(({ vehicle }) => vehicle.name === name).state;
        }""",
        name,
    )
    return shown["north_m"], shown["east_m"]


async def overflow(page: Page) -> int:
    """Pixels by which the page is wider than the screen."""
    width: int = await page.evaluate("document.documentElement.scrollWidth - innerWidth")
    return width


def test_aircraft_move_and_a_companion_that_is_killed_turns_its_card(
    mission: Mission, mosquitto_program: str, open_page: OpenPage, tmp_path: Path
) -> None:
    async def fly() -> None:
        async with (
            running(mosquitto_program, tmp_path) as broker,
            watched(mission, broker, tmp_path) as (flight, url),
            open_page(url) as page,
        ):
            for name in flight.names:
                await expect(card(page, name).locator(".mode")).to_have_text(
                    "tracking", timeout=PATIENCE_MS
                )
            assert "token" not in page.url
            before = await place(page, "f1")
            await page.wait_for_timeout(1000)
            after = await place(page, "f1")
            moved = abs(complex(*after) - complex(*before))
            # About 40 m: 20 m/s at twice the real time, in a second of a busy machine.
            assert 10.0 < moved < 200.0
            await flight.companions["f2"].kill()
            killed = card(page, "f2")
            await expect(killed).to_have_attribute("data-level", "alarm", timeout=PATIENCE_MS)
            await expect(killed.locator(".mode")).to_have_text("offline", timeout=PATIENCE_MS)
            await expect(page.get_by_role("alert")).to_contain_text("f2 has lost its companion")
            assert await card(page, "f1").get_attribute("data-level") == "good"
            await flight.companions["f2"].start()
            await expect(killed).to_have_attribute("data-level", "good", timeout=PATIENCE_MS)

    asyncio.run(fly())


def test_on_a_phone_it_is_usable_and_outlives_the_broker_and_looks_back(
    mission: Mission, mosquitto_program: str, open_page: OpenPage, tmp_path: Path
) -> None:
    async def fly() -> None:
        async with (
            running(mosquitto_program, tmp_path) as broker,
            watched(mission, broker, tmp_path) as (_, url),
            open_page(url, phone=True, dark=True) as page,
        ):
            leader, alarms = card(page, "leader"), page.get_by_role("alert")
            await expect(leader.locator(".mode")).to_have_text("tracking", timeout=PATIENCE_MS)
            assert await overflow(page) <= 0
            await broker.kill()
            await expect(alarms).to_contain_text("No connection", timeout=PATIENCE_MS)
            await expect(alarms).to_contain_text("No aircraft has been heard", timeout=PATIENCE_MS)
            await expect(leader).to_have_attribute("data-level", "alarm")
            assert await overflow(page) <= 0
            stood = await place(page, "leader")
            await broker.start()
            await expect(alarms).not_to_contain_text("No connection", timeout=PATIENCE_MS)
            await expect(leader).to_have_attribute("data-level", "good", timeout=PATIENCE_MS)
            assert await place(page, "leader") != stood
            # Back in the flight, where words of now are left out, and to now again.
            await page.evaluate("document.getElementById('replay').player.seek(1)")
            await expect(page.locator("#freshness")).to_contain_text("ago")
            await page.get_by_role("button", name="Back to now").tap()
            await expect(page.locator("#freshness")).to_contain_text("live")

    asyncio.run(fly())
