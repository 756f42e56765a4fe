"""Arguments and options that several commands share."""

import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Annotated, Any

import typer

from vfguide.errors import InputError
from vfguide.registry import use_plugins


def directory_of(text: str) -> Path:
    """Return a directory by its name.

    Raises:
        InputError: the name is empty, as from an unset variable; it would mean the current directory.
    """
    if not text:
        raise InputError("DIR: is empty; name a directory, or . for the one you are in")
    return Path(text)


def in_directory(text: str) -> Any:  # noqa: ANN401 - as Typer declares it
    """Return an option that names a directory, with its help."""
    return typer.Option(metavar="DIR", help=text, parser=directory_of)


MissionFile = Annotated[
    Path,
    typer.Argument(
        metavar="MISSION", help="Mission file (YAML), or the name of one that comes along."
    ),
]
MissionOption = Annotated[Path, typer.Option(metavar="MISSION", help="Mission file (YAML).")]
VehicleName = Annotated[
    str, typer.Argument(metavar="VEHICLE", help="Name of the vehicle in the mission.")
]
AutopilotUrl = Annotated[
    str,
    typer.Option(metavar="URL", help="Address of its autopilot, such as udpin://0.0.0.0:14540."),
]
LinkUrls = Annotated[
    list[str],
    typer.Option(
        "--link",
        metavar="URL",
        help="Address of the formation's link, such as mqtt://host:1883; may be given several times.",
    ),
]
KeyFile = Annotated[
    Path | None,
    typer.Option(
        "--key",
        metavar="FILE",
        help="Private key to sign with; default: NAME.key in the mission's directory of keys.",
    ),
]
RosterFile = Annotated[
    Path | None,
    typer.Option(
        "--roster",
        metavar="FILE",
        help="Public keys of everybody; default: the mission's name with the ending .roster.",
    ),
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Sign nothing, and believe everybody on the link.")
]
StateDirectory = Annotated[
    Path | None,
    in_directory(
        "Directory that keeps whether it has engaged; default: STATE_DIRECTORY or XDG_STATE_HOME."
    ),
]
SigningKeyFile = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE",
        help="Key to sign MAVLink, and to drop unsigned messages: a file with 64 hex digits.",
    ),
]
Foxglove = Annotated[
    int | None,
    typer.Option(
        metavar="[PORT]",
        min=0,
        max=65535,
        help="Serve Foxglove and PlotJuggler beside the page; port 8765 if absent, 0 for any free one.",
    ),
]

Duration = Annotated[float | None, typer.Option(metavar="S", help="Length of the flight, seconds.")]
Speedup = Annotated[
    float, typer.Option(metavar="X", min=0.01, max=100.0, help="Simulated seconds per real second.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]
Force = Annotated[
    bool, typer.Option("--force", help="Replace in --out what another flight or program wrote.")
]
Controller = Annotated[
    str | None,
    typer.Option(
        metavar="LAW",
        help="Law to fly by instead of the file's; 'article exact' is without bounds.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="FIELD=VALUE",
        help="Another value for a field, such as controller.k_x=0.3; may be given several times.",
    ),
]
Plugins = Annotated[
    list[Path] | None,
    typer.Option(
        "--plugin",
        metavar="FILE",
        help="Python file with a law, path, link, autopilot or plant of your own; may be repeated.",
    ),
]


def with_plugins(command: Callable[..., None]) -> Callable[..., None]:
    """Return the command with the option `--plugin`, whose files are loaded before the command runs."""

    @wraps(command)
    def run(*arguments: Any, plugin: list[Path] | None = None, **options: Any) -> None:  # noqa: ANN401
        use_plugins(plugin or ())
        command(*arguments, **options)

    signature = inspect.signature(command)
    option = inspect.Parameter(
        "plugin", inspect.Parameter.KEYWORD_ONLY, default=None, annotation=Plugins
    )
    parameters = [*signature.parameters.values(), option]
    vars(run)["__signature__"] = signature.replace(parameters=parameters)
    run.__annotations__ = {**command.__annotations__, "plugin": Plugins}
    return run
