"""`vfguide judge` and `emulate`: a flight whose programs run somewhere else, as in containers."""

import asyncio
import os
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NoReturn

from vfguide.commands.credentials import KeyFiles, check_flies, watched_formation
from vfguide.commands.fly import conclude, output_of, stopped_by_signals
from vfguide.commands.terminal import Terminal, flight_progress
from vfguide.errors import InputError
from vfguide.lab.rehearsal.live import emulator_command
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.watched import WatchedFlight, await_start, watched_flight
from vfguide.link.opening import WatchedFormation
from vfguide.mavlink.address import NetworkAddress, Transport, parse_address
from vfguide.mission import Mission

CONTAINER_LOOK_S = 0.2
"""Real time between looks at the flight."""

PATIENCE_S = 180.0
"""Real time that a judge may take to start the flight."""


def judge_flight(
    mission: Mission,
    *,
    truth: str,
    links: Sequence[str],
    keys: KeyFiles,
    start: Path,
    speedup: float,
    patience_s: float,
    out: Path,
    force: bool,
    as_json: bool,
) -> int:
    """Judge a flight and return the exit status, as `vfguide fly` does.

    Args:
        mission: the mission.
        truth: where emulators send true states.
        links: addresses of the formation's links.
        keys: what the command line says about keys.
        start: file that tells the emulators when to begin.
        speedup: simulation seconds for each real one.
        patience_s: real time to wait for companions.
        out: where everything is kept.
        force: whether what is there may be replaced.
        as_json: whether standard output is the summary alone.

    Raises:
        InputError: an address is wrong, or a place cannot be written to.
        VfguideError: an emulator has fallen silent.
    """
    port, credentials = truth_port(truth), keys.of_operator()
    watched = watched_formation(mission, links, credentials)
    errors = Terminal(stderr=True)
    title = f"flying {mission.name}"
    with output_of(mission, out, force=force) as directory:
        with (
            stopped_by_signals() as stop,
            flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
        ):
            flight = asyncio.run(
                _watch(
                    mission,
                    truth=port,
                    watched=watched,
                    start=start,
                    speedup=speedup,
                    patience_s=patience_s,
                    progress=progress,
                    stop=stop,
                )
            )
        return conclude(flight, directory, out=out, force=force, as_json=as_json)


async def _watch(
    mission: Mission,
    *,
    truth: tuple[str, int],
    watched: WatchedFormation,
    start: Path,
    speedup: float,
    patience_s: float,
    progress: Callable[[float], None],
    stop: Callable[[], bool],
) -> LockstepFlight:
    """The flight, from waiting for companions to its end or until told to stop."""
    async with watched_flight(mission, truth=truth, watched=watched, speedup=speedup) as flight:
        await _until_online(flight, patience_s=patience_s, stop=stop)
        flight.start(start)
        while flight.truth_collector.time_s < mission.rehearsal.duration_s and not stop():
            flight.check()
            progress(max(flight.truth_collector.time_s, 0.0))
            await asyncio.sleep(CONTAINER_LOOK_S)
        interrupted = stop()
        record = flight.truth_collector.record(wall_s=flight.elapsed_s)
        latency = await flight.latency()
    return LockstepFlight(
        record=record, events={}, logs={}, interrupted=interrupted, latency=latency
    )


async def _until_online(
    flight: WatchedFlight, *, patience_s: float, stop: Callable[[], bool]
) -> None:
    """Wait for all companions; an aircraft whose companion does not come flies without it."""
    gives_up = time.monotonic() + patience_s
    missing = await flight.missing()
    while missing and time.monotonic() < gives_up and not stop():
        await asyncio.sleep(CONTAINER_LOOK_S)
        missing = await flight.missing()
    if missing:
        Terminal(stderr=True).tell(f"begun without the companions of {', '.join(missing)}")


def truth_port(text: str) -> tuple[str, int]:
    """Host and port of `udpin://host:port`.

    Raises:
        InputError: it is something else.
    """
    address = parse_address(text)
    if not isinstance(address, NetworkAddress) or address.transport != Transport.UDP_IN:
        raise InputError(f"--truth: {text!r} is not udpin://HOST:PORT")
    return address.host, address.port


def emulate(
    mission: Mission, vehicle: str, *, mavlink: str, truth: str, start: Path, speedup: float
) -> NoReturn:
    """Wait for the start, then become the emulator of a vehicle.

    Args:
        mission: the mission.
        vehicle: which of its vehicles.
        mavlink: where its companion speaks to it.
        truth: address of the judge.
        start: file that the judge writes.
        speedup: simulation seconds for each real one.

    Raises:
        InputError: the vehicle does not fly in the mission.
        VfguideError: the start does not come.
    """
    check_flies(mission, vehicle)
    epoch_s = await_start(start, patience_s=PATIENCE_S)
    # In memory: a container's file system may be read-only. The emulator inherits what is open.
    file = os.memfd_create("emulator", 0)
    command = emulator_command(
        mission,
        vehicle,
        file=f"/proc/self/fd/{file}",
        mavlink=mavlink,
        truth=truth,
        epoch_s=epoch_s,
        speedup=speedup,
    )
    # The emulator takes this process over: it knows nothing of missions, and needs none of their memory.
    os.execv(command[0], command)  # noqa: S606
