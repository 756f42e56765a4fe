"""The options of `vfguide fly`, and of `judge` and `emulate`, which fly in parts."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.check import WRONG
from vfguide.commands.overrides import (
    Overrides,
    SpeedResponseName,
    WindName,
    apply_overrides,
    parse_settings,
    with_options_named,
)
from vfguide.commands.shared_options import (
    AsJson,
    Controller,
    Duration,
    Force,
    Insecure,
    KeyFile,
    LinkUrls,
    MissionFile,
    MissionOption,
    RosterFile,
    Settings,
    Speedup,
    VehicleName,
    directory,
)
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.mission import read_mission
from vfguide.mission.feasibility import check_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.


def fly(
    mission: MissionFile,
    *,
    controller: Controller = None,
    settings: Settings = None,
    plant: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Instead of every vehicle's plant: course-hold, heading-hold, bank, npfg, six-dof, or one of"
            " --plugin.",
        ),
    ] = None,
    speed_response: Annotated[
        SpeedResponseName | None, typer.Option(help="Instead of the emulators' own.")
    ] = None,
    wind: Annotated[WindName | None, typer.Option(help="Instead of the file's wind.")] = None,
    duration: Duration = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Guidance steps per second.")
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of everything random.")] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Where summary, report, record and .tlog files go.",
            parser=directory,
        ),
    ] = None,
    force: Force = False,
    live: Annotated[
        bool, typer.Option("--live", help="Real time, real sockets, a process for each program.")
    ] = False,
    speedup: Annotated[
        float | None, typer.Option(metavar="X", help="With --live: times as fast as real time.")
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="With --live: a broker or a UDP group, or several; an embedded broker if absent.",
        ),
    ] = None,
    console: Annotated[
        bool,
        typer.Option("--console", help="With --live: show the flight on a page of a browser."),
    ] = False,
    operator: Annotated[
        bool,
        typer.Option("--operator", help="With --console: have orders given from that page, too."),
    ] = False,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|URL",
            help="With --console: a map below the formation, as of `vfguide console`.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Fly a whole formation on this computer.

    One emulator and one companion for each vehicle, in virtual time: as fast as it goes, and repeatable;
    or with --live in real time, joined by UDP and an MQTT broker.

    Exit status: 0 flown and within the mission's acceptance, 1 flown but not within it, 2 the input is
    wrong, 3 the flight broke or was stopped.
    """
    if not live:
        refuse_without_live(speedup, link, console=console)
    if operator:
        refuse_orders(speedup, console=console)
    if tiles is not None and not console:
        raise InputError("--tiles: is the map on the page that --live --console shows; add both")
    if force and out is None:
        raise InputError(
            "--force: nothing is replaced without --out; add --out DIR, or leave it out"
        )
    loaded = read_mission(mission)
    overrides = Overrides(
        controller=controller,
        settings=parse_settings(settings or ()),
        plant=plant,
        speed_response=speed_response,
        wind=wind,
        duration_s=duration,
        rate_hz=rate,
        seed=seed,
    )
    changed = apply_overrides(loaded.mission, overrides)
    if live:
        # Before anything else is said of a mission that cannot be flown so.
        from vfguide.commands.fly_live import check_live

        check_live(changed, speedup=1.0 if speedup is None else speedup)
    findings = check_mission(changed, loaded.source)
    errors = Terminal(stderr=True)
    for finding in findings:
        if finding.severity != "note":
            errors.tell(str(with_options_named(finding, overrides)))
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(WRONG)
    from vfguide.commands.fly import fly as fly_mission

    if not live:
        raise typer.Exit(fly_mission(changed, out=out, force=force, as_json=as_json))
    from vfguide.commands.fly_live import fly_live as fly_mission_live

    status = fly_mission_live(
        changed,
        links=link or (),
        speedup=1.0 if speedup is None else speedup,
        console=console,
        operator=operator,
        tiles=tiles,
        out=out,
        force=force,
        as_json=as_json,
    )
    raise typer.Exit(status)


def refuse_orders(speedup: float | None, *, console: bool) -> None:
    """See that a rehearsal has a page to give orders from, and flies by the clock of whoever gives them.

    Raises:
        InputError: it does not.
    """
    if not console:
        raise InputError("--operator: orders are given from the page that --live --console shows")
    if speedup not in {None, 1.0}:
        raise InputError("--operator: orders are timed in real time; leave --speedup out")


def refuse_without_live(
    speedup: float | None, links: Sequence[str] | None, *, console: bool
) -> None:
    """See that nothing is asked of a flight in virtual time that only a live one can do.

    Raises:
        InputError: something is.
    """
    if speedup is not None:
        raise InputError(
            f"--speedup {speedup:g}: only a live flight has a speed; add --live, or leave it out: "
            "in virtual time a flight is as fast as the computer"
        )
    if links:
        raise InputError("--link: only a live flight has a broker; add --live, or leave it out")
    if console:
        raise InputError(
            "--console: only a live flight can be watched; add --live, or show what --out wrote with"
            " `vfguide console --replay DIR`"
        )


def judge(
    mission: MissionFile,
    *,
    truth: Annotated[
        str,
        typer.Option(metavar="URL", help="Where emulators send true states: udpin://HOST:PORT."),
    ],
    link: LinkUrls,
    key: KeyFile = None,
    roster: RosterFile = None,
    insecure: Insecure = False,
    start: Annotated[Path, typer.Option(metavar="FILE", help="Written when the flight may begin.")],
    out: Annotated[
        Path,
        typer.Option(metavar="DIR", help="Where summary, report and record go.", parser=directory),
    ],
    duration: Duration = None,
    speedup: Speedup = 1.0,
    patience: Annotated[
        float, typer.Option(metavar="S", min=0.0, help="Real seconds to wait for companions.")
    ] = 60.0,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Start, watch and judge a flight whose emulators and companions another program runs.

    Waits until every companion is online, lets the emulators begin, and judges by their true states. Exit
    status: 0 flown and within the mission's acceptance, 1 flown but not within it, 2 the input is
    wrong, 3 the flight broke or was stopped.
    """
    from vfguide.commands.containers import judge_flight
    from vfguide.commands.credentials import KeyFiles

    changed = apply_overrides(read_mission(mission).mission, Overrides(duration_s=duration))
    verdict = judge_flight(
        changed,
        truth=truth,
        links=link,
        keys=KeyFiles(mission=mission, key=key, roster=roster, insecure=insecure),
        start=start,
        speedup=speedup,
        patience_s=patience,
        out=out,
        force=force,
        as_json=as_json,
    )
    raise typer.Exit(verdict)


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
) -> None:
    """Emulate one aircraft of a mission, in its place and wind, when `vfguide judge` says so.

    Exit status: as `sitl-stub`, which it becomes; 2 the input is wrong, 3 the start did not come.
    """
    from vfguide.commands.containers import emulate as emulate_vehicle

    emulate_vehicle(
        read_mission(mission).mission,
        vehicle,
        mavlink=mavlink,
        truth=truth,
        start=start,
        speedup=speedup,
    )
