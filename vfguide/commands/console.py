"""`vfguide console`: a formation, or a recorded flight, on a page of a browser."""

import asyncio
import re
import secrets
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

from vfguide.commands.credentials import Credentials, KeyFiles, watched_formation
from vfguide.commands.report import read_flight
from vfguide.commands.shared_options import stop_event
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.lab.console.live import live_flight_of
from vfguide.lab.console.server import ConsoleAddress, served
from vfguide.lab.console.source import RecordedFlight, Source
from vfguide.lab.console.tiles import TileSource
from vfguide.link.opening import WatchedFormation
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
    address: ConsoleAddress,
    token_file: Path | None,
    operator: bool = False,
    tiles: TileSource | None = None,
) -> None:
    """Serve the console of a formation until told to stop.

    Args:
        mission: of the formation.
        links: addresses of its links.
        keys: whom to believe, and the operator's private key.
        address: where it is served.
        token_file: keeps the token of the address; that of operators is kept beside it.
        operator: whether orders can be given, with that key.
        tiles: the map below the formation, if there is one.

    Raises:
        InputError: an address, key, certificate or token cannot be used.
    """
    address.check()
    credentials = keys.of_operator()
    if operator:
        check_orders(credentials)
    watched = watched_formation(mission, links, credentials)
    token = None if token_file is None else kept_token(token_file)
    second = new_operator_token(token_file) if operator else None

    async def run() -> None:
        async with live_console(
            mission, watched, address=address, token=token, operator_token=second, tiles=tiles
        ) as url:
            await tell_and_wait(*addresses_of(url, second))

    asyncio.run(run())


def show_recorded(
    directories: Sequence[Path],
    *,
    address: ConsoleAddress,
    token_file: Path | None,
    tiles: TileSource | None = None,
) -> None:
    """Serve the console of a recorded flight until told to stop.

    Raises:
        InputError: there is no flight, or it cannot be served there.
    """
    address.check()
    record = read_flight(directories)
    source: Source = RecordedFlight(record, tiles=tiles)
    token = None if token_file is None else kept_token(token_file)

    async def run() -> None:
        async with served(source, address, title=record.mission, token=token) as url:
            await tell_and_wait(*addresses_of(url, None))

    asyncio.run(run())


@asynccontextmanager
async def live_console(
    mission: Mission,
    watched: WatchedFormation,
    *,
    address: ConsoleAddress,
    token: str | None = None,
    operator_token: str | None = None,
    tiles: TileSource | None = None,
) -> AsyncIterator[str]:
    """The console of a formation for as long as the context lasts; yields the address to open.

    Args:
        mission: of the formation.
        watched: its links, and the operator's key by which orders are signed.
        address: where it is served.
        token: that lets in; one of chance if absent.
        operator_token: that lets operators in, who give orders; nobody does if absent.
        tiles: the map below the formation, if there is one.
    """
    orders = operator_token is not None
    async with AsyncExitStack() as stack:
        source = await stack.enter_async_context(
            live_flight_of(mission, watched, orders=orders, tiles=tiles)
        )
        yield await stack.enter_async_context(
            served(source, address, title=mission.name, token=token, operator_token=operator_token)
        )


def check_orders(credentials: Credentials) -> None:
    """See that orders can be given.

    Raises:
        InputError: there is no key to sign them with.
    """
    if credentials.roster is not None and credentials.key is None:
        raise InputError(
            "--operator: an order is signed by an operator: give a private key with --key, or make keys with"
            " `vfguide keys make MISSION`"
        )


def new_operator_token(token_file: Path | None) -> str:
    """The token of operators: kept beside that of the others, or one of chance.

    Raises:
        InputError: it is kept, and cannot be used.
    """
    if token_file is None:
        return secrets.token_urlsafe(24)
    return kept_token(token_file.with_name(f"{token_file.name}.operator"))


def addresses_of(url: str, operator_token: str | None) -> tuple[str, ...]:
    """Lines with the addresses of a console, that of operators second."""
    first = f"console: {url}"
    if operator_token is None:
        return (first,)
    page = url.partition("?")[0]
    return first, f"console for operators, who give orders: {page}?token={operator_token}"


async def tell_and_wait(*lines: str) -> None:
    """Print lines, and wait for Ctrl-C or SIGTERM."""
    stop = stop_event()
    for line in lines:
        Terminal().tell(line)
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
