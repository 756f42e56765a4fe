"""Command line: options in, exit status out."""

import atexit
import os
import secrets
import shutil
import sys
import tempfile
import traceback
from contextlib import suppress
from importlib import import_module
from importlib.metadata import version as version_of
from itertools import zip_longest
from pathlib import Path
from typing import Annotated, Any, cast

import typer
from typer.core import TyperGroup

from vfguide.commands.options import with_plugins
from vfguide.commands.terminal import Terminal, discard, escape_what_cannot_be_encoded
from vfguide.errors import InputError, VfguideError, missing_library
from vfguide.registry import plugin_fault

WRONG_INPUT, BROKEN = 2, 3

MATPLOTLIB = "MPLCONFIGDIR"
"""Environment variable with Matplotlib's directory for its font list; by default in the user's home."""

UsageError = cast("type[typer.BadParameter]", typer.BadParameter.__base__)
"""Base class of all usage errors; Typer exports only some of its subclasses."""

FOXGLOVE, FOXGLOVE_PORT = "--foxglove", "8765"

SHOWN_FAULTS = 50
"""Maximum number of printed faults; a file with more is not a mission."""

COMMANDS = {
    "fly": "Fly a whole formation on this computer.",
    "companion": "Run the companion of one vehicle, until SIGTERM.",
    "identify": "Fly small steps of course and speed, and find how the autopilot answers.",
    "judge": "Start, watch and judge a flight whose emulators and companions another program runs.",
    "emulate": "Emulate one aircraft of a mission, in its place and wind, when `vfguide judge` says so.",
    "order": "Order a formation that flies to change: rehearsed first, then agreed on by all vehicles.",
    "status": "Tell how the vehicles of a mission are, and whether they are ready: one line, go or no-go.",
    "console": "Show a formation on a page of a browser: who is where, how well, and what to do.",
    "check": "Find out what can be known before take-off.",
    "report": "Write the report of a flight, rehearsed or recorded.",
    "export": "Write a flight for other tools: Foxglove, Google Earth, spreadsheets, pandas.",
    "analyse": "Write the report of a flight from the logs that its autopilots wrote.",
    "bench": "Measure on this computer.",
    "keys": "Keys by which the members of a formation know each other.",
}
"""First line of each command's help; the module of the same name implements the command."""

ELSEWHERE = {"emulate": "judge"}
"""Commands that are in the module of another."""


class CommandGroup(TyperGroup):
    """Command group that imports commands on use: a daemon on an aircraft loads none of the others."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - of Typer's own Click
        """Find and load the typed command."""
        name, _, rest = super().resolve_command(ctx, args)
        return name, loaded(name or ""), with_usual_port(rest)


def with_usual_port(args: list[str]) -> list[str]:
    """Insert Foxglove's usual port after a `--foxglove` without one, since Typer has no optional values."""
    found = []
    for word, after in zip_longest(args, args[1:], fillvalue=""):
        found.append(word)
        if word == FOXGLOVE and not after.isdecimal():
            found.append(FOXGLOVE_PORT)
    return found


app = typer.Typer(
    name="vfguide",
    cls=CommandGroup,
    help="Vector-field guidance that flies several fixed-wing UAVs as one formation, over MAVLink.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def tell_version(wanted: bool) -> None:
    """Print the version and end.

    Raises:
        typer.Exit: the version was requested.
    """
    if wanted:
        Terminal().tell(f"vfguide {version_of('vfguide')}")
        raise typer.Exit


@app.callback()
def program(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=tell_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Vector-field guidance that flies several fixed-wing UAVs as one formation, over MAVLink."""
    del version


EXAMPLES = {
    "fly": ("vfguide fly circle-wind --out flights/first", "vfguide fly mission.yaml --wind calm"),
    "companion": (
        "vfguide companion f1 --mission mission.yaml --mavlink serial:///dev/ttyAMA0:921600 \\",
        "    --link mqtts://broker:8883",
    ),
    "identify": (
        "vfguide identify f1 --mission mission.yaml --mavlink udpin://0.0.0.0:14551 --out found",
    ),
    "judge": (
        "vfguide judge mission.yaml --truth udpin://0.0.0.0:14999 --link mqtts://broker:8883 \\",
        "    --start begin --out flights/judged",
    ),
    "emulate": (
        "vfguide emulate f1 --mission mission.yaml --mavlink udpout://companion-f1:14540 \\",
        "    --truth udpout://judge:14999 --start begin",
    ),
    "bench": ("vfguide bench --quick", "vfguide bench --json bench.json"),
    "bench latency": ("vfguide bench latency --seconds 30",),
    "bench radio": ("vfguide bench radio",),
    "bench ablations": ("vfguide bench ablations --quick",),
    "bench robustness": ("vfguide bench robustness --quick",),
    "bench scale": ("vfguide bench scale --quick",),
    "bench monte-carlo": ("vfguide bench monte-carlo --formations 40 --law pid",),
    "bench suite": ("vfguide bench suite --law slot --law pursuit --plugin examples/own_law.py",),
    "keys": ("vfguide keys make mission.yaml",),
    "keys make": ("vfguide keys make mission.yaml",),
    "keys show": ("vfguide keys show mission.yaml",),
    "keys rotate": ("vfguide keys rotate mission.yaml f1",),
    "keys revoke": ("vfguide keys revoke mission.yaml f1 --link mqtts://broker:8883",),
    "order": (
        "vfguide order mission.yaml line-abreast --spacing 30 --link mqtts://broker:8883",
        "vfguide order mission.yaml lead f2 --link mqtts://broker:8883",
    ),
    "status": ("vfguide status mission.yaml --link mqtts://broker:8883 --watch",),
    "console": ("vfguide console mission.yaml --link mqtts://broker:8883",),
    "check": ("vfguide check mission.yaml",),
    "report": ("vfguide report flights/first",),
    "export": ("vfguide export flights/first --out flight.mcap",),
    "analyse": ("vfguide analyse mission.yaml 1.BIN 2.BIN --out flights/analysed",),
}
"""Typical calls, for the end of each command's help."""


def epilog(name: str) -> str | None:
    """Return a command's examples in the form of the help: one per line."""
    lines = EXAMPLES.get(name)
    return None if lines is None else "\n".join(("\b", "Examples:", *(f"  {one}" for one in lines)))


def loaded(name: str) -> Any:  # noqa: ANN401 - of Typer's own Click
    """Return a command with its options, or a group with its commands."""
    command = getattr(import_module(f"vfguide.commands.{ELSEWHERE.get(name, name)}"), name)
    if not isinstance(command, typer.Typer):
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(name, epilog=epilog(name))(with_plugins(command))
        return typer.main.get_command(alone)
    command.info.name, command.info.epilog = name, epilog(name)
    for one in command.registered_commands:
        short = one.name or getattr(one.callback, "__name__", "")
        one.epilog = epilog(f"{name} {short}")
    return typer.main.get_group(command)


def unloaded() -> None:
    """Represent a command that is not loaded in the program's help."""


for listed, summary in COMMANDS.items():
    app.command(listed, help=summary)(unloaded)


def main() -> None:
    """Run the command line: faults that a user can mend are one line each, never a traceback."""
    escape_what_cannot_be_encoded()
    keep_caches_out_of_home()
    try:
        status = app(prog_name="vfguide", standalone_mode=False)
    except UsageError as error:
        complain(usage_fault(error))
        sys.exit(WRONG_INPUT)
    except InputError as error:
        complain(str(error))
        sys.exit(WRONG_INPUT)
    except VfguideError as error:
        complain(str(error))
        sys.exit(BROKEN)
    except OSError as error:
        discard(sys.stdout)
        place = f"{error.filename}: " if error.filename else ""
        complain(f"{place}{error.strerror or error}")
        sys.exit(BROKEN)
    except Exception as error:
        for said, status in ((missing_library, BROKEN), (plugin_fault, WRONG_INPUT)):
            if (fault := said(error)) is not None:
                complain(fault)
                sys.exit(status)
        # Status 1 would mean that the flight was flown.
        traceback.print_exc()
        raise SystemExit(BROKEN) from error
    sys.exit(status)


def keep_caches_out_of_home() -> None:
    """Let Matplotlib keep its font list in a temporary directory, unless the user names one."""
    if os.environ.get(MATPLOTLIB):
        return
    # Matplotlib creates the directory when it draws.
    place = Path(tempfile.gettempdir()) / f"vfguide-fonts-{secrets.token_hex(8)}"
    os.environ[MATPLOTLIB] = str(place)
    atexit.register(shutil.rmtree, place, ignore_errors=True)


def usage_fault(error: typer.BadParameter) -> str:
    """Return a usage error in a line that refers to the command's help, or the help itself."""
    command = "vfguide" if error.ctx is None else error.ctx.command_path
    text = error.format_message().rstrip(".")
    if text.startswith("Usage:"):
        return text
    return f"{command}: {text[:1].lower()}{text[1:]}; see {command} -h"


def complain(text: str) -> None:
    """Print a fault, limited to SHOWN_FAULTS lines."""
    errors = Terminal(stderr=True)
    lines = text.splitlines()
    if len(lines) > SHOWN_FAULTS:
        lines[SHOWN_FAULTS:] = [f"and {len(lines) - SHOWN_FAULTS} more"]
    # If even this cannot be written, the exit status has to suffice.
    with suppress(OSError):
        errors.tell("\n".join(lines))
