"""`vfguide fly`: the whole formation on this computer."""

import json
import os
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.check import WRONG
from vfguide.commands.options import (
    AsJson,
    Controller,
    Duration,
    Force,
    Foxglove,
    MissionFile,
    Settings,
    in_directory,
)
from vfguide.commands.output import RECORD_NAME, SUMMARY_NAME, flown_before, kept_in
from vfguide.commands.overrides import (
    Overrides,
    SpeedResponseName,
    WindName,
    apply_overrides,
    parse_settings,
    with_options_named,
)
from vfguide.commands.terminal import Terminal, flight_progress, stopped_by_signals
from vfguide.errors import InputError, VfguideError
from vfguide.extras import PLOTTING, POSIX, require
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.summary import Summary
from vfguide.lab.report.wording import summary_table
from vfguide.mission import read_mission
from vfguide.mission.feasibility import check_mission
from vfguide.mission.model import Mission

EPOCH_S = 1_767_225_600.0
"""Time 0 of a flight in virtual time, in its logs: the same seed gives the same files. 1 January 2026."""

ACCEPTED, NOT_ACCEPTED, BROKEN = 0, 1, 3


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
        Path | None, in_directory("Where summary, report, record and .tlog files go.")
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
            help="With --live: a broker or a UDP group, or several; `mqtt` starts mosquitto. Default: UDP"
            " on this computer.",
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
    foxglove: Foxglove = None,
    as_json: AsJson = False,
) -> None:
    """Fly a whole formation on this computer.

    One emulator and one companion for each vehicle, in virtual time: as fast as it goes, and repeatable;
    or with --live in real time, joined by UDP.

    Exit status: 0 flown and within the mission's acceptance, or nothing is asked for, 1 flown but not within
    it, 2 the input is wrong, 3 the flight broke or was stopped.
    """
    console = console or foxglove is not None
    if live:
        require(POSIX)
        # Here, because an aircraft's computer has no library that counts what processes take.
        from vfguide.commands.fly_live import check_live, fly_live
    else:
        page = "" if not console else "--console" if foxglove is None else "--foxglove"
        refuse_without_live(speedup, link, page)
    if operator:
        refuse_orders(speedup, console=console)
    check_page(console=console, tiles=tiles, foxglove=foxglove)
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
    speed = 1.0 if speedup is None else speedup
    if live:
        # Before anything else is said of a mission that cannot be flown so.
        check_live(changed, speedup=speed)
    findings = check_mission(changed, loaded.source)
    errors = Terminal(stderr=True)
    for finding in findings:
        if finding.severity != "note":
            errors.tell(str(with_options_named(finding, overrides)))
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(WRONG)
    if live:
        status = fly_live(
            changed,
            links=link or (),
            speedup=speed,
            console=console,
            operator=operator,
            tiles=tiles,
            foxglove=foxglove,
            out=out,
            force=force,
            as_json=as_json,
        )
    else:
        status = fly_virtually(changed, out=out, force=force, as_json=as_json)
    raise typer.Exit(status)


def check_page(*, console: bool, tiles: str | None, foxglove: int | None) -> None:
    """See that what goes with the page of a live flight has one.

    Raises:
        InputError: there is no page.
        MissingLibraryError: Foxglove cannot be served; the text says which extra brings it.
    """
    if tiles is not None and not console:
        raise InputError("--tiles: is the map on the page that --live --console shows; add both")
    if foxglove is not None:
        require("foxglove")


def refuse_orders(speedup: float | None, *, console: bool) -> None:
    """See that a rehearsal has a page to give orders from, and flies by the clock of whoever gives them.

    Raises:
        InputError: it does not.
    """
    if not console:
        raise InputError("--operator: orders are given from the page that --live --console shows")
    if speedup not in {None, 1.0}:
        raise InputError("--operator: orders are timed in real time; leave --speedup out")


def refuse_without_live(speedup: float | None, links: list[str] | None, page: str) -> None:
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
        raise InputError("--link: only a live flight has a link; add --live, or leave it out")
    if page:
        raise InputError(
            f"{page}: only a live flight can be watched; add --live, or show what --out wrote with"
            " `vfguide console --replay DIR`"
        )


def fly_virtually(mission: Mission, *, out: Path | None, force: bool, as_json: bool) -> int:
    """Fly a mission in virtual time, report, and return the exit status.

    Raises:
        InputError: the directory cannot be written to, or holds something else.
        VfguideError: the flight was stopped, and an earlier one stays.
    """
    if out is not None:
        require(*PLOTTING)
    errors = Terminal(stderr=True)
    title = f"flying {mission.name}"
    with output_of(mission, out, force=force) as directory:
        with (
            stopped_by_signals() as stop,
            flight_progress(errors, title, mission.rehearsal.duration_s) as progress,
        ):
            flight = fly_rehearsal(
                mission,
                processes=os.cpu_count() or 1,
                epoch_s=None if out is None else EPOCH_S,
                progress=progress,
                stop=stop,
            )
        return conclude(flight, directory, out=out, force=force, as_json=as_json)


def output_of(
    mission: Mission, out: Path | None, *, force: bool
) -> AbstractContextManager[Path | None]:
    """The directory to write a flight into, if it is to be kept."""
    if out is None:
        return nullcontext()
    vehicles = [mission.leader.vehicle, *mission.followers_by_name]
    return kept_in(out, mission=mission.name, vehicles=vehicles, force=force)


def conclude(
    flight: LockstepFlight, directory: Path | None, *, out: Path | None, force: bool, as_json: bool
) -> int:
    """Keep and print what a flight came to, and return the exit status.

    Args:
        flight: as flown.
        directory: to write into; None keeps nothing.
        out: where that will be moved to.
        force: whether a flight that was stopped may take the place of an earlier one.
        as_json: whether standard output is the summary alone.

    Raises:
        VfguideError: the flight was stopped, and the earlier one in `out` stays.
    """
    if flight.interrupted:
        then = "" if directory is None else "; the report is being written"
        Terminal(stderr=True).tell(
            f"stopped after {flight.record.duration_s:.1f} s of flight{then}"
        )
    record = replace(flight.record, interrupted=flight.interrupted, latency=flight.latency)
    flight = replace(flight, record=record)
    summary = summarise(record)
    if directory is not None:
        keep(flight, summary, directory)
    earlier_stays = (
        flight.interrupted and out is not None and flown_before(out) is not None and not force
    )
    show(summary, flight, directory if earlier_stays else out, as_json=as_json)
    if earlier_stays:
        raise VfguideError(f"{out}: the earlier flight stays; --force would have replaced it")
    if flight.interrupted:
        return BROKEN
    return NOT_ACCEPTED if summary.accepted is False else ACCEPTED


def keep(flight: LockstepFlight, summary: Summary, out: Path) -> None:
    """Write everything about a flight into its directory."""
    # Here, because it brings the plotting library: a daemon on an aircraft has no use for 30 MB of it.
    from vfguide.lab.report.page import write_report

    flight.record.save(out / RECORD_NAME)
    for name, log in flight.logs.items():
        log.write(out / f"{name}.tlog")
    text = json.dumps(summary_json(summary), indent=2)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
    write_report(flight.record, out)


def show(summary: Summary, flight: LockstepFlight, out: Path | None, *, as_json: bool) -> None:
    """Print the summary: JSON alone, or a table with what the companions had to say."""
    output = Terminal()
    if as_json:
        output.tell(json.dumps(summary_json(summary), indent=2))
        return
    for name, events in flight.events.items():
        for event in events:
            if event.warning:
                output.tell(f"{event.time_s:7.2f} s  {name}: {event.text}")
    output.print(summary_table(summary))
    if out is not None:
        output.tell(f"report: {out / 'report.html'}")
