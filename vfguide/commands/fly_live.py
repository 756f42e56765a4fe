"""`vfguide fly --live`: real time, real sockets, a process for each program."""

import asyncio
import tempfile
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random

from vfguide.commands.fly import conclude, prepare, stopped_by_signals
from vfguide.commands.terminal import Terminal, flight_progress
from vfguide.errors import InputError
from vfguide.link.address import parse_link
from vfguide.link.broker import embedded_broker
from vfguide.link.watch import presences
from vfguide.mission import Mission
from vfguide.rehearsal.live import LiveFlight, live_flight
from vfguide.rehearsal.lockstep import Flight
from vfguide.rehearsal.usage import usage_of

LOOK_S = 0.2
"""Real time between looks at the flight."""

LISTEN_S = 1.0
"""Real time to hear from every companion at the end."""


def fly_live(
    mission: Mission, *, link: str | None, speedup: float, out: Path | None, as_json: bool
) -> int:
    """Fly a mission live, report, and return the exit status.

    Args:
        mission: the mission.
        link: address of a broker; an embedded one if absent.
        speedup: simulation seconds for each real one.
        out: where everything is kept.
        as_json: whether standard output is the summary alone.

    Raises:
        InputError: the directory cannot be written to, or the speed-up is no speed.
        VfguideError: a process that should not has ended.
    """
    if not 0.0 < speedup <= 100.0:
        raise InputError(f"--speedup: {speedup:g} is not above 0 and at most 100")
    errors = Terminal(stderr=True)
    if out is not None:
        prepare(out)
    title = f"flying {mission.name} live"
    with (
        stopped_by_signals() as stop,
        flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
        tempfile.TemporaryDirectory() as scratch,
    ):
        directory = Path(scratch) if out is None else out
        flight = asyncio.run(
            _fly(mission, link, speedup=speedup, directory=directory, progress=progress, stop=stop)
        )
    return conclude(flight, out=out, as_json=as_json)


async def _fly(
    mission: Mission,
    link: str | None,
    *,
    speedup: float,
    directory: Path,
    progress: Callable[[float], None],
    stop: Callable[[], bool],
) -> Flight:
    """The flight itself, to its end or until told to stop."""
    async with AsyncExitStack() as stack:
        if link is None:
            port = await stack.enter_async_context(embedded_broker())
            link = f"mqtt://127.0.0.1:{port}"
        began = time.perf_counter()
        flight = await stack.enter_async_context(
            live_flight(mission, directory=directory, link=link, speedup=speedup)
        )
        interrupted = False
        while flight.judge.time_s < mission.rehearsal.duration_s and not interrupted:
            flight.check()
            progress(max(flight.judge.time_s, 0.0))
            await asyncio.sleep(LOOK_S)
            interrupted = stop()
        record = flight.record(wall_s=time.perf_counter() - began)
        latency = await _latency(flight, link)
    return Flight(record=record, events={}, logs={}, interrupted=interrupted, latency=latency)


async def _latency(flight: LiveFlight, link: str) -> dict[str, dict[str, float]]:
    """What the companions say of their latencies, and what they take of the computer."""
    found = await presences(
        parse_link(link), flight.mission.name, seconds=LISTEN_S, random=Random()
    )
    latency = {name: dict(presence.figures) for name, presence in found.items()}
    for name, process in flight.companions.items():
        if process.pid is not None:
            latency.setdefault(name, {}).update(usage_of(process.pid))
    return latency
