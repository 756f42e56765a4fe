"""The console's page when its server goes, comes back or is another one, and on a recorded flight."""

import asyncio
import json
import math
import socket
import sqlite3
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, closing, suppress
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from PIL import Image
from playwright.async_api import Page, expect

from tests.integration.console.conftest import OpenPage
from tests.kit.flight import fly
from tests.kit.missions import replaced, shipped
from vfguide.commands.console import live_console
from vfguide.companion.mission_plan import local_frame
from vfguide.formation.arrangement import Arrangement
from vfguide.lab.console.model import FormationModel
from vfguide.lab.console.server import ConsoleAddress, served
from vfguide.lab.console.source import RecordedFlight, Source
from vfguide.lab.console.tiles import open_tiles
from vfguide.lab.rehearsal.live import watched_by_anybody
from vfguide.lab.rehearsal.processes import free_port
from vfguide.mission import Mission
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord

HOSTILE = "<img src=x onerror=alert(1)>"

PLAYER = "document.getElementById('replay').player"


@pytest.fixture(scope="module")
def record() -> FlightRecord:
    """12 s of a rehearsal, with names that are markup."""
    found = fly("circle-wind", 12.0).record
    leader, first, *others = found.vehicles
    return replace(found, mission=HOSTILE, vehicles=(leader, replace(first, name=HOSTILE), *others))


@asynccontextmanager
async def nobody(
    port: int, token: str, operator_token: str | None = None, **certificate: Path
) -> AsyncIterator[str]:
    """The console of a formation of which nobody is heard."""
    mission = shipped("circle-wind")
    own = free_port(socket.SOCK_DGRAM)
    link = f"udp://127.0.0.1:{free_port(socket.SOCK_DGRAM)}?port={own}"
    formation = watched_by_anybody(mission, [link])
    address, tokens = ConsoleAddress(port=port, **certificate), {"token": token}
    tokens |= {"operator_token": operator_token} if operator_token else {}
    async with live_console(mission, formation, address=address, **tokens) as url:
        yield url


@asynccontextmanager
async def shown(source: Source, open_page: OpenPage, title: str = "a") -> AsyncIterator[Page]:
    """The page of a console."""
    async with served(source, ConsoleAddress(port=0), title=title) as url, open_page(url) as page:
        yield page


ENABLED = """() => [...document.querySelectorAll("button, input, select, summary")].filter(
    one => !one.disabled && one.checkVisibility()).length"""
FOCUSED = """() => {
    const one = document.activeElement;
    if (!one.matches("button, input, select, summary")) return null;
    window.reached ??= new Set();
    window.reached.add(one);
    return [window.reached.size, one.textContent.trim()];
}"""


async def test_an_operator_gets_everywhere_with_the_tab_key_and_aborts_with_it(open_page):
    async with (
        nobody(free_port(socket.SOCK_STREAM), "a" * 24, "o" * 24) as url,
        open_page(f"{url.partition('?')[0]}?token={'o' * 24}") as page,
    ):
        await expect(page.get_by_role("button", name="ABORT")).to_be_visible()
        wanted, reached, words = await page.evaluate(ENABLED), 0, []
        # Once round at most: the page's own places without controls are passed, too.
        for _ in range(2 * wanted):
            await page.keyboard.press("Tab")
            if (found := await page.evaluate(FOCUSED)) is not None:
                reached = found[0]
                words.append(found[1])
            if reached == wanted:
                break
        assert reached == wanted
        # What calls everything off comes first of all.
        assert words[0] == "ABORT"
        await page.get_by_role("button", name="ABORT").focus()
        await page.keyboard.press("Enter")
        await expect(page.locator("#outcome")).to_contain_text("abort")


@asynccontextmanager
async def idle(url: str, count: int) -> AsyncIterator[list[int]]:
    """Connections that say nothing, each opened again as soon as it is ended; how often one was."""
    parts, ended, loop = urlsplit(url), [0], asyncio.get_running_loop()

    async def stay() -> None:
        while True:
            with socket.socket() as own, suppress(OSError):
                own.settimeout(0.0)
                await loop.sock_connect(own, (parts.hostname, parts.port))
                await loop.sock_recv(own, 1)
            ended[0] += 1

    async with asyncio.TaskGroup() as group:
        tasks = [group.create_task(stay()) for _ in range(count)]
        yield ended
        for task in tasks:
            task.cancel()


@pytest.mark.parametrize("secure", [False, True], ids=["plain", "tls"])
async def test_all_is_called_off_while_five_hundred_connections_say_nothing(
    secure, certificate, open_page
):
    tokens = ("a" * 24, "o" * 24)
    async with (
        nobody(free_port(socket.SOCK_STREAM), *tokens, **(certificate if secure else {})) as url,
        idle(url, 500) as ended,
        open_page(f"{url.partition('?')[0]}?token={'o' * 24}") as page,
    ):
        # Those that were there before the page have been let go, and others have come since.
        while ended[0] < 500:
            await asyncio.sleep(0.1)
        await page.get_by_role("button", name="ABORT").click()
        await expect(page.locator("#outcome")).to_contain_text("abort")


async def test_a_link_on_another_site_opens_the_page_at_the_first_press(record, open_page):
    async with (
        served(RecordedFlight(record), ConsoleAddress(port=0), title="flight") as url,
        open_page("about:blank") as page,
    ):
        mail = f'<a href="{url}">console</a>'
        await page.route(
            "http://mail.example/", lambda route: route.fulfill(body=mail, content_type="text/html")
        )
        await page.goto("http://mail.example/")
        await page.get_by_role("link", name="console").click()
        await expect(page.get_by_role("heading", name="flight")).to_be_visible()


async def test_a_recorded_flight_plays_and_its_names_stay_text(record, open_page):
    said = FlightEvent(time_s=1.0, vehicle=HOSTILE, kind="order", text=f"order 1 {HOSTILE}")
    record = replace(record, events=(said,))
    async with shown(RecordedFlight(record), open_page, title=record.mission) as page:
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
        await page.evaluate(f"{PLAYER}.pause()")
        entry = page.locator("[data-part=events] button.order")
        await expect(entry).to_contain_text(HOSTILE)
        await entry.click()
        assert float(await slider.input_value()) == 1.0


TRACE = "document.querySelector('canvas.trace').toDataURL()"


async def trace_after(page: Page, *times_s: float) -> str:
    """Pixels of a card's trace some time after the last of some moments was looked at."""
    await page.evaluate(f"times => times.forEach(time => {PLAYER}.seek(time))", list(times_s))
    await page.wait_for_timeout(1500)
    return str(await page.evaluate(TRACE))


async def test_the_last_minute_on_a_card_is_that_of_the_moment_where_it_stops(record, open_page):
    async with shown(RecordedFlight(record), open_page) as page:
        await expect(page.locator("canvas.trace").first).to_be_visible()
        await page.evaluate(f"{PLAYER}.pause()")
        early, late = await trace_after(page, 2.0), await trace_after(page, 10.0)
        assert early != late
        # Faster than traces are drawn.
        assert await trace_after(page, 2.0, 10.0) == late
        assert await trace_after(page, 10.0, 2.0) == early


def map_of(path: Path, mission: Mission) -> Path:
    """One green picture at zoom 10, where the mission is."""
    origin, count = mission.origin, 2**10
    column = int((origin.longitude_deg + 180.0) / 360.0 * count)
    mercator = math.asinh(math.tan(math.radians(origin.latitude_deg))) / math.pi
    row = int(0.5 * (1.0 - mercator) * count)
    picture = BytesIO()
    Image.new("RGB", (256, 256), (0, 255, 0)).save(picture, "PNG")
    with closing(sqlite3.connect(path)) as file:
        file.execute("CREATE TABLE metadata (name TEXT, value TEXT)")
        file.execute("INSERT INTO metadata VALUES ('attribution', ?)", (HOSTILE + "Survey",))
        file.execute(
            "CREATE TABLE tiles (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER, tile_data)"
        )
        numbers = (10, column, count - 1 - row)
        file.execute("INSERT INTO tiles VALUES (?, ?, ?, ?)", (*numbers, picture.getvalue()))
        file.commit()
    return path


GREEN = """() => {
    const canvas = document.querySelector('[data-part=scene]');
    const { data } = canvas.getContext("2d").getImageData(5, canvas.height - 5, 1, 1);
    return data[1] > data[0] + 100 && data[1] > data[2] + 100;
}"""


async def test_a_map_of_a_file_lies_below_a_recorded_flight_and_can_be_hidden(
    record, open_page, tmp_path
):
    mission = shipped("circle-wind")
    tiles = open_tiles(str(map_of(tmp_path / "a.mbtiles", mission)))
    source = RecordedFlight(record, tiles=tiles)
    async with shown(source, open_page) as page:
        await page.wait_for_function(GREEN)
        await expect(page.get_by_text("Survey", exact=True)).to_be_visible()
        # 5 km north and 6 km west, as the companions reckon it.
        place = mission.origin.latitude_deg + 0.05, mission.origin.longitude_deg - 0.08
        underlay = f"{PLAYER}.scene.underlay"
        found = await page.evaluate(f"place => {underlay}.toLocal(...place)", list(place))
        north, east = local_frame(mission).to_local(*place)
        assert (found["north"], found["east"]) == pytest.approx((north, east), abs=0.1)
        await page.get_by_role("button", name="Map").click()
        await page.wait_for_function(f"() => !({GREEN})()")
        await expect(page.locator(".margins").first).to_contain_text("to its limit")


async def test_looking_back_shows_the_path_and_the_order_of_that_moment(open_page):
    paths = {"other": {"type": "line", "course_deg": 90.0}}
    formation = FormationModel(replaced("circle-wind", paths=paths))
    for tenths in range(100):
        if tenths == 50:
            order = Arrangement(number=7, time_s=0.0, across_s=0.0, places=(), path="other")
            formation.take_order(7, order, leads="leader")
        formation.sample(0.1 * tenths)
    source = Source()
    words = {"cards": formation.cards(9.9), "alarms": [], "flies": formation.flies()}
    opening = json.dumps({**formation.describe(), **words})
    source.opening = lambda: opening  # type: ignore[method-assign]
    async with shown(source, open_page) as page:
        flies = page.locator("#flies")
        path = f"{PLAYER}.flight.pathName"
        await expect(flies).to_contain_text("order 7")
        assert await page.evaluate(path) == "other"
        await page.evaluate(f"{PLAYER}.pause()")
        await page.evaluate(f"{PLAYER}.seek(2)")
        await expect(flies).to_have_text("leader leads · the mission's formation")
        assert await page.evaluate(path) == "main"
        # The order is an entry of the time line, too: it was heard of at the sample at 4.9 s.
        entry = page.locator("[data-part=events] button")
        await expect(entry).to_have_count(1)
        await expect(entry).to_contain_text("order 7: ")
        await entry.click()
        assert await page.get_by_label("Time", exact=True).input_value() == "4.9"
        await expect(flies).to_contain_text("order 7")
        await page.get_by_role("button", name="Back to now").click()
        await expect(flies).to_contain_text("order 7")
        assert await page.evaluate(path) == "other"


async def test_a_page_comes_back_to_a_server_that_was_started_again_with_its_token(open_page):
    port = free_port(socket.SOCK_STREAM)
    async with AsyncExitStack() as stack:
        async with nobody(port, "a" * 24) as url:
            page = await stack.enter_async_context(open_page(url))
            status = page.locator("#freshness")
            await expect(status).to_contain_text("live")
        await expect(status).to_contain_text("No word from the console")
        async with nobody(port, "a" * 24):
            await expect(status).to_contain_text("live")
        await expect(status).to_contain_text("No word from the console")
        async with nobody(port, "b" * 24):
            await expect(status).to_contain_text("open the address")
