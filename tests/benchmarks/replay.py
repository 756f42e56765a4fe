"""How a report's replay loads, plays and scrolls in a headless Chromium without a graphics card.

`python tests/benchmarks/replay.py REPORT.html` tells the file's size, the time until the picture stands,
pictures a second while it plays and while it is scrolled, and what the page keeps in memory. The address that
`vfguide console --replay DIR` prints may stand in place of the file.
"""

import argparse
import shutil
import sys
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

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


def measure(page: Page, place: str) -> None:
    """Open a report or a console and print what it takes."""
    began, file = time.monotonic(), Path(place)
    served = "://" in place
    # The console's stream of events never ends.
    page.goto(place if served else file.resolve().as_uri(), wait_until="load")
    # The console's policy lets no waiting function of the driver's be evaluated in the page.
    while not page.evaluate("() => Boolean(document.getElementById('replay')?.player)"):
        page.wait_for_timeout(20)
    page.evaluate(
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    taken_s = time.monotonic() - began
    size = "the console" if served else f"{file}: {file.stat().st_size / 1e6:.2f} MB"
    tell(f"{size}, stands after {taken_s:.1f} s")
    page.evaluate("() => document.getElementById('replay').player.pause()")
    tell(f"length: {float(page.locator('[data-part=slider]').get_attribute('max') or 0.0):.0f} s")
    page.locator("[data-part=play]").click()
    before = page.locator("[data-part=slider]").input_value()
    frames = page.evaluate(FRAMES, [PLAYED_S, False])
    after = page.locator("[data-part=slider]").input_value()
    tell(f"plays: {frames:.0f} pictures a second, from {before} to {after} s")
    page.locator("[data-part=play]").click()
    frames = page.evaluate(FRAMES, [PLAYED_S, True])
    tell(f"scrolls: {frames:.0f} pictures a second")
    heap = page.evaluate("() => performance.memory.usedJSHeapSize")
    tell(f"memory of the page's program: {heap / 1e6:.0f} MB")


def tell(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def main() -> None:
    """Measure the reports and consoles that are given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("places", nargs="+", metavar="REPORT.html|URL")
    chosen = parser.parse_args()
    program = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--disable-dev-shm-usage"]
        )
        for place in chosen.places:
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.set_default_timeout(PATIENCE_MS)
            measure(page, place)
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
