"""Chromium without a window."""

import os
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from playwright.async_api import Browser, async_playwright

DESKTOP = {"width": 1280, "height": 900}
PHONE = {"width": 390, "height": 844}


def device(*, phone: bool = False, dark: bool = False) -> dict[str, Any]:
    """What a page is told of the screen that shows it."""
    return {
        "viewport": PHONE if phone else DESKTOP,
        "has_touch": phone,
        "is_mobile": phone,
        "color_scheme": "dark" if dark else "light",
    }


def chromium() -> str:
    """The program; without it tests are skipped, or fail where CI runs."""
    named = os.environ.get("CHROMIUM")
    program = named or shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        end = pytest.fail if os.environ.get("CI") else pytest.skip
        end("no Chromium: install it (apt install chromium), or name it in the variable CHROMIUM")
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
