"""The console in a real browser: Chromium without a window."""

import os
import shutil
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import pytest
from playwright.async_api import Page, expect

from tests.kit.browser import device, launched

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


expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture
def open_page() -> OpenPage:
    """Opens an address; an error of the page's own program fails the test."""
    program = chromium()

    @asynccontextmanager
    async def opened(url: str, *, phone: bool = False, dark: bool = False) -> AsyncIterator[Page]:
        errors: list[str] = []
        async with launched(program) as browser:
            context = await browser.new_context(**device(phone=phone, dark=dark))
            context.set_default_timeout(PATIENCE_MS)
            page = await context.new_page()
            page.on("pageerror", lambda error: errors.append(str(error)))
            await page.goto(url)
            yield page
        assert errors == []

    return opened
