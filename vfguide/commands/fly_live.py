"""`vfguide fly --live`: real time, real sockets, a process for each program."""

import asyncio
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from random import Random

from vfguide.commands.fly import conclude, output_of, stopped_by_signals
from vfguide.commands.live_table import Show, live_table, rows_of
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError, VfguideError
from vfguide.link.watch import check_reachable, watching
from vfguide.mission import Mission
from vfguide.record.latency import latency_of
from vfguide.rehearsal.broker_process import broker_process
from vfguide.rehearsal.live import live_flight, watched_by_anybody
from vfguide.rehearsal.lockstep import Flight

LOOK_S = 0.25
"""Real time between looks at the flight."""


def fly_live(
    mission: Mission,
    *,
    links: Sequence[str],
    speedup: float,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> int:
    """Fly a mission live, report, and return the exit status.

    Args:
        mission: the mission.
        links: addresses of the formation's links; an embedded broker if there are none.
        speedup: simulation seconds for each real one.
        out: where everything is kept.
        force: whether what is there may be replaced.
        as_json: whether standard output is the summary alone.

    Raises:
        InputError: the directory cannot be written to or holds something else, or the speed-up is no speed.
        VfguideError: a process that should not has ended, or none of the links stands.
    """
    if not 0.0 < speedup <= 100.0:
        raise InputError(f"--speedup: {speedup:g} is not above 0 and at most 100")
    errors = Terminal(stderr=True)
    title = f"flying {mission.name} live"
    with output_of(mission, out, force=force) as kept:
        with (
            stopped_by_signals() as stop,
            live_table(errors, title, mission.rehearsal.duration_s) as show,
            tempfile.TemporaryDirectory() as scratch,
        ):
            directory = kept or Path(scratch)
            flight = asyncio.run(
                flown_live(
                    mission,
                    links,
                    speedup=speedup,
                    directory=directory,
                    show=show,
                    stop=stop,
                    tell=errors.tell,
                )
            )
        return conclude(flight, kept, out=out, force=force, as_json=as_json)


def show_nothing(time_s: float, rows: object) -> None:
    """Show nothing of a flight while it is flown."""
    del time_s, rows


async def flown_live(
    mission: Mission,
    links: Sequence[str],
    *,
    speedup: float,
    directory: Path,
    show: Show = show_nothing,
    stop: Callable[[], bool] = lambda: False,
    tell: Callable[[str], None] = lambda _: None,
) -> Flight:
    """The flight itself, to its end or until told to stop.

    Args:
        mission: the mission.
        links: addresses of the formation's links; an embedded broker if there are none.
        speedup: simulation seconds for each real one.
        directory: for what its processes write.
        show: called with the time and what is known of each vehicle.
        stop: whether to end now.
        tell: called with what a user should read.

    Raises:
        VfguideError: a process that should not has ended, or none of the links stands.
    """
    async with AsyncExitStack() as stack:
        if not links:
            port = await stack.enter_async_context(broker_process(directory / "broker.log"))
            links = (f"mqtt://127.0.0.1:{port}",)
        else:
            # Companions fly on without a broker: that it was never there would show nowhere.
            await check_reachable(watched_by_anybody(mission, links), random=Random())
        began = time.perf_counter()
        flight = await stack.enter_async_context(
            live_flight(mission, directory=directory, links=links, speedup=speedup)
        )
        presences = await stack.enter_async_context(watching(flight.watched, random=Random()))
        before, flies, interrupted = flight.accounts(), False, False
        while (
            now_s := flight.truth_collector.time_s
        ) < mission.rehearsal.duration_s and not interrupted:
            flight.check()
            if now_s >= 0.0 and not flies:
                # What starting took is not what flying takes.
                before, flies = flight.accounts(), True
            seen = flight.truth_collector.record(wall_s=0.0, only_now=True) if flies else None
            show(max(now_s, 0.0), rows_of(flight.names, seen, presences))
            await asyncio.sleep(LOOK_S)
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
        record = flight.record(wall_s=wall_s)
    return Flight(record=record, events={}, logs={}, interrupted=interrupted, latency=latency)
