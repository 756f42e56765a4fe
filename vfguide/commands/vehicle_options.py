"""The options of `vfguide companion`, `identify`, `order` and `keys`."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.logs import LogFormat
from vfguide.commands.shared_options import (
    AsJson,
    AutopilotUrl,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    MissionOption,
    RosterFile,
    VehicleName,
    directory,
    with_plugins,
)
from vfguide.mission import read_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.


StateDirectory = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Keep there whether it has engaged in this flight; else in STATE_DIRECTORY or"
        " XDG_STATE_HOME.",
        parser=directory,
    ),
]

SigningKeyFile = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Sign MAVLink, and hear only what is signed: 64 hex digits."),
]


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
    state: StateDirectory = None,
    signing_key_file: SigningKeyFile = None,
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
    ] = 1,
    speedup: Annotated[
        float, typer.Option(metavar="X", help="The emulator's time in parts of real time.")
    ] = 1.0,
    out: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Keep profile and picture there.", parser=directory),
    ] = None,
    state: StateDirectory = None,
    signing_key_file: SigningKeyFile = None,
) -> None:
    """Fly small steps of course and speed, and find how the autopilot answers.

    Prints alpha, beta, dead times, lags and slip with their intervals, as lines for the mission file, from a
    flight of two minutes. Exit status: 0 they are known well, 1 they are not or the flight ended early, and
    the last line says what was not learned; 2 the input is wrong, 3 broken.
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
        signing_key_file=signing_key_file,
        state=state,
    )
    raise typer.Exit(status)


def order(
    mission: MissionFile,
    what: Annotated[
        list[str],
        typer.Argument(
            metavar="WHAT",
            help="A shape (vee, echelon-left, echelon-right, line-abreast, trail, diamond, finger-four);"
            " spacing; swap A B; slot NAME=FORWARD,RIGHT; leave NAME; join NAME; path NAME;"
            " lead NAME; hold; resume; abort.",
        ),
    ],
    *,
    link: LinkUrls,
    spacing: Annotated[
        float | None,
        typer.Option(metavar="M", min=1.0, max=1000.0, help="Between neighbours, metres."),
    ] = None,
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="Rehearse it from the present state, and order nothing."),
    ] = False,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
) -> None:
    """Order a formation that flies to change: rehearsed first, then agreed on by all vehicles.

    Exit status: 0 flown by all (or rehearsed), 1 not flown, 2 the input is wrong or the order cannot be
    carried out, 3 no link, or the formation is not heard.
    """
    from vfguide.commands.credentials import KeyFiles
    from vfguide.commands.order import give, order_of

    wanted = order_of(what, spacing)
    loaded = read_mission(mission)
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    raise typer.Exit(give(loaded.mission, wanted, links=link, keys=keys, dry_run=dry_run))


# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.

keys = typer.Typer(
    help="Keys by which the members of a formation know each other.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@keys.command()
@with_plugins
def make(
    mission: MissionFile,
    *,
    operator: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Who watches and orders; `operator` if absent."),
    ] = None,
) -> None:
    """Make a key pair for each member that has none, and the roster of public keys.

    The roster is MISSION with the ending .roster: the same file goes to everybody. Private keys are in the
    directory with the ending .keys: each goes to its own computer alone.
    """
    from vfguide.commands.keys import make as make_keys

    make_keys(read_mission(mission).mission, mission, operator or [])


@keys.command()
@with_plugins
def show(mission: MissionFile, *, as_json: AsJson = False) -> None:
    """Tell who has which key.

    Exit status: 0 every vehicle is in the roster, 1 some are not, 2 there is none.
    """
    from vfguide.commands.keys import show as show_keys

    raise typer.Exit(show_keys(read_mission(mission).mission, mission, as_json=as_json))


@keys.command()
@with_plugins
def rotate(
    mission: MissionFile,
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME...", help="Members whose keys are replaced; all if absent."),
    ] = None,
) -> None:
    """Replace the keys of some members, or of all.

    What is signed with the old ones is refused by everybody who has the new roster.
    """
    from vfguide.commands.keys import rotate as rotate_keys

    rotate_keys(read_mission(mission).mission, mission, names or [])
