"""How a report's replay loads, plays and scrolls in a headless Chromium without a graphics card.

`python -m tests.benchmarks.replay REPORT.html` tells the file's size, the time until the picture stands,
pictures a second while it plays and while it is scrolled, and what the page keeps in memory. The address that
`vfguide console --replay DIR` prints may stand in place of the file.
"""

import argparse
import asyncio
import shutil
import time
from pathlib import Path

from playwright.async_api import Page

from tests.kit.browser import device, launched
from tests.kit.figures import tell

PATIENCE_MS = 300_000
PLAYED_S = 10.0

FRAMES = """([seconds, scroll]) => new Promise((done) => {
    const player = document.getElementById('replay').player;
    const slider = document.querySelector('[data-part=slider]');
    const began = performance.now();
    let frames = 0;
    const count = (now) => {
        frames += 1;
        const passed = (now - began) / 1000;
        if (scroll) player.seek(Number(slider.max) * (0.5 - 0.5 * Math.cos(passed)));
        if (passed < seconds) requestAnimationFrame(count);
        else done(frames / passed);
    };
    requestAnimationFrame(count);
})"""
"""Pictures a second, as they come; while it is scrolled there and back in 6 s."""


async def measure(page: Page, place: str) -> None:
    """Open a report or a console and print what it takes."""
    began, file = time.monotonic(), Path(place)
    served = "://" in place
    # The console's stream of events never ends.
    await page.goto(place if served else file.resolve().as_uri(), wait_until="load")
    # The console's policy lets no waiting function of the driver's be evaluated in the page.
    while not await page.evaluate("() => Boolean(document.getElementById('replay')?.player)"):
        await page.wait_for_timeout(20)
    await page.evaluate(
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    taken_s = time.monotonic() - began
    size = "the console" if served else f"{file}: {file.stat().st_size / 1e6:.2f} MB"
    tell(f"{size}, stands after {taken_s:.1f} s")
    await page.evaluate("() => document.getElementById('replay').player.pause()")
    play, slider = page.locator("[data-part=play]"), page.locator("[data-part=slider]")
    tell(f"length: {float(await slider.get_attribute('max') or 0.0):.0f} s")
    await play.click()
    before = await slider.input_value()
    frames = await page.evaluate(FRAMES, [PLAYED_S, False])
    after = await slider.input_value()
    tell(f"plays: {frames:.0f} pictures a second, from {before} to {after} s")
    await play.click()
    frames = await page.evaluate(FRAMES, [PLAYED_S, True])
    tell(f"scrolls: {frames:.0f} pictures a second")
    heap = await page.evaluate("() => performance.memory.usedJSHeapSize")
    tell(f"memory of the page's program: {heap / 1e6:.0f} MB")


async def main() -> None:
    """Measure the reports and consoles that are given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("places", nargs="+", metavar="REPORT.html|URL")
    chosen = parser.parse_args()
    program = shutil.which("chromium") or shutil.which("google-chrome") or "chromium"
    async with launched(program) as browser:
        for place in chosen.places:
            page = await browser.new_page(**device())
            page.set_default_timeout(PATIENCE_MS)
            await measure(page, place)
            await page.close()


if __name__ == "__main__":
    asyncio.run(main())
