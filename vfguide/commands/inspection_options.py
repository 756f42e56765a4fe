"""The options of `vfguide status`, `check` and `report`, which steer nothing."""

from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.check import findings_of, report_findings
from vfguide.commands.shared_options import AsJson, Force, LinkUrl, MissionFile, directory
from vfguide.mission import MissionError, read_mission
from vfguide.mission.feasibility import check_mission

# What the commands do is imported where they are called: a daemon on an aircraft loads none of the others.


def status(
    mission: MissionFile,
    *,
    link: LinkUrl,
    as_json: AsJson = False,
) -> None:
    """Tell how the vehicles of a mission are, as their companions say over the link.

    Exit status: 0 every companion is online, 1 some are not, 2 the input is wrong, 3 no broker.
    """
    from vfguide.commands.status import show_status

    loaded = read_mission(mission)
    raise typer.Exit(show_status(loaded.mission, link=link, as_json=as_json))


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
) -> None:
    """Write the report of a flight, rehearsed or recorded.

    Exit status: 0 written, 2 there is no readable record, or the directory cannot be written to.
    """
    from vfguide.commands.report import write_reports

    write_reports(directories, out, force=force)
