"""The report in a real browser: Chromium without a window, its clock in the hands of the test."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

from tests.kit.browser import chromium, device
from vfguide.lab.report import page as report_page
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.page import render_page
from vfguide.record.flight import FlightRecord

PATIENCE_MS = 180_000
"""A busy machine may take minutes to paint; no verdict depends on it."""

OpenPage = Callable[..., Page]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Chromium. One for each file of tests, for its driver keeps an event loop running."""
    program = chromium()
    with sync_playwright() as playwright:
        # A container's /dev/shm is too small for what Chromium keeps there.
        browser = playwright.chromium.launch(
            executable_path=program, args=["--disable-dev-shm-usage"]
        )
        yield browser
        browser.close()


@pytest.fixture
def open_page(browser: Browser) -> Iterator[OpenPage]:
    """Opens a file from the disk, without a network.

    What the browser has to say fails the test, unless the test takes it in a list of its own.
    """
    errors: list[str] = []

    def opened(
        path: Path, *, phone: bool = False, dark: bool = False, told: list[str] = errors
    ) -> Page:
        context = browser.new_context(
            **device(phone=phone, dark=dark), device_scale_factor=2 if phone else 1, offline=True
        )
        context.set_default_timeout(PATIENCE_MS)
        page = context.new_page()
        page.on("pageerror", lambda error: told.append(str(error)))
        page.on("console", lambda message: told.append(message.text))
        page.clock.install(time=0)
        page.clock.pause_at(1000)
        page.goto(path.as_uri())
        return page

    yield opened
    for context in browser.contexts:
        context.close()
    assert errors == []


@pytest.fixture
def write_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[FlightRecord], Path]:
    """Writes the report of a flight without its plots, which take their time."""

    def written(record: FlightRecord) -> Path:
        monkeypatch.setattr(report_page, "plots_for", lambda _: ())
        path = tmp_path / "report.html"
        path.write_text(render_page(record, summarise(record), ()), encoding="utf-8")
        return path

    return written
