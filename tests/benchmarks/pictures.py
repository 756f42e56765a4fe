"""Make the pictures of the orders' and the console's pages anew.

python -m tests.benchmarks.pictures docs/images

The console's takes a minute of live flight by UDP, and Chromium.
"""

import asyncio
import shutil
import socket
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.async_api import expect

from tests.kit.browser import device, launched
from tests.kit.missions import shipped
from vfguide.commands.console import live_console
from vfguide.lab.console.server import ConsoleAddress
from vfguide.lab.rehearsal.live import live_flight
from vfguide.lab.rehearsal.processes import free_port
from vfguide.lab.report.colours import colours_of
from vfguide.lab.report.style import dress, new_figure, save_figure, with_palette
from vfguide.lab.report.tracks_plot import draw_aircraft
from vfguide.mission.order_plan import timetable

OPERATOR = "o" * 24


def shapes(path: Path) -> None:
    """Draw from where to where each follower flies by the orders of the mission `shapes`."""
    mission = shipped("shapes")
    colours = colours_of([mission.leader.vehicle, *mission.followers_by_name])
    figure = new_figure(10.0, 6.4)
    panels = figure.subplots(2, 3).flat
    for axes, (order, _), timed in zip(panels, timetable(mission), mission.orders, strict=False):
        draw_aircraft(axes, 0.0, 0.0, 0.0, colour=colours[mission.leader.vehicle], size=16.0)
        for one in order.places:
            colour, begin, end = colours[one.vehicle], one.begin, one.end
            axes.plot([begin.right, end.right], [begin.forward, end.forward], color=colour)
            axes.plot([begin.right], [begin.forward], "o", color=colour, alpha=0.5)
            draw_aircraft(axes, end.right, end.forward, 0.0, colour=colour, size=16.0)
        title = f"{timed.order.shape}, {order.time_s:.0f} s, in {order.duration_s:.0f} s"
        dress(axes, title=title, across="right of the leader, m", up="ahead, m")
        axes.set_aspect("equal", adjustable="datalim")
    save_figure(figure, path)


async def console(path: Path) -> None:
    """Fly a formation, have an order rehearsed on the console's page, and take the page's picture."""
    mission = shipped("circle-wind")
    link = f"udp://239.255.77.1:{free_port(socket.SOCK_DGRAM)}?interface=127.0.0.1"
    program = shutil.which("chromium") or "google-chrome"
    with TemporaryDirectory() as directory:
        async with (
            live_flight(mission, directory=Path(directory), links=[link]) as flight,
            live_console(
                mission, flight.watched, address=ConsoleAddress(port=0), operator_token=OPERATOR
            ) as url,
            launched(program) as browser,
        ):
            page = await (await browser.new_context(**device())).new_page()
            await page.goto(f"{url.partition('?')[0]}?token={OPERATOR}")
            await page.get_by_label("Order", exact=True).select_option("vee")
            await page.get_by_label("Spacing in metres").fill("30")
            await asyncio.sleep(60.0)
            await page.get_by_role("button", name="Rehearse").click()
            await expect(page.locator("#outcome")).to_contain_text("nearest", timeout=60_000)
            picture = Image.open(BytesIO(await page.screenshot())).convert("RGB")
            with_palette(picture).save(path, optimize=True)


if __name__ == "__main__":
    place = Path(sys.argv[1])
    shapes(place / "shapes.png")
    asyncio.run(console(place / "console.png"))
