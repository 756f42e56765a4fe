"""`vfguide console`: a formation, or a recorded flight, on a page of a browser."""

import asyncio
import re
import secrets
import signal
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

from vfguide.commands.credentials import KeyFiles
from vfguide.commands.report import read_flight
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.lab.console.live import live_flight_of
from vfguide.lab.console.server import Address, served
from vfguide.lab.console.source import RecordedFlight, Source
from vfguide.link.address import parse_links
from vfguide.link.watch import Watched
from vfguide.mission import Mission
from vfguide.regular_file import open_regular

LONGEST_TOKEN = 200
TOKEN = re.compile(r"[A-Za-z0-9_-]{20,200}")

READ_BY_OTHERS = 0o077
"""Bits of a file's mode."""


def show_formation(
    mission: Mission,
    *,
    links: Sequence[str],
    keys: KeyFiles,
    address: Address,
    token_file: Path | None,
) -> None:
    """Serve the console of a formation until told to stop.

    Raises:
        InputError: an address, key, certificate or token cannot be used.
    """
    address.check()
    credentials = keys.of_operator()
    watched = Watched(
        addresses=parse_links(links),
        formation=mission.name,
        leader=mission.timekeeper,
        deputies=mission.deputies,
        roster=credentials.roster,
        key=credentials.key,
    )
    token = None if token_file is None else kept_token(token_file)

    async def run() -> None:
        async with live_console(mission, watched, address=address, token=token) as url:
            await tell_and_wait(url)

    asyncio.run(run())


def show_recorded(
    directories: Sequence[Path], *, address: Address, token_file: Path | None
) -> None:
    """Serve the console of a recorded flight until told to stop.

    Raises:
        InputError: there is no flight, or it cannot be served there.
    """
    address.check()
    record = read_flight(directories)
    source: Source = RecordedFlight(record)
    token = None if token_file is None else kept_token(token_file)

    async def run() -> None:
        async with served(source, address, title=record.mission, token=token) as url:
            await tell_and_wait(url)

    asyncio.run(run())


@asynccontextmanager
async def live_console(
    mission: Mission, watched: Watched, *, address: Address, token: str | None = None
) -> AsyncIterator[str]:
    """The console of a formation for as long as the context lasts; yields the address to open."""
    async with AsyncExitStack() as stack:
        source = await stack.enter_async_context(live_flight_of(mission, watched))
        yield await stack.enter_async_context(
            served(source, address, title=mission.name, token=token)
        )


async def tell_and_wait(url: str) -> None:
    """Print the address, and wait for Ctrl-C or SIGTERM."""
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    Terminal().tell(f"console: {url}")
    await stop.wait()


def kept_token(path: Path) -> str:
    """The token in a file, which is made if it is missing: pages that are open outlive a restart.

    Raises:
        InputError: the file can be read by others, is no token, or cannot be written.
    """
    try:
        with open_regular(path) as file:
            shared = path.stat().st_mode & READ_BY_OTHERS
            text = file.read(LONGEST_TOKEN + 2).decode("ascii", "replace").strip()
    except FileNotFoundError:
        return make_token(path)
    except OSError as error:
        raise InputError(f"--token {path}: cannot be read ({error.strerror})") from error
    if shared:
        raise InputError(f"--token {path}: others can read it; run chmod 600 {path}")
    if not TOKEN.fullmatch(text):
        raise InputError(f"--token {path}: holds no token; remove it, and a new one is made")
    return text


def make_token(path: Path) -> str:
    """A new token in a new file of its owner's alone.

    Raises:
        InputError: it cannot be written.
    """
    token = secrets.token_urlsafe(24)
    try:
        path.touch(mode=0o600, exist_ok=False)
        path.write_text(token + "\n", encoding="ascii")
    except OSError as error:
        raise InputError(f"--token {path}: cannot be written ({error.strerror})") from error
    return token
