"""The console's page when its server goes, comes back or is another one, and on a recorded flight."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from vfguide.commands.console import live_console
from vfguide.lab.console.server import Address, served
from vfguide.lab.console.source import RecordedFlight
from vfguide.lab.rehearsal.live import watched_by_anybody
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.rehearsal.processes import free_port
from vfguide.mission import Mission, load_mission
from vfguide.record.flight import FlightRecord

OpenPage = Callable[..., AbstractAsyncContextManager[Page]]

MISSION = Path(__file__).parents[3] / "missions" / "circle-wind.yaml"

HOSTILE = "<img src=x onerror=alert(1)>"

PATIENCE_MS = 120_000


@pytest.fixture(scope="module")
def record() -> FlightRecord:
    """12 s of a rehearsal, with names that are markup."""
    content = load_mission(MISSION).model_dump(exclude_unset=True)
    content["rehearsal"]["duration_s"] = 12.0
    found = fly_lockstep(Mission.model_validate(content), processes=1).record
    leader, first, *others = found.vehicles
    return replace(found, mission=HOSTILE, vehicles=(leader, replace(first, name=HOSTILE), *others))


@asynccontextmanager
async def nobody(port: int, token: str) -> AsyncIterator[str]:
    """The console of a formation of which nobody is heard."""
    mission = load_mission(MISSION)
    own = free_port(socket.SOCK_DGRAM)
    link = f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?port={own}"
    formation = watched_by_anybody(mission, [link])
    async with live_console(mission, formation, address=Address(port=port), token=token) as url:
        yield url


def test_a_link_on_another_site_opens_the_page_at_the_first_press(
    record: FlightRecord, open_page: OpenPage
) -> None:
    async def look() -> None:
        async with (
            served(RecordedFlight(record), Address(port=0), title="flight") as url,
            open_page("about:blank") as page,
        ):
            mail = f'<a href="{url}">console</a>'
            await page.route(
                "http://mail.example/",
                lambda route: route.fulfill(body=mail, content_type="text/html"),
            )
            await page.goto("http://mail.example/")
            await page.get_by_role("link", name="console").click()
            await expect(page.get_by_role("heading", name="flight")).to_be_visible()

    asyncio.run(look())


def test_a_recorded_flight_plays_and_its_names_stay_text(
    record: FlightRecord, open_page: OpenPage
) -> None:
    async def look() -> None:
        async with (
            served(RecordedFlight(record), Address(port=0), title=record.mission) as url,
            open_page(url) as page,
        ):
            await expect(page.get_by_role("heading", name=HOSTILE)).to_be_visible()
            card = page.get_by_role("article", name=HOSTILE)
            await expect(card).to_be_visible()
            assert await page.locator("img").count() == 0
            slider = page.get_by_label("Time", exact=True)
            before = float(await slider.input_value())
            await page.wait_for_function(
                "before => Number(document.querySelector('[data-part=slider]').value) > before + 1",
                arg=before,
            )
            await expect(page.locator("#freshness")).to_contain_text("recorded flight")

    asyncio.run(look())


def test_a_page_comes_back_to_a_server_that_was_started_again_with_its_token(
    open_page: OpenPage,
) -> None:
    async def look() -> None:
        port = free_port(socket.SOCK_STREAM)
        async with AsyncExitStack() as stack:
            async with nobody(port, "a" * 24) as url:
                page = await stack.enter_async_context(open_page(url))
                status = page.locator("#freshness")
                await expect(status).to_contain_text("live", timeout=PATIENCE_MS)
            await expect(status).to_contain_text("No word from the console", timeout=PATIENCE_MS)
            async with nobody(port, "a" * 24):
                await expect(status).to_contain_text("live", timeout=PATIENCE_MS)
            await expect(status).to_contain_text("No word from the console", timeout=PATIENCE_MS)
            async with nobody(port, "b" * 24):
                await expect(status).to_contain_text("open the address", timeout=PATIENCE_MS)

    asyncio.run(look())
