"""`vfguide console`: a formation, or a recorded flight, on a page of a browser."""

import re
import secrets
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vfguide.commands.credentials import Credentials, KeyFiles, watched_formation
from vfguide.commands.options import Foxglove, Insecure, KeyFile, RosterFile, in_directory
from vfguide.commands.report import read_flight
from vfguide.commands.terminal import Terminal, stop_event
from vfguide.errors import CONSOLE, InputError, require
from vfguide.link.opening import WatchedFormation
from vfguide.mission import Mission, read_mission
from vfguide.regular_file import open_regular, read_by_others
from vfguide.system import run_watching_sockets

if TYPE_CHECKING:
    from vfguide.lab.console.server import ConsoleAddress
    from vfguide.lab.console.tiles import TileSource

LONGEST_TOKEN = 200
TOKEN = re.compile(r"[A-Za-z0-9_-]{20,200}")


def console(
    mission: Annotated[
        Path | None,
        typer.Argument(
            metavar="MISSION", help="Mission file (YAML), or the name of one that comes along."
        ),
    ] = None,
    *,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="The formation's link, such as mqtt://host:1883; several are used at once.",
        ),
    ] = None,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    replay: Annotated[
        list[Path] | None,
        in_directory(
            "Show a recorded flight instead: what `fly --out` wrote or companions recorded."
        ),
    ] = None,
    host: Annotated[
        str, typer.Option(metavar="HOST", help="Interface to serve on; any but loopback needs TLS.")
    ] = "127.0.0.1",
    port: Annotated[
        int,
        typer.Option(
            metavar="PORT", min=0, max=65535, help="Port to serve on; 0 for any free one."
        ),
    ] = 8080,
    certificate: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Certificate for TLS, PEM.")
    ] = None,
    certificate_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Private key of the certificate, PEM.")
    ] = None,
    published: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="In a container: the loopback address of the host at which its port is published.",
        ),
    ] = None,
    token: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File that keeps the token of the page's address, so that open pages outlive a restart.",
        ),
    ] = None,
    operator: Annotated[
        bool,
        typer.Option(
            "--operator",
            help="Let orders be given from a second address; the operator's private key signs them.",
        ),
    ] = False,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|URL",
            help="A map below the formation: an MBTiles file of pictures, or https://host/{z}/{x}/{y}.png.",
        ),
    ] = None,
    foxglove: Foxglove = None,
) -> None:
    """Show a formation on a page of a browser: who is where, how well, and what to do.

    It only looks on, unless --operator is given. Ctrl-C ends it. Exit status: 0 ended, 2 the input is wrong.
    """
    require(*CONSOLE, *(() if foxglove is None else ("foxglove",)))
    # Imported here, since an aircraft's computer lacks the library that serves pages.
    from vfguide.lab.console.server import ConsoleAddress, served
    from vfguide.lab.console.source import RecordedFlight
    from vfguide.lab.console.tiles import open_tiles

    below = None if tiles is None else open_tiles(tiles)
    address = ConsoleAddress(
        host=host,
        port=port,
        certificate=certificate,
        certificate_key=certificate_key,
        published=published,
    )
    if replay:
        if mission is not None or link:
            raise InputError("--replay: shows a recorded flight; leave MISSION and --link out")
        if operator:
            raise InputError("--operator: a recorded flight takes no orders; leave it out")
        if foxglove is not None:
            raise InputError(
                "--foxglove: a recorded flight is shown by `vfguide export --out F.mcap`"
            )
        address.check()
        record = read_flight(replay)
        recorded = RecordedFlight(record, tiles=below)
        kept = None if token is None else kept_token(token)
        run_watching_sockets(shown(served(recorded, address, title=record.mission, token=kept)))
        return
    if mission is None or not link:
        raise InputError(
            "give MISSION and --link URL to show a formation, or --replay DIR to show a flight"
        )
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    flown = read_mission(mission).mission
    address.check()
    credentials = keys.of_operator()
    if operator:
        check_orders(credentials)
    watched = watched_formation(flown, link, credentials)
    kept = None if token is None else kept_token(token)
    second = new_operator_token(token) if operator else None
    run_watching_sockets(
        shown(
            live_console(
                flown,
                watched,
                address=address,
                token=kept,
                operator_token=second,
                tiles=below,
                foxglove=foxglove,
            ),
            second,
        )
    )


async def shown(page: AbstractAsyncContextManager[str], operator_token: str | None = None) -> None:
    """Print the address of a page and serve it until Ctrl-C or SIGTERM."""
    async with page as url:
        stop = stop_event()
        for line in addresses_of(url, operator_token):
            Terminal().tell(line)
        await stop.wait()


@asynccontextmanager
async def live_console(
    mission: Mission,
    watched: WatchedFormation,
    *,
    address: "ConsoleAddress",
    token: str | None = None,
    operator_token: str | None = None,
    tiles: "TileSource | None" = None,
    foxglove: int | None = None,
) -> AsyncIterator[str]:
    """Serve the console of a formation for as long as the context lasts; yield its address.

    Args:
        mission: of the formation.
        watched: links of the formation, and the operator's key that signs orders.
        address: interface, port and certificate.
        token: lets viewers in; None for a random one.
        operator_token: lets operators in, who give orders; None allows no orders.
        tiles: map below the formation, if any.
        foxglove: port of a Foxglove server beside the page; None for none.
    """
    # Imported here, since an aircraft's computer lacks the library that serves pages.
    from vfguide.lab.console.server import served
    from vfguide.lab.console.source import live_flight_of

    orders = operator_token is not None
    async with (
        live_flight_of(mission, watched, orders=orders, tiles=tiles) as source,
        served(
            source, address, title=mission.name, token=token, operator_token=operator_token
        ) as url,
    ):
        if foxglove is None:
            yield url
            return
        # Imported here, since its library belongs to the extra `files`.
        from vfguide.lab.console.foxglove import foxglove_stream

        with foxglove_stream(mission, foxglove) as (stream, where):
            source.also = stream.show
            Terminal().tell(f"foxglove: {where}")
            yield url


def check_orders(credentials: Credentials) -> None:
    """Check that orders can be signed.

    Raises:
        InputError: there is no key to sign them with.
    """
    if credentials.roster is not None and credentials.key is None:
        raise InputError(
            "--operator: an order is signed by an operator: give a private key with --key, or make keys with"
            " `vfguide keys make MISSION`"
        )


def new_operator_token(token_file: Path | None) -> str:
    """Return the operators' token: random, or kept in a file beside the viewers' token.

    Raises:
        InputError: it is kept, and cannot be used.
    """
    if token_file is None:
        return secrets.token_urlsafe(24)
    return kept_token(token_file.with_name(f"{token_file.name}.operator"))


def addresses_of(url: str, operator_token: str | None) -> tuple[str, ...]:
    """Return lines with the addresses of a console, the operators' address second."""
    first = f"console: {url}"
    if operator_token is None:
        return (first,)
    page = url.partition("?")[0]
    return first, f"console for operators, who give orders: {page}?token={operator_token}"


def kept_token(path: Path) -> str:
    """Read a token from a file, or make the file: open pages then outlive a restart.

    Raises:
        InputError: the file can be read by others, is no token, or cannot be written.
    """
    try:
        with open_regular(path) as file:
            shared = read_by_others(path.stat())
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
    """Write a random token to a new file that only its owner can read.

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
