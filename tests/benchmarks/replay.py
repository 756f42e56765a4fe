"""How a report's replay loads, plays and scrolls in a headless Chromium without a graphics card.

`python tests/benchmarks/replay.py REPORT.html` tells the file's size, the time until the picture stands,
pictures a second while it plays and while it is scrolled, and what the page keeps in memory.
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


def measure(page: Page, file: Path) -> None:
    """Open a report and print what it takes."""
    began = time.monotonic()
    page.goto(file.resolve().as_uri(), wait_until="load")
    page.evaluate(
        "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    tell(
        f"{file}: {file.stat().st_size / 1e6:.2f} MB, stands after {time.monotonic() - began:.1f} s"
    )
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
    """Measure the reports that are given."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("reports", nargs="+", type=Path)
    chosen = parser.parse_args()
    program = shutil.which("chromium") or shutil.which("google-chrome")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=program, args=["--disable-dev-shm-usage"]
        )
        for file in chosen.reports:
            page = browser.new_page(viewport={"width": 1280, "height": 900})
            page.set_default_timeout(PATIENCE_MS)
            measure(page, file)
            page.close()
        browser.close()


if __name__ == "__main__":
    main()
