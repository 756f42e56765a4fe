"""The picture of the console in the docs: a live rehearsal, an order that was rehearsed and can be given.

    python -m tests.benchmarks.console_picture docs/images/console.png [--phone] [--dark] [--slanted]

Flies missions/circle-wind.yaml for a minute with `vfguide fly --live --console --operator`, opens the address
for operators in Chromium and rehearses a vee.
"""

import argparse
import asyncio
import re
import shutil
from io import BytesIO
from pathlib import Path

from PIL import Image
from playwright.async_api import Page

from tests.kit.browser import device, launched
from tests.kit.programs import running

OPERATORS = re.compile(rb"console for operators, who give orders: (\S+)")

FLOWN_S = 40
"""Until all are in their slots."""

PATIENCE_MS = 120_000


async def take_picture(page: Page, options: argparse.Namespace) -> None:
    """Rehearse an order, and write what the page shows."""
    page.set_default_timeout(PATIENCE_MS)
    await page.get_by_role("article").first.wait_for()
    await asyncio.sleep(FLOWN_S)
    if options.slanted:
        await page.get_by_role("button", name="3D").click()
    await page.get_by_label("Order", exact=True).select_option("vee")
    await page.get_by_label("Spacing in metres").fill("30")
    await page.get_by_role("button", name="Rehearse").click()
    await page.locator("#give:enabled").wait_for()
    await asyncio.sleep(2.0)
    shot = await page.screenshot(full_page=options.phone)
    # A page has few colours: a third of the bytes.
    Image.open(BytesIO(shot)).convert("RGB").quantize(128).save(options.out, optimize=True)


async def run(options: argparse.Namespace) -> None:
    """Fly, look and stop."""
    words = ("fly", "circle-wind", "--live", "--console", "--operator", "--duration", 300)
    pipes = {"stdout": asyncio.subprocess.DEVNULL, "stderr": asyncio.subprocess.PIPE}
    async with running("vfguide", *words, **pipes) as flight:
        assert flight.stderr is not None
        async with asyncio.timeout(120.0):
            while not (found := OPERATORS.search(await flight.stderr.readline())):
                pass
        async with launched(options.chromium) as browser:
            screen = device(phone=options.phone, dark=options.dark)
            page = await browser.new_page(**screen)
            await page.goto(found[1].decode())
            await take_picture(page, options)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    for option in ("--phone", "--dark", "--slanted"):
        parser.add_argument(option, action="store_true")
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    asyncio.run(run(parser.parse_args()))


if __name__ == "__main__":
    main()
