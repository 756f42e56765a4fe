"""The command line: options in, exit status out."""

import sys
import traceback
from contextlib import suppress
from importlib.metadata import version as version_of
from pathlib import Path
from typing import Annotated

import typer
from pydantic import ValidationError

from vfguide.commands.bench_options import bench
from vfguide.commands.check import findings_of, report_findings
from vfguide.commands.overrides import (
    ControllerName,
    Overrides,
    PlantName,
    SpeedResponseName,
    WindName,
    overridden,
)
from vfguide.commands.terminal import Terminal, discard, escape_what_cannot_be_encoded
from vfguide.errors import InputError, VfguideError
from vfguide.mission import Mission, MissionError, read_mission
from vfguide.mission.explain import explain
from vfguide.mission.feasibility import check_mission
from vfguide.mission.location import Location

# Commands are imported where they are called: a daemon on an aircraft loads none of the others.

WRONG_INPUT, BROKEN = 2, 3

SHOWN_FAULTS = 50
"""Faults of one file that are printed; a file with more is not a mission."""

OPTIONS: dict[Location, str] = {
    ("rehearsal", "duration_s"): "--duration",
    ("rehearsal", "rate_hz"): "--rate",
    ("rehearsal", "seed"): "--seed",
}
"""Fields that an option overrides, and that may be out of range."""

app = typer.Typer(
    name="vfguide",
    help="Vector-field guidance that flies several fixed-wing UAVs as one formation, over MAVLink.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.add_typer(bench, name="bench")

MissionFile = Annotated[Path, typer.Argument(metavar="MISSION", help="Mission file (YAML).")]
Speedup = Annotated[
    float, typer.Option(metavar="X", min=0.01, max=100.0, help="Times as fast as real time.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON on standard output.")]


def tell_version(wanted: bool) -> None:
    """Print the version and end.

    Raises:
        typer.Exit: if it was asked for.
    """
    if wanted:
        Terminal().tell(f"vfguide {version_of('vfguide')}")
        raise typer.Exit


@app.callback()
def program(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=tell_version, is_eager=True, help="Tell the version."),
    ] = False,
) -> None:
    """Vector-field guidance that flies several fixed-wing UAVs as one formation, over MAVLink."""
    del version


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
    speed_response: Annotated[
        SpeedResponseName | None, typer.Option(help="Instead of the emulators' own.")
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
    live: Annotated[
        bool, typer.Option("--live", help="Real time, real sockets, a process for each program.")
    ] = False,
    speedup: Annotated[
        float, typer.Option(metavar="X", help="With --live: times as fast as real time.")
    ] = 1.0,
    link: Annotated[
        str | None,
        typer.Option(metavar="URL", help="With --live: a broker; an embedded one if absent."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fly a whole formation on this computer.

    One emulator and one companion for each vehicle, in virtual time: as fast as it goes, and repeatable;
    or with --live in real time, joined by UDP and an MQTT broker.

    Exit status: 0 flown and within the mission's acceptance, 1 flown but not within it, 2 the input is
    wrong, 3 the flight broke or was stopped.
    """
    loaded = read_mission(mission)
    overrides = Overrides(
        controller=controller,
        plant=plant,
        speed_response=speed_response,
        wind=wind,
        duration_s=duration,
        rate_hz=rate,
        seed=seed,
    )
    changed = apply_overrides(loaded.mission, overrides)
    findings = check_mission(changed, loaded.source)
    errors = Terminal(stderr=True)
    for finding in findings:
        if finding.severity != "note":
            errors.tell(str(finding))
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(WRONG_INPUT)
    from vfguide.commands.fly import fly as fly_mission

    if not live:
        raise typer.Exit(fly_mission(changed, out=out, as_json=as_json))
    from vfguide.commands.fly_live import fly_live as fly_mission_live

    status = fly_mission_live(changed, link=link, speedup=speedup, out=out, as_json=as_json)
    raise typer.Exit(status)


@app.command()
def companion(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Its name in the mission.")],
    *,
    mission: Annotated[Path, typer.Option(metavar="MISSION", help="Mission file (YAML).")],
    mavlink: Annotated[
        str, typer.Option(metavar="URL", help="Its autopilot, such as udpin://0.0.0.0:14540.")
    ],
    link: Annotated[
        str, typer.Option(metavar="URL", help="The formation's link, such as mqtt://host:1883.")
    ],
    engage: Annotated[
        bool,
        typer.Option(
            "--engage", help="Put the autopilot into its guided mode, the first time, by itself."
        ),
    ] = False,
    record: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep the vehicle's .tlog there.")
    ] = None,
    signing_key_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Sign MAVLink, and hear only what is signed: 64 hex digits."
        ),
    ] = None,
    clock: Annotated[str | None, typer.Option(hidden=True)] = None,
) -> None:
    """Run the companion of one vehicle, until SIGTERM.

    It never arms, and unless --engage says so it never changes the autopilot's mode: it steers while
    the pilot has selected the guided mode. Exit status: 0 stopped cleanly, 2 the input is wrong, 3 broken.
    """
    from vfguide.commands.companion import run_companion

    run_companion(
        read_mission(mission).mission,
        vehicle,
        mavlink=mavlink,
        link=link,
        engage=engage,
        record=record,
        clock=clock,
        signing_key_file=signing_key_file,
    )


@app.command()
def identify(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Its name in the mission.")],
    *,
    mission: Annotated[Path, typer.Option(metavar="MISSION", help="Mission file (YAML).")],
    mavlink: Annotated[
        str, typer.Option(metavar="URL", help="Its autopilot, such as udpin://0.0.0.0:14540.")
    ],
    engage: Annotated[
        bool, typer.Option("--engage", help="Put the autopilot into its guided mode, by itself.")
    ] = False,
    repeats: Annotated[
        int, typer.Option(min=1, max=10, help="How often each group of steps is flown.")
    ] = 2,
    speedup: Annotated[
        float, typer.Option(metavar="X", help="The emulator's time in parts of real time.")
    ] = 1.0,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Keep profile and picture there.")
    ] = None,
) -> None:
    """Fly small steps of course and speed, and find how the autopilot answers.

    Prints alpha, beta, dead times and lags with their intervals, as lines for the mission file. Exit status:
    0 they are known well, 1 they are not or the flight ended early, 2 the input is wrong, 3 broken.
    """
    from vfguide.commands.identify import identify as identify_vehicle

    status = identify_vehicle(
        read_mission(mission).mission,
        vehicle,
        mavlink=mavlink,
        engage=engage,
        repeats=repeats,
        speedup=speedup,
        out=out,
    )
    raise typer.Exit(status)


@app.command()
def judge(
    mission: MissionFile,
    *,
    truth: Annotated[
        str,
        typer.Option(metavar="URL", help="Where emulators send true states: udpin://HOST:PORT."),
    ],
    link: Annotated[
        str, typer.Option(metavar="URL", help="The formation's link, such as mqtt://host:1883.")
    ],
    start: Annotated[Path, typer.Option(metavar="FILE", help="Written when the flight may begin.")],
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where summary, report and record go.")],
    duration: Annotated[
        float | None, typer.Option(metavar="S", help="Length of the flight, seconds.")
    ] = None,
    speedup: Speedup = 1.0,
    patience: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Real seconds to wait for companions.")
    ] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Start, watch and judge a flight whose emulators and companions somebody else runs.

    Waits until every companion is online, lets the emulators begin, and judges by their true states. Exit
    status: 0 flown and within the mission's acceptance, 1 flown but not within it, 2 the input is
    wrong, 3 the flight broke or was stopped.
    """
    from vfguide.commands.judge import judge_flight

    changed = apply_overrides(read_mission(mission).mission, Overrides(duration_s=duration))
    verdict = judge_flight(
        changed,
        truth=truth,
        link=link,
        start=start,
        speedup=speedup,
        patience_s=patience,
        out=out,
        as_json=as_json,
    )
    raise typer.Exit(verdict)


@app.command()
def emulate(
    vehicle: Annotated[str, typer.Argument(metavar="VEHICLE", help="Its name in the mission.")],
    *,
    mission: Annotated[Path, typer.Option(metavar="MISSION", help="Mission file (YAML).")],
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
) -> None:
    """Emulate one aircraft of a mission, in its place and wind, when `vfguide judge` says so.

    Exit status: as `sitl-stub`, which it becomes; 2 the input is wrong, 3 the start did not come.
    """
    from vfguide.commands.emulate import emulate as emulate_vehicle

    emulate_vehicle(
        read_mission(mission).mission,
        vehicle,
        mavlink=mavlink,
        truth=truth,
        start=start,
        speedup=speedup,
    )


@app.command()
def status(
    mission: MissionFile,
    *,
    link: Annotated[
        str, typer.Option(metavar="URL", help="The formation's link, such as mqtt://host:1883.")
    ],
    as_json: AsJson = False,
) -> None:
    """Tell how the vehicles of a mission are, as their companions say over the link.

    Exit status: 0 every companion is online, 1 some are not, 2 the input is wrong, 3 no broker.
    """
    from vfguide.commands.status import show_status

    loaded = read_mission(mission)
    raise typer.Exit(show_status(loaded.mission, link=link, as_json=as_json))


@app.command()
def check(
    mission: MissionFile,
    *,
    strict: Annotated[bool, typer.Option("--strict", help="Exit with 1 on warnings.")] = False,
    as_json: AsJson = False,
) -> None:
    """Find out what can be known before take-off.

    One line for each finding. Exit status: 0 ready to fly, 1 with warnings under --strict, 2 the mission
    cannot be flown.
    """
    try:
        loaded = read_mission(mission)
    except MissionError as error:
        if not as_json:
            raise
        found = findings_of(error.faults)
        raise typer.Exit(report_findings(found, name=None, strict=strict, as_json=True)) from error
    findings = check_mission(loaded.mission, loaded.source)
    name = loaded.mission.name
    raise typer.Exit(report_findings(findings, name=name, strict=strict, as_json=as_json))


@app.command()
def report(
    directory: Annotated[
        Path, typer.Argument(metavar="DIR", help="What `vfguide fly --out DIR` wrote.")
    ],
) -> None:
    """Write summary, plots and page of a recorded flight again.

    Exit status: 0 written, 2 there is no readable record, or the directory cannot be written to.
    """
    from vfguide.commands.report import write_again

    write_again(directory)


def apply_overrides(mission: Mission, overrides: Overrides) -> Mission:
    """The mission with the command line's word in it.

    Raises:
        InputError: an option is out of its range.
    """
    try:
        return overridden(mission, overrides)
    except ValidationError as error:
        lines = (
            f"{OPTIONS.get(one.location, 'command line')}: {one.message}; {one.remedy}"
            for one in explain(error)
        )
        raise InputError("\n".join(lines)) from error


def main() -> None:
    """Entry point: what a user can mend is one line for each fault, never a traceback."""
    escape_what_cannot_be_encoded()
    try:
        app(prog_name="vfguide")
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
        # Status 1 would say that the flight was flown.
        traceback.print_exc()
        raise SystemExit(BROKEN) from error


def complain(text: str) -> None:
    """Print what is wrong, but not a thousand lines of it."""
    errors = Terminal(stderr=True)
    lines = text.splitlines()
    if len(lines) > SHOWN_FAULTS:
        lines[SHOWN_FAULTS:] = [f"and {len(lines) - SHOWN_FAULTS} more"]
    # Where even this cannot be written, the exit status has to do.
    with suppress(OSError):
        errors.tell("\n".join(lines))
