"""`vfguide fly --live`: real time, real sockets, a process for each program."""

import asyncio
import tempfile
import time
from collections.abc import Callable
from contextlib import AsyncExitStack
from pathlib import Path

from vfguide.commands.fly import (
    ACCEPTED,
    BROKEN,
    NOT_ACCEPTED,
    keep,
    prepare,
    show,
    stopped_by_signals,
)
from vfguide.commands.terminal import Terminal, flight_progress
from vfguide.errors import InputError
from vfguide.link.broker import embedded_broker
from vfguide.mission import Mission
from vfguide.rehearsal.live import live_flight
from vfguide.rehearsal.lockstep import Flight
from vfguide.report.metrics import summarise

LOOK_S = 0.2
"""Real time between looks at the flight."""


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
    summary = summarise(flight.record)
    if out is not None:
        keep(flight, summary, out)
    show(summary, flight, out, as_json=as_json)
    if flight.interrupted:
        errors.tell(f"stopped after {flight.record.duration_s:.1f} s of flight")
        return BROKEN
    return ACCEPTED if summary.accepted else NOT_ACCEPTED


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
    return Flight(record=record, events={}, logs={}, interrupted=interrupted)
