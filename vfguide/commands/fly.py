"""`vfguide fly`: the whole formation on this computer."""

import json
import os
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
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
from vfguide.commands.terminal import Terminal, flight_progress, stopped_by_signals
from vfguide.errors import PLOTTING, POSIX, InputError, VfguideError, require
from vfguide.lab.rehearsal.lockstep import LockstepFlight
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.metrics import Summary, summarise, summary_json
from vfguide.lab.report.wording import summary_table
from vfguide.mission import read_mission
from vfguide.mission.feasibility import check_mission
from vfguide.mission.model import Mission
from vfguide.mission.overrides import Overrides, SpeedResponseName, WindName, parse_settings

EPOCH_S = 1_767_225_600.0
"""Unix time 0 of a virtual flight in its logs, 1 January 2026: the same seed gives the same files."""

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
            help="Plant of every vehicle instead of its own: course-hold, heading-hold, bank, npfg, six-dof,"
            " or one of --plugin.",
        ),
    ] = None,
    speed_response: Annotated[
        SpeedResponseName | None,
        typer.Option(help="Speed hold of every vehicle instead of its own."),
    ] = None,
    wind: Annotated[WindName | None, typer.Option(help="Wind instead of the file's.")] = None,
    duration: Duration = None,
    rate: Annotated[
        float | None, typer.Option(metavar="HZ", help="Guidance steps per second.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(metavar="N", help="Seed of everything random.")
    ] = None,
    out: Annotated[
        Path | None, in_directory("Where summary, report, record and .tlog files go.")
    ] = None,
    force: Force = False,
    live: Annotated[
        bool,
        typer.Option(
            "--live", help="Fly in real time, over real sockets, with a process for each program."
        ),
    ] = False,
    speedup: Annotated[
        float | None,
        typer.Option(metavar="X", help="With --live: simulated seconds per real second."),
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="URL",
            help="With --live: address of the formation's link, may be given several times; `mqtt` starts"
            " mosquitto. Default: UDP on this computer.",
        ),
    ] = None,
    console: Annotated[
        bool, typer.Option("--console", help="With --live: show the flight on a page of a browser.")
    ] = False,
    operator: Annotated[
        bool, typer.Option("--operator", help="With --console: let orders be given from that page.")
    ] = False,
    tiles: Annotated[
        str | None,
        typer.Option(
            metavar="FILE|URL",
            help="With --console: map below the formation, as for `vfguide console`.",
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
    check_options(
        live=live,
        speedup=speedup,
        links=link,
        console=console,
        operator=operator,
        tiles=tiles,
        foxglove=foxglove,
        for_nothing=force and out is None,
    )
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
    loaded = read_mission(mission, overrides)
    changed = loaded.mission
    speed = 1.0 if speedup is None else speedup
    if live:
        # Imported here, since an aircraft's computer lacks the library that measures processes.
        from vfguide.commands.fly_live import check_live, fly_live, live_page

        # First of all checks, since a mission that cannot fly live needs no other findings.
        check_live(changed, speedup=speed)
    findings = check_mission(changed, loaded.source)
    errors = Terminal(stderr=True)
    for finding in findings:
        if finding.severity != "note":
            errors.tell(str(finding))
    if any(finding.severity == "error" for finding in findings):
        raise typer.Exit(WRONG)
    kept = KeptFlight(out=out, force=force, as_json=as_json)
    if live:
        page = live_page(operator=operator, tiles=tiles, foxglove=foxglove) if console else None
        status = fly_live(changed, links=link or (), speedup=speed, kept=kept, page=page)
    else:
        status = fly_virtually(changed, kept)
    raise typer.Exit(status)


def check_options(
    *,
    live: bool,
    speedup: float | None,
    links: list[str] | None,
    console: bool,
    operator: bool,
    tiles: str | None,
    foxglove: int | None,
    for_nothing: bool,
) -> None:
    """Check that options go together, and that the libraries they need are installed.

    Raises:
        InputError: the options do not go together.
        MissingLibraryError: a library is not installed; the text says which extra brings it.
    """
    if live:
        require(POSIX)
    page = "--console" if foxglove is None else "--foxglove"
    refused = {
        f"--speedup {speedup or 0.0:g}: only a live flight has a speed; add --live, or leave it out: in"
        " virtual time a flight is as fast as the computer": speedup is not None and not live,
        "--link: only a live flight has a link; add --live, or leave it out": links and not live,
        f"{page}: only a live flight can be watched; add --live, or show what --out wrote with"
        " `vfguide console --replay DIR`": console and not live,
        "--operator: orders are given from the page that --live --console shows": operator
        and not console,
        "--operator: orders are timed in real time; leave --speedup out": operator
        and speedup not in {None, 1.0},
        "--tiles: is the map on the page that --live --console shows; add both": tiles is not None
        and not console,
        "--force: nothing is replaced without --out; add --out DIR, or leave it out": for_nothing,
    }
    for text, wrong in refused.items():
        if wrong:
            raise InputError(text)
    if foxglove is not None:
        require("foxglove")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptFlight:
    """Output of a flight: its directory and the form of its summary."""

    out: Path | None
    """Directory; None keeps nothing."""
    force: bool
    """Whether existing files may be replaced, even by a flight that was stopped."""
    as_json: bool
    """Whether standard output is the summary alone."""

    def directory(self, mission: Mission) -> AbstractContextManager[Path | None]:
        """Return a context with the directory to write a flight into, or None if it is not kept.

        Raises:
            InputError: on entering, it cannot be written to, or holds something else.
        """
        if self.out is None:
            return nullcontext()
        vehicles = [mission.leader.vehicle, *mission.followers_by_name]
        return kept_in(self.out, mission=mission.name, vehicles=vehicles, force=self.force)

    def conclude(self, flight: LockstepFlight, directory: Path | None) -> int:
        """Keep and print the results of a flight, and return the exit status.

        Raises:
            VfguideError: the flight was stopped, and the earlier one in `out` stays.
        """
        out = self.out
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
        stays = flight.interrupted and out is not None and not self.force
        earlier_stays = stays and out is not None and flown_before(out) is not None
        show(summary, flight, directory if earlier_stays else out, as_json=self.as_json)
        if earlier_stays:
            raise VfguideError(f"{out}: the earlier flight stays; --force would have replaced it")
        if flight.interrupted:
            return BROKEN
        return NOT_ACCEPTED if summary.accepted is False else ACCEPTED


def fly_virtually(mission: Mission, kept: KeptFlight) -> int:
    """Fly a mission in virtual time, report, and return the exit status.

    Raises:
        InputError: the directory cannot be written to, or holds something else.
        VfguideError: the flight was stopped, and an earlier one stays.
    """
    if kept.out is not None:
        require(*PLOTTING)
    with kept.directory(mission) as directory:
        with (
            stopped_by_signals() as stop,
            flight_progress(f"flying {mission.name}", mission.rehearsal.duration_s) as progress,
        ):
            flight = fly_rehearsal(
                mission,
                processes=os.cpu_count() or 1,
                epoch_s=None if directory is None else EPOCH_S,
                progress=progress,
                stop=stop,
            )
        return kept.conclude(flight, directory)


def keep(flight: LockstepFlight, summary: Summary, out: Path) -> None:
    """Write record, logs, summary and report of a flight into its directory."""
    # Imported here, since it brings the plotting library: a daemon on an aircraft has no use for its 30 MB.
    from vfguide.lab.report.page import write_report

    flight.record.save(out / RECORD_NAME)
    for name, log in flight.logs.items():
        log.write(out / f"{name}.tlog")
    text = json.dumps(summary_json(summary), indent=2)
    (out / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
    write_report(flight.record, out)


def show(summary: Summary, flight: LockstepFlight, out: Path | None, *, as_json: bool) -> None:
    """Print the summary: JSON alone, or a table with the companions' warnings."""
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
