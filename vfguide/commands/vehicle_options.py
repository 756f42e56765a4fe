"""The options of `vfguide companion` and `identify`, which steer one real vehicle."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.logs import LogFormat
from vfguide.commands.shared_options import (
    AutopilotUrl,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionOption,
    RosterFile,
    VehicleName,
    directory,
)
from vfguide.mission import read_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.


def companion(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: AutopilotUrl,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    engage: Annotated[
        bool,
        typer.Option(
            "--engage", help="Put the autopilot into its guided mode by itself, once in a flight."
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Record every start in a directory below.", parser=directory
        ),
    ] = None,
    state: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Keep there whether it has engaged in this flight; else in STATE_DIRECTORY or"
            " XDG_STATE_HOME.",
            parser=directory,
        ),
    ] = None,
    signing_key_file: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Sign MAVLink, and hear only what is signed: 64 hex digits."
        ),
    ] = None,
    leader: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Where a leader without a companion is heard, instead of the mission's"
            " leader.connection.",
        ),
    ] = None,
    follow_target: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="Of the leader: send FOLLOW_TARGET there, 10 Hz, for followers without a companion.",
        ),
    ] = None,
    ground_station_orders: Annotated[
        bool,
        typer.Option(
            "--ground-station-orders",
            help="Give orders that a ground station requests by MAV_CMD_USER_1; needs an operator's key.",
        ),
    ] = False,
    operator_key: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Private key that signs those orders; else that of `operator` beside the mission.",
        ),
    ] = None,
    log_format: Annotated[
        LogFormat,
        typer.Option(
            help="How the log is written to standard error; auto: text on a terminal, else JSON lines."
        ),
    ] = LogFormat.AUTO,
    clock: Annotated[str | None, typer.Option(hidden=True)] = None,
) -> None:
    """Run the companion of one vehicle, until SIGTERM.

    It never arms, and unless --engage says so it never changes the autopilot's mode: it steers while
    the pilot has selected the guided mode. Exit status: 0 stopped cleanly, 2 the input is wrong, 3 broken.
    """
    from vfguide.commands.companion import run_companion
    from vfguide.commands.credentials import KeyFiles

    run_companion(
        read_mission(mission).mission,
        vehicle,
        mavlink=mavlink,
        links=link,
        keys=KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure),
        engage=engage,
        record=record,
        clock=clock,
        signing_key_file=signing_key_file,
        state=state,
        leader=leader,
        follow_target=follow_target,
        ground_station_orders=ground_station_orders,
        operator_key=operator_key,
        log_format=log_format,
    )


def identify(
    vehicle: VehicleName,
    *,
    mission: MissionOption,
    mavlink: AutopilotUrl,
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
        Path | None,
        typer.Option(metavar="DIR", help="Keep profile and picture there.", parser=directory),
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
