"""`vfguide judge` and `emulate`: a flight whose programs run elsewhere, as in containers."""

import asyncio
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from vfguide.commands.credentials import KeyFiles, check_flies, watched_formation
from vfguide.commands.fly import KeptFlight
from vfguide.commands.options import (
    AsJson,
    Duration,
    Force,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    MissionOption,
    RosterFile,
    Speedup,
    VehicleName,
    in_directory,
)
from vfguide.commands.terminal import Terminal, flight_progress, stopped_by_signals
from vfguide.errors import InputError
from vfguide.lab.rehearsal.live import WatchedFlight, await_start, watched_flight
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.mavlink.address import NetworkAddress, Transport, parse_address
from vfguide.mission import read_mission
from vfguide.mission.overrides import Overrides
from vfguide.system import require_linux, run_watching_sockets

RECORD_LOOK_S = 0.2
"""Real time between two checks of the flight."""


def judge(
    mission: MissionFile,
    *,
    truth: Annotated[
        str,
        typer.Option(
            metavar="URL", help="Address at which emulators' true states arrive: udpin://HOST:PORT."
        ),
    ],
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    start: Annotated[
        Path, typer.Option(metavar="FILE", help="File that is written when the flight may begin.")
    ],
    out: Annotated[Path, in_directory("Directory for summary, report and record.")],
    duration: Duration = None,
    speedup: Speedup = 1.0,
    patience: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Real seconds to wait for companions.")
    ] = 60.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Start, watch and judge a flight whose emulators and companions another program runs.

    Waits until every companion is online, lets the emulators begin, and judges by their true states. Exit
    status: 0 flown and within the mission's acceptance, 1 flown but not within it, 2 the input is
    wrong, 3 the flight broke or was stopped.
    """
    changed = read_mission(mission, Overrides(duration_s=duration)).mission
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    port, credentials = truth_port(truth), keys.of_operator()
    watched = watched_formation(changed, link, credentials)
    kept = KeptFlight(out=out, force=force, as_json=as_json)

    async def flown() -> LockstepFlight:
        async with watched_flight(changed, truth=port, watched=watched, speedup=speedup) as flight:
            await until_online(flight, patience_s=patience, stop=stop)
            flight.start(start)
            while flight.truth_collector.time_s < changed.rehearsal.duration_s and not stop():
                flight.check()
                progress(max(flight.truth_collector.time_s, 0.0))
                await asyncio.sleep(RECORD_LOOK_S)
            interrupted = stop()
            record = flight.truth_collector.record(wall_s=flight.elapsed_s)
            latency = await flight.latency()
        return LockstepFlight(
            record=record, events={}, logs={}, interrupted=interrupted, latency=latency
        )

    with kept.directory(changed) as directory:
        with (
            stopped_by_signals() as stop,
            flight_progress(f"flying {changed.name}", changed.rehearsal.duration_s) as progress,
        ):
            flight = run_watching_sockets(flown())
        status = kept.conclude(flight, directory)
    raise typer.Exit(status)


async def until_online(
    flight: WatchedFlight, *, patience_s: float, stop: Callable[[], bool]
) -> None:
    """Wait for all companions, at most `patience_s`; aircraft whose companion is missing fly without it."""
    gives_up = time.monotonic() + patience_s
    missing = await flight.missing()
    while missing and time.monotonic() < gives_up and not stop():
        await asyncio.sleep(RECORD_LOOK_S)
        missing = await flight.missing()
    if missing:
        Terminal(stderr=True).tell(f"begun without the companions of {', '.join(missing)}")


def truth_port(text: str) -> tuple[str, int]:
    """Return host and port of `udpin://host:port`.

    Raises:
        InputError: it is something else.
    """
    address = parse_address(text)
    if not isinstance(address, NetworkAddress) or address.transport != Transport.UDP_IN:
        raise InputError(f"--truth: {text!r} is not udpin://HOST:PORT")
    return address.host, address.port


PATIENCE_S = 180.0
"""Real time within which a judge must start the flight."""


def emulate(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: Annotated[
        str,
        typer.Option(
            metavar="URL", help="Address of its companion, such as udpin://0.0.0.0:14540."
        ),
    ],
    truth: Annotated[
        str,
        typer.Option(
            metavar="URL",
            help="Address of the judge, who gets the true states: udpout://HOST:PORT.",
        ),
    ],
    start: Annotated[
        Path, typer.Option(metavar="FILE", help="File in which the judge says when to begin.")
    ],
    speedup: Speedup = 1.0,
) -> NoReturn:
    """Emulate one aircraft of a mission, in its place and wind, when `vfguide judge` says so.

    Exit status: as `sitl-stub`, which it becomes; 2 the input is wrong, 3 the start did not come.
    """
    # Imported here, since an aircraft's computer lacks the library that measures processes.
    from vfguide.lab.rehearsal.live import emulator_command

    require_linux("vfguide emulate")
    flown = read_mission(mission).mission
    check_flies(flown, vehicle)
    epoch_s = await_start(start, patience_s=PATIENCE_S)
    # In memory: a container's file system may be read-only. The emulator inherits open files.
    file = os.memfd_create("emulator", 0)
    command = emulator_command(
        flown,
        vehicle,
        file=f"/proc/self/fd/{file}",
        mavlink=mavlink,
        truth=truth,
        epoch_s=epoch_s,
        speedup=speedup,
    )
    # The emulator replaces this process, whose memory for missions it does not need.
    os.execv(command[0], command)  # noqa: S606
