"""The command line: options in, exit status out."""

import sys
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from vfguide.commands.check import report_findings
from vfguide.commands.fly import fly as fly_mission
from vfguide.commands.overrides import (
    ControllerName,
    Overrides,
    PlantName,
    WindName,
    overridden,
)
from vfguide.commands.report import write_again
from vfguide.errors import InputError
from vfguide.mission import Mission, read_mission
from vfguide.mission.explain import explain
from vfguide.mission.feasibility import check_mission

WRONG_INPUT = 2

SHOWN_FAULTS = 50
"""Faults of one file that are printed; a file with more is not a mission."""

app = typer.Typer(
    name="vfguide",
    help="Vector-field guidance that flies several fixed-wing UAVs as one formation, over MAVLink.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

MissionFile = Annotated[Path, typer.Argument(metavar="MISSION", help="Mission file (YAML).")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]


@app.command()
def fly(
    mission: MissionFile,
    *,
    controller: Annotated[
        ControllerName | None, typer.Option(help="Instead of the file's controller.type.")
    ] = None,
    plant: Annotated[
        PlantName | None, typer.Option(help="Instead of every vehicle's plant.")
    ] = None,
    wind: Annotated[WindName | None, typer.Option(help="Instead of the file's wind.")] = None,
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Length of the flight, seconds.")
    ] = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Guidance steps per second.")
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of everything random.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Where summary, report, record and .tlog files go."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fly a whole formation on this computer: one emulator and one companion for each vehicle.

    In virtual time, as fast as it goes and repeatable. Exit status: 0 flown and within the mission's
    acceptance, 1 flown but not within it, 2 the input is wrong, 3 the flight broke or was stopped.
    """
    loaded = read_mission(mission)
    overrides = Overrides(
        controller=controller,
        plant=plant,
        wind=wind,
        duration_s=duration,
        rate_hz=rate,
        seed=seed,
    )
    changed = apply_overrides(loaded.mission, overrides)
    findings = check_mission(changed, loaded.source)
    for finding in findings:
        if finding.severity != "note":
            sys.stderr.write(f"{finding}\n")
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(WRONG_INPUT)
    raise typer.Exit(fly_mission(changed, out=out, as_json=as_json))


@app.command()
def check(
    mission: MissionFile,
    *,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 on warnings.")] = False,
    as_json: AsJson = False,
) -> None:
    """Find out what can be known before take-off; one line for each finding.

    Exit status: 0 ready to fly, 1 with warnings under --strict, 2 the mission cannot be flown.
    """
    loaded = read_mission(mission)
    findings = check_mission(loaded.mission, loaded.source)
    name = loaded.mission.name
    raise typer.Exit(report_findings(findings, name=name, strict=strict, as_json=as_json))


@app.command()
def report(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="What `vfguide fly --out DIR` wrote.")
    ],
) -> None:
    """Write summary, plots and page of a recorded flight again."""
    write_again(directory)


def apply_overrides(mission: Mission, overrides: Overrides) -> Mission:
    """The mission with the command line's word in it.

    Raises:
        InputError: an option is out of its range.
    """
    try:
        return overridden(mission, overrides)
    except ValidationError as error:
        lines = (f"{one.message}; {one.remedy}" for one in explain(error))
        raise InputError("\n".join(f"command line: {line}" for line in lines)) from error


def main() -> None:
    """Entry point: what a user can mend is one line for each fault, never a traceback."""
    try:
        app()
    except InputError as error:
        lines = str(error).splitlines()
        shown = lines[:SHOWN_FAULTS]
        if len(lines) > SHOWN_FAULTS:
            shown.append(f"and {len(lines) - SHOWN_FAULTS} more")
        sys.stderr.write("\n".join(shown) + "\n")
        sys.exit(WRONG_INPUT)
