"""`vfguide fly --live`: a flight in real time, with real sockets and a process for each program.

Progress is a table redrawn in place on a terminal, plain lines elsewhere.
"""

import asyncio
import math
import socket
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random

from rich import box
from rich.live import Live
from rich.table import Table
from rich.text import Text

from vfguide.commands.fly import KeptFlight
from vfguide.commands.terminal import Terminal, fifths_of, stopped_by_signals
from vfguide.errors import CONSOLE, InputError, VfguideError, require
from vfguide.lab.console.tiles import TileSource, open_tiles
from vfguide.lab.ordering import timetable_given
from vfguide.lab.rehearsal.live import companions_lost, live_flight, watched_by_anybody
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.processes import broker, free_port
from vfguide.lab.report.figures import slot_error
from vfguide.link.opening import WatchedFormation, check_reachable, watching
from vfguide.link.presence import Presence
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.latency import Latency, latency_of

UNKNOWN = "-"

Show = Callable[[float, "Sequence[LiveRow]"], None]
"""Shows progress; called again and again with the simulation time and the vehicles."""

GROUP = "239.255.42.1"
"""Multicast group of flights without `--link`, on the loopback interface and a port of their own."""

BROKER = "mqtt"
"""Value of `--link` for a broker that the flight starts."""

FLIGHT_LOOK_S = 0.25
"""Real time between two updates of the display."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRow:
    """Present state of one vehicle."""

    vehicle: str
    mode: str
    """Mode that the companion reports; empty before its first report."""
    error_m: float | None
    """Distance from slot or path, by true states; None where there is none."""
    ground_speed_m_s: float | None
    """True ground speed."""
    leader_age_s: float | None
    """Age of the leader's state when the companion last used one; None for the leader."""


def rows_of(
    names: Sequence[str], record: FlightRecord | None, presences: Mapping[str, Presence]
) -> list[LiveRow]:
    """Return the state of vehicles by the newest true states, if any, and the companions' reports."""
    return [row_of(name, record, presences.get(name)) for name in names]


def row_of(name: str, record: FlightRecord | None, presence: Presence | None) -> LiveRow:
    """Return the present state of one vehicle."""
    error_m = speed_m_s = age_ms = None
    vehicle = next((one for one in record.vehicles if one.name == name), None) if record else None
    if record is not None and vehicle is not None:
        leads = vehicle is record.leader
        off = (
            abs(vehicle.path_cross_track_error_m)
            if leads
            else slot_error(record.reference, vehicle).distance_m
        )
        # A vehicle that has left the formation has no slot, and a leader in a hold follows no path.
        error_m = float(off[-1]) if math.isfinite(off[-1]) else None
        speed_m_s = float(vehicle.ground_speed_m_s[-1])
        if presence is not None and not leads:
            age_ms = presence.figures.get("leader_age_ms_last")
    mode = ""
    if presence is not None:
        mode = presence.mode if presence.status == "online" else presence.status
    return LiveRow(
        vehicle=name,
        mode=mode,
        error_m=error_m,
        ground_speed_m_s=speed_m_s,
        leader_age_s=None if age_ms is None else age_ms * 1e-3,
    )


def table_of(title: str, rows: Sequence[LiveRow]) -> Table:
    """Return the vehicles as a table."""
    table = Table(title=Text(title), title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("vehicle")
    table.add_column("mode")
    for heading in ("error, m", "ground speed, m/s", "leader's state, s old"):
        table.add_column(heading, justify="right")
    for row in rows:
        table.add_row(
            Text(row.vehicle),
            Text(row.mode or UNKNOWN),
            digits(row.error_m, 2),
            digits(row.ground_speed_m_s, 1),
            digits(row.leader_age_s, 3),
        )
    return table


def line_of(rows: Sequence[LiveRow]) -> str:
    """Return the vehicles in one line."""
    return ", ".join(
        f"{row.vehicle} {row.mode or UNKNOWN} {digits(row.error_m, 2)} m off" for row in rows
    )


def digits(value: float | None, decimals: int) -> str:
    """Return a number with fixed decimals, or a dash for None."""
    return UNKNOWN if value is None else f"{value:.{decimals}f}"


@contextmanager
def live_table(console: Terminal, title: str, duration_s: float) -> Iterator[Show]:
    """Yield a function that shows the time and the vehicles as they change."""
    if not console.is_terminal or console.is_dumb_terminal:
        begins_fifth = fifths_of(duration_s)

        def tell(now_s: float, rows: Sequence[LiveRow]) -> None:
            if begins_fifth(now_s):
                console.tell(f"{title}: {now_s:g} of {duration_s:g} s: {line_of(rows)}")

        yield tell
        return
    with Live(console=console, auto_refresh=False, transient=True) as live:

        def show(now_s: float, rows: Sequence[LiveRow]) -> None:
            heading = f"{title}: {now_s:.0f} of {duration_s:g} s"
            live.update(table_of(heading, rows), refresh=True)

        yield show


@dataclass(frozen=True, slots=True, kw_only=True)
class LivePage:
    """Options of the browser page that shows a live flight."""

    operator: bool
    """Whether orders can be given from the page."""
    tiles: TileSource | None
    foxglove: int | None
    """Loopback port of a Foxglove server beside the page; None for none."""


def live_page(*, operator: bool, tiles: str | None, foxglove: int | None) -> LivePage:
    """Prepare the page of a flight, with a map from a file or an address.

    Raises:
        InputError: there is no such map.
        MissingLibraryError: a library of pages is not installed.
    """
    require(*CONSOLE)
    below = None if tiles is None else open_tiles(tiles)
    return LivePage(operator=operator, tiles=below, foxglove=foxglove)


def fly_live(
    mission: Mission,
    *,
    links: Sequence[str],
    speedup: float,
    kept: KeptFlight,
    page: LivePage | None,
) -> int:
    """Fly a mission live, report, and return the exit status; arguments as of `flown_live`.

    Raises:
        InputError: the directory cannot be used, or the speed-up is out of range.
        VfguideError: a process ended unexpectedly, or no link is connected.
    """
    if not 0.0 < speedup <= 100.0:
        raise InputError(f"--speedup: {speedup:g} is not above 0 and at most 100")
    errors = Terminal(stderr=True)
    title = f"flying {mission.name} live"
    with kept.directory(mission) as directory:
        with (
            stopped_by_signals() as stop,
            live_table(errors, title, mission.rehearsal.duration_s) as show,
            tempfile.TemporaryDirectory() as scratch,
        ):
            flight = asyncio.run(
                flown_live(
                    mission,
                    links,
                    speedup=speedup,
                    directory=directory or Path(scratch),
                    show=show,
                    stop=stop,
                    tell=errors.tell,
                    page=page,
                )
            )
        return kept.conclude(flight, directory)


def check_live(mission: Mission, *, speedup: float = 1.0) -> None:
    """Check that a mission has no events that a live flight cannot time.

    Raises:
        InputError: it loses links or guidance, or has orders and `speedup` is not 1.
    """
    if mission.orders and speedup != 1.0:
        raise InputError(
            "orders: are timed in real time; leave --speedup out, or take them out of the mission"
        )
    if any(one.what != "companion" for one in mission.rehearsal.losses):
        raise InputError(
            "rehearsal.losses: only a flight in virtual time loses a link or guidance; leave --live out, or"
            " have it lose the companion (what: companion), whose process is killed"
        )


async def flown_live(
    mission: Mission,
    links: Sequence[str],
    *,
    speedup: float,
    directory: Path,
    show: Show = lambda _time_s, _rows: None,
    stop: Callable[[], bool] = lambda: False,
    tell: Callable[[str], None] = lambda _: None,
    page: LivePage | None = None,
) -> LockstepFlight:
    """Fly a mission live to its end, or until `stop` returns True.

    Args:
        mission: to fly.
        links: addresses of the formation's links, or `mqtt`; UDP on this computer if empty.
        speedup: simulation seconds per real second.
        directory: for the files of the processes.
        show: shows the time and the state of each vehicle.
        stop: returns whether to end now.
        tell: prints messages to the user.
        page: browser page that shows the flight; None for none.

    Raises:
        InputError: the mission has events of virtual time alone.
        VfguideError: a process ended unexpectedly, or no link is connected.
    """
    check_live(mission, speedup=speedup)
    async with AsyncExitStack() as stack:
        links = await stack.enter_async_context(links_for(links, directory))
        # Companions fly on without a broker, so a missing one would go unnoticed.
        await check_reachable(watched_by_anybody(mission, links), random=Random())
        began = time.perf_counter()
        flight = await stack.enter_async_context(
            live_flight(mission, directory=directory, links=links, speedup=speedup)
        )
        if speedup == 1.0 and mission.followers:
            tell(f"orders to it, from another terminal: {flight.order_command}")
        _, presences = await stack.enter_async_context(watching(flight.watched, random=Random()))
        if page is not None:
            await stack.enter_async_context(console_of(mission, flight.watched, tell, page))
        before, flies, interrupted = flight.accounts(), False, False
        async with (
            companions_lost(flight),
            timetable_given(
                mission, flight.watched, time_s=lambda: flight.truth_collector.time_s, tell=tell
            ),
        ):
            while (
                now_s := flight.truth_collector.time_s
            ) < mission.rehearsal.duration_s and not interrupted:
                flight.check()
                if now_s >= 0.0 and not flies:
                    # Excludes the start from the processes' usage in flight.
                    before, flies = flight.accounts(), True
                seen = flight.record_now() if flies else None
                show(max(now_s, 0.0), rows_of(flight.names, seen, presences))
                await asyncio.sleep(FLIGHT_LOOK_S)
                interrupted = stop()
        if interrupted:
            tell("stopping: the companions hand their vehicles back")
        if not flies and flight.truth_collector.time_s < 0.0:
            raise VfguideError("stopped before the aircraft were in the air: nothing was flown")
        wall_s = time.perf_counter() - began
        after = flight.accounts()
        await flight.stop_companions()
        figures = {name: presence.figures for name, presence in presences.items()}
        usage = {name: after[name].since(one) for name, one in before.items() if name in after}
        latency = latency_of(figures, leader=mission.leader.vehicle, processes=usage)
        if (late := find_slowness(mission, latency, speedup)) is not None:
            tell(late)
        record = flight.record(wall_s=wall_s)
    return LockstepFlight(
        record=record, events={}, logs={}, interrupted=interrupted, latency=latency
    )


@asynccontextmanager
async def links_for(named: Sequence[str], directory: Path) -> AsyncIterator[tuple[str, ...]]:
    """Yield the addresses of a live flight's links for as long as the context lasts.

    An address `mqtt` stands for a broker that is started here and writes into the directory.

    Raises:
        VfguideError: there is no broker to start.
    """
    if not named:
        port = free_port(socket.SOCK_DGRAM)
        yield (f"udp://{GROUP}:{port}?interface=127.0.0.1",)
    elif BROKER in named:
        async with broker(directory) as port:
            yield tuple(f"mqtt://127.0.0.1:{port}" if one == BROKER else one for one in named)
    else:
        yield tuple(named)


def find_slowness(mission: Mission, latency: Latency, speedup: float) -> str | None:
    """Return a warning that the computer was too slow for the flight, whose errors it then caused, or None.

    Args:
        mission: flown.
        latency: ages of the leader's states at their use, in simulated time.
        speedup: simulation seconds per real second.
    """
    age_ms = latency.together().leader_age_ms
    if age_ms is None or age_ms.p99 < mission.patience.leader_s * 1e3:
        return None
    slower = "" if speedup <= 1.0 else f"fly it with --speedup {min(1.0, speedup / 2.0):g}, or "
    return (
        f"this computer was too slow: in 1 % of cases the leader's state was {age_ms.p99 * 1e-3:.1f} s old"
        f" or more, and after {mission.patience.leader_s:g} s a follower takes its leader for lost, so these"
        f" errors are not the formation's; {slower}end what else runs here"
    )


@asynccontextmanager
async def console_of(
    mission: Mission, watched: WatchedFormation, tell: Callable[[str], None], page: LivePage
) -> AsyncIterator[None]:
    """Serve the flight on a page, and print its addresses for viewers and operators."""
    # Imported here, since it brings the web server's libraries.
    from vfguide.commands.console import (
        addresses_of,
        check_orders,
        live_console,
        new_operator_token,
    )
    from vfguide.commands.credentials import Credentials
    from vfguide.lab.console.server import ConsoleAddress

    second = None
    if page.operator:
        check_orders(Credentials(roster=watched.roster, key=watched.key))
        second = new_operator_token(None)
    async with live_console(
        mission,
        watched,
        address=ConsoleAddress(port=0),
        operator_token=second,
        tiles=page.tiles,
        foxglove=page.foxglove,
    ) as url:
        for line in addresses_of(url, second):
            tell(line)
        yield
