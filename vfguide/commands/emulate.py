"""`vfguide emulate`: the emulator of one aircraft of a flight that `vfguide judge` starts."""

import os
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from vfguide.commands.credentials import check_flies
from vfguide.commands.options import MissionOption, Speedup, VehicleName
from vfguide.lab.rehearsal.live import await_start
from vfguide.mission import read_mission
from vfguide.system import require_linux

PATIENCE_S = 180.0
"""Real time that a judge may take to start the flight."""


def emulate(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: Annotated[
        str, typer.Option(metavar="URL", help="Its companion, such as udpin://0.0.0.0:14540.")
    ],
    truth: Annotated[
        str, typer.Option(metavar="URL", help="The judge of true states: udpout://HOST:PORT.")
    ],
    start: Annotated[
        Path, typer.Option(metavar="FILE", help="Where the judge writes when to begin.")
    ],
    speedup: Speedup = 1.0,
) -> NoReturn:
    """Emulate one aircraft of a mission, in its place and wind, when `vfguide judge` says so.

    Exit status: as `sitl-stub`, which it becomes; 2 the input is wrong, 3 the start did not come.
    """
    # Here, because an aircraft's computer has no library that counts what processes take.
    from vfguide.lab.rehearsal.live import emulator_command

    require_linux("vfguide emulate")
    flown = read_mission(mission).mission
    check_flies(flown, vehicle)
    epoch_s = await_start(start, patience_s=PATIENCE_S)
    # In memory: a container's file system may be read-only. The emulator inherits what is open.
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
    # The emulator takes this process over: it knows nothing of missions, and needs none of their memory.
    os.execv(command[0], command)  # noqa: S606
