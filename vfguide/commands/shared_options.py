"""Arguments and options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.errors import InputError


def directory(text: str) -> Path:
    """A directory by its name.

    Raises:
        InputError: the name is empty, as of a variable that is not set: it would be the current directory.
    """
    if not text:
        raise InputError("DIR: is empty; name a directory, or . for the one you are in")
    return Path(text)


MissionFile = Annotated[Path, typer.Argument(metavar="MISSION", help="Mission file (YAML).")]
MissionOption = Annotated[Path, typer.Option(metavar="MISSION", help="Mission file (YAML).")]
VehicleName = Annotated[str, typer.Argument(metavar="VEHICLE", help="Its name in the mission.")]
AutopilotUrl = Annotated[
    str, typer.Option(metavar="URL", help="Its autopilot, such as udpin://0.0.0.0:14540.")
]
LinkUrl = Annotated[
    str, typer.Option(metavar="URL", help="The formation's link, such as mqtt://host:1883.")
]
Duration = Annotated[float | None, typer.Option(metavar="S", help="Length of the flight, seconds.")]
Speedup = Annotated[
    float, typer.Option(metavar="X", min=0.01, max=100.0, help="Times as fast as real time.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]
Force = Annotated[
    bool, typer.Option("--force", help="Replace in --out what another flight or program wrote.")
]
