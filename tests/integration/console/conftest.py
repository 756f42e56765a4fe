"""The console in a real browser: Chromium without a window."""

import subprocess
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path

import pytest
from playwright.async_api import Page, expect

from tests.kit.browser import chromium, device, launched

PATIENCE_MS = 120_000
"""A busy machine takes long; no verdict depends on it."""

OpenPage = Callable[..., AbstractAsyncContextManager[Page]]


expect.set_options(timeout=PATIENCE_MS)


@pytest.fixture
def certificate(tmp_path: Path, openssl_program: str) -> dict[str, Path]:
    """A certificate that nobody vouches for, and its key, as a console's address has them."""
    key, made = tmp_path / "key.pem", tmp_path / "certificate.pem"
    words = "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=console"
    names = ("-addext", "subjectAltName=IP:127.0.0.1", "-keyout", str(key), "-out", str(made))
    subprocess.run([openssl_program, *words.split(), *names], check=True, capture_output=True)
    return {"certificate": made, "certificate_key": key}


@pytest.fixture
def open_page() -> OpenPage:
    """Opens an address; an error of the page's own program fails the test."""
    program = chromium()

    @asynccontextmanager
    async def opened(url: str, *, phone: bool = False, dark: bool = False) -> AsyncIterator[Page]:
        errors: list[str] = []
        async with launched(program) as browser:
            context = await browser.new_context(
                **device(phone=phone, dark=dark), ignore_https_errors=True
            )
            context.set_default_timeout(PATIENCE_MS)
            page = await context.new_page()
            page.on("pageerror", lambda error: errors.append(str(error)))
            await page.goto(url)
            yield page
        assert errors == []

    return opened
