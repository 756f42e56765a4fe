"""The console on live rehearsals: what it shows while aircraft fly, companions die and the broker goes."""

import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TypedDict

import pytest
from playwright.async_api import Locator, Page, expect

from tests.integration.console.conftest import OpenPage
from tests.kit.missions import on_the_circle
from tests.kit.programs import Mosquitto
from vfguide.commands.console import live_console
from vfguide.lab.console.server import ConsoleAddress
from vfguide.lab.rehearsal.live import LiveFlight, live_flight
from vfguide.mission import Mission

OPERATOR = "o" * 24
"""Token of those who give orders."""

POSTED = """path => fetch(path, {
    method: "POST", headers: { "content-type": "application/json" }, body: "{}",
}).then(answer => answer.status)"""


MOVED = """([name, north, east, far]) => {
    const { flight, time } = document.getElementById("replay").player;
    const { state } = flight.formationAt(time).find(({ vehicle }) => vehicle.name === name);
    return Math.hypot(state.north_m - north, state.east_m - east) > far;
}"""

MOVED_M = 20.0
"""Of an aircraft at 20 m/s, within a second or so."""


class Shown(TypedDict):
    """A vehicle as the page shows it."""

    east_m: float
    north_m: float


@pytest.fixture
def mission() -> Mission:
    return on_the_circle()


@asynccontextmanager
async def watched(
    mission: Mission, broker: Mosquitto, directory: Path, *, operators: bool = False
) -> AsyncIterator[tuple[LiveFlight, str]]:
    """A live flight and the address of its console.

    It flies in real time: at twice of it, a starved machine keeps heartbeats back for seconds of the flight.
    """
    token = OPERATOR if operators else None
    async with (
        live_flight(mission, directory=directory, links=[broker.url]) as flight,
        live_console(
            mission, flight.watched, address=ConsoleAddress(port=0), operator_token=token
        ) as url,
    ):
        yield flight, url


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


async def test_aircraft_move_and_a_companion_that_is_killed_turns_its_card(
    mission, mosquitto, open_page, tmp_path
):
    broker = mosquitto()
    async with watched(mission, broker, tmp_path) as (flight, url), open_page(url) as page:
        for name in flight.names:
            await expect(card(page, name).locator(".mode")).to_have_text("tracking")
        assert "token" not in page.url
        north_m, east_m = await place(page, "f1")
        await page.wait_for_function(MOVED, arg=["f1", north_m, east_m, MOVED_M])
        await flight.companions["f2"].kill()
        killed = card(page, "f2")
        await expect(killed).to_have_attribute("data-level", "alarm")
        await expect(killed.locator(".mode")).to_have_text("offline")
        await expect(page.get_by_role("alert")).to_contain_text("f2 has lost its companion")
        assert await card(page, "f1").get_attribute("data-level") == "good"
        await flight.companions["f2"].start()
        await expect(killed).to_have_attribute("data-level", "good")


async def in_view(page: Page, place: Locator) -> bool:
    """Whether something can be seen and pressed without scrolling, wherever the page is."""
    for top in ("0", "document.body.scrollHeight"):
        await page.evaluate(f"scrollTo(0, {top})")
        box, size = await place.bounding_box(), page.viewport_size
        assert box is not None
        assert size is not None
        if not (box["y"] >= 0.0 and box["y"] + box["height"] <= size["height"]):
            return False
        if not (box["x"] >= 0.0 and box["x"] + box["width"] <= size["width"]):
            return False
    return True


async def looks_on(url: str, open_page: OpenPage) -> None:
    """See that who has found the address of those who look gives no orders."""
    async with open_page(url) as page:
        await expect(page.locator("#freshness")).to_contain_text("live")
        await expect(page.get_by_role("button", name="ABORT")).to_have_count(0)
        await expect(page.get_by_role("button", name="Rehearse")).to_have_count(0)
        assert await page.evaluate(POSTED, "/order/abort") == 403


async def order_trail(page: Page) -> None:
    """Have another shape rehearsed, then given, then flown."""
    outcome = page.locator("#outcome")
    give = page.get_by_role("button", name="Give this order")
    await expect(give).to_be_disabled()
    await page.get_by_label("Order", exact=True).select_option("trail")
    await page.get_by_label("Spacing in metres").fill("4")
    await page.get_by_role("button", name="Rehearse").tap()
    await expect(outcome).to_contain_text("less than 7.5 m")
    await expect(give).to_be_disabled()
    await page.get_by_label("Spacing in metres").fill("25")
    await page.get_by_role("button", name="Rehearse").tap()
    await expect(outcome).to_contain_text("rehearsed: nearest")
    await expect(give).to_be_enabled()
    # Another order than the rehearsed one is not given by mistake.
    await page.get_by_label("Spacing in metres").fill("20")
    await expect(give).to_be_disabled()
    await page.get_by_label("Spacing in metres").fill("25")
    await give.tap()
    orders = page.get_by_role("region", name="Orders")
    await expect(orders).to_contain_text("flown by all")
    await expect(orders).to_contain_text("f1: flies it")
    await expect(page.locator("#flies")).to_contain_text("trail, 25 m apart")
    # Slots are where the order has them, and the aircraft come there.
    await expect(card(page, "f3").locator(".off dd")).to_have_text(re.compile(r"^[01]\.\d m$"))


async def test_on_a_phone_an_order_is_rehearsed_given_and_flown_and_all_called_off_after_a_broker_s_death(
    mission, mosquitto, open_page, tmp_path
):
    broker = mosquitto()
    async with (
        watched(mission, broker, tmp_path, operators=True) as (_, url),
        open_page(f"{url.partition('?')[0]}?token={OPERATOR}", phone=True, dark=True) as page,
    ):
        leader, alarms = card(page, "leader"), page.get_by_role("alert")
        await expect(leader.locator(".mode")).to_have_text("tracking")
        abort = page.get_by_role("button", name="ABORT")
        assert await overflow(page) <= 0
        assert await in_view(page, abort)
        await looks_on(url, open_page)
        broker.kill()
        await expect(alarms).to_contain_text("No connection")
        await expect(alarms).to_contain_text("No aircraft has been heard")
        await expect(leader).to_have_attribute("data-level", "alarm")
        assert await overflow(page) <= 0
        stood = await place(page, "leader")
        broker.start()
        await expect(alarms).not_to_contain_text("No connection")
        await expect(leader).to_have_attribute("data-level", "good")
        assert await place(page, "leader") != stood
        # Back in the flight, where words of now are left out, and to now again.
        await page.evaluate("document.getElementById('replay').player.seek(1)")
        await expect(page.locator("#freshness")).to_contain_text("ago")
        await page.get_by_role("button", name="Back to now").tap()
        await expect(page.locator("#freshness")).to_contain_text("live")
        await order_trail(page)
        assert await overflow(page) <= 0
        assert await in_view(page, abort)
        await abort.tap()
        await expect(page.locator("#outcome")).to_contain_text("back at their autopilots")
        answers = page.get_by_role("list", name="Answers")
        await expect(answers).to_contain_text("f1: handed back")
        await expect(page.locator("#flies")).to_contain_text("all was called off")
        await expect(card(page, "f1").locator(".mode")).not_to_have_text("tracking")
