"""The options of `vfguide status`, `console`, `report`, `analyse`: they steer nothing."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.shared_options import (
    AsJson,
    Force,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    RosterFile,
    directory,
)
from vfguide.errors import InputError
from vfguide.mission import read_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.


def status(
    mission: MissionFile,
    *,
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    as_json: AsJson = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Again and again, once a second, until Ctrl-C.")
    ] = False,
) -> None:
    """Tell how the vehicles of a mission are, and whether they are ready: one line, go or no-go.

    Exit status: 0 every companion is online, 1 some are not, 2 the input is wrong, 3 no broker.
    """
    from vfguide.commands.credentials import KeyFiles
    from vfguide.commands.status import show_status

    loaded = read_mission(mission)
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    raise typer.Exit(
        show_status(loaded.mission, links=link, keys=keys, as_json=as_json, watch=watch)
    )


def console(
    mission: Annotated[
        Path | None,
        typer.Argument(
            metavar="MISSION", help="Mission file (YAML), or the name of one that comes along."
        ),
    ] = None,
    *,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="The formation's link, such as mqtt://host:1883; several are used at once.",
        ),
    ] = None,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    replay: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="DIR",
            help="Show a recorded flight instead: what `fly --out` wrote or companions recorded.",
            parser=directory,
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option(metavar="HOST", help="Interface to serve on; others than loopback need TLS."),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(metavar="PORT", min=0, max=65535, help="To serve on; 0 for any free one.")
    ] = 8080,
    certificate: Annotated[Path | None, typer.Option(metavar="FILE", help="For TLS, PEM.")] = None,
    certificate_key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Private key of the certificate, PEM.")
    ] = None,
    published: Annotated[
        str | None,
        typer.Option(
            metavar="URL",
            help="In a container: the loopback address of the host at which its port is published.",
        ),
    ] = None,
    token: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Keeps the token of the page's address, so that open pages outlive a restart.",
        ),
    ] = None,
    operator: Annotated[
        bool,
        typer.Option(
            "--operator",
            help="Have orders given, too, from a second address: signed with the operator's private key.",
        ),
    ] = False,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|URL",
            help="A map below the formation: an MBTiles file of pictures, or https://host/{z}/{x}/{y}.png.",
        ),
    ] = None,
) -> None:
    """Show a formation on a page of a browser: who is where, how well, and what to do.

    It only looks on, unless --operator is given. Ctrl-C ends it. Exit status: 0 ended, 2 the input is wrong.
    """
    from vfguide.extras import CONSOLE, require

    require(*CONSOLE)
    from vfguide.commands.console import show_formation, show_recorded
    from vfguide.commands.credentials import KeyFiles
    from vfguide.lab.console.server import ConsoleAddress
    from vfguide.lab.console.tiles import open_tiles

    below = None if tiles is None else open_tiles(tiles)
    address = ConsoleAddress(
        host=host,
        port=port,
        certificate=certificate,
        certificate_key=certificate_key,
        published=published,
    )
    if replay:
        if mission is not None or link:
            raise InputError("--replay: shows a recorded flight; leave MISSION and --link out")
        if operator:
            raise InputError("--operator: a recorded flight takes no orders; leave it out")
        show_recorded(replay, address=address, token_file=token, tiles=below)
        return
    if mission is None or not link:
        raise InputError(
            "give MISSION and --link URL to show a formation, or --replay DIR to show a flight"
        )
    keys = KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure)
    show_formation(
        read_mission(mission).mission,
        links=link,
        keys=keys,
        address=address,
        token_file=token,
        operator=operator,
        tiles=below,
    )


def report(
    directories: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="What `vfguide fly --out DIR` wrote, or what companions recorded: the directory "
            "above their recordings, or several of them.",
            parser=directory,
        ),
    ],
    *,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where the report goes, if not into the one DIR.",
            parser=directory,
        ),
    ] = None,
    force: Force = False,
    animate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a moving picture of the flight instead: a .gif, .webp or .png.",
        ),
    ] = None,
    begin_s: Annotated[
        float | None,
        typer.Option(
            "--from", metavar="S", help="Where the moving picture begins, s of the flight."
        ),
    ] = None,
    end_s: Annotated[
        float | None,
        typer.Option(
            "--to",
            metavar="S",
            help="Where it ends; without it once all have settled in their slots.",
        ),
    ] = None,
) -> None:
    """Write the report of a flight, rehearsed or recorded.

    Exit status: 0 written, 2 there is no readable record, or the directory cannot be written to.
    """
    from vfguide.commands.report import animate_flight, write_reports

    if animate is not None:
        if out is not None:
            raise InputError(
                "--out is the report's; --animate names the file of the moving picture itself"
            )
        animate_flight(directories, animate, begin_s=begin_s, end_s=end_s, force=force)
    elif begin_s is not None or end_s is not None:
        raise InputError("--from and --to are of a moving picture; give --animate FILE, too")
    else:
        write_reports(directories, out, force=force)


def analyse(
    mission: MissionFile,
    logs: Annotated[
        list[Path],
        typer.Argument(
            metavar="LOG...",
            help="ArduPilot's .BIN, PX4's .ulg or a .tlog, one for each vehicle; their system ids say whose.",
        ),
    ],
    *,
    out: Annotated[
        Path, typer.Option(metavar="DIR", help="Where record and report go.", parser=directory)
    ],
    force: Force = False,
) -> None:
    """Write the report of a flight from the logs that its autopilots wrote.

    Exit status: 0 written, 2 a log cannot be read, they do not fit together, or the directory cannot be
    written to.
    """
    from vfguide.commands.report import analyse_logs

    analyse_logs(read_mission(mission).mission, logs, out, force=force)
