"""The console in a real browser: Chromium without a window."""

import os
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import pytest
from playwright.async_api import Browser, Page, async_playwright

DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}

PATIENCE_MS = 120_000
"""A busy machine takes long; no verdict depends on it."""

OpenPage = Callable[..., AbstractAsyncContextManager[Page]]


def chromium() -> str:
    """The program; without it tests are skipped, or fail where CI runs."""
    program = (
        os.environ.get("CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")
    )
    if program is None:
        reason = (
            "no Chromium: install it (apt install chromium), or name it in the variable CHROMIUM"
        )
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)
    return program


@asynccontextmanager
async def launched(program: str) -> AsyncIterator[Browser]:
    """A browser for as long as the context lasts."""
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=program, args=["--disable-dev-shm-usage"]
        )
        try:
            yield browser
        finally:
            await browser.close()


@pytest.fixture
def open_page() -> OpenPage:
    """Opens an address; an error of the page's own program fails the test."""
    program = chromium()

    @asynccontextmanager
    async def opened(url: str, *, phone: bool = False, dark: bool = False) -> AsyncIterator[Page]:
        errors: list[str] = []
        async with launched(program) as browser:
            context = await browser.new_context(
                viewport=PHONE if phone else DESKTOP,  # type: ignore[arg-type]
                has_touch=phone,
                is_mobile=phone,
                color_scheme="dark" if dark else "light",
            )
            context.set_default_timeout(PATIENCE_MS)
            page = await context.new_page()
            page.on("pageerror", lambda error: errors.append(str(error)))
            await page.goto(url)
            yield page
        assert errors == []

    return opened
