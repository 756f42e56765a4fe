"""`vfguide emulate`: one aircraft of a mission, for a flight that `vfguide judge` starts and judges."""

import os
from pathlib import Path
from typing import NoReturn

from vfguide.commands.vehicles import check_flies
from vfguide.lab.rehearsal.live import emulator_command
from vfguide.lab.rehearsal.watched import await_start
from vfguide.mission import Mission

PATIENCE_S = 180.0
"""Real time that a judge may take to start the flight."""


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
    command = emulator_command(
        mission, vehicle, mavlink=mavlink, truth=truth, epoch_s=epoch_s, speedup=speedup
    )
    # The emulator takes this process over: it knows nothing of missions, and needs none of their memory.
    os.execv(command[0], command)  # noqa: S606
