"""`vfguide report`: a flight's report from its record or its companions' recordings."""

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from vfguide.commands.options import Force, directory_of, in_directory
from vfguide.commands.output import (
    LONGEST_SUMMARY,
    PAGE_NAME,
    PARTIAL,
    RECORD_NAME,
    REPORT_NAMES,
    SUMMARY_NAME,
    refuse_file,
    refuse_foreign,
    whole_file,
    written_beside,
)
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.lab.report.metrics import summarise, summary_json
from vfguide.lab.report.wording import summary_table
from vfguide.record.archive import WRITE_REMEDY
from vfguide.record.flight import FlightRecord
from vfguide.record.recording import find_recordings
from vfguide.regular_file import open_regular


def report(
    directories: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="What `vfguide fly --out DIR` wrote, or what companions recorded: the directory "
            "above their recordings, or several of them.",
            parser=directory_of,
        ),
    ],
    *,
    out: Annotated[
        Path | None, in_directory("Where the report goes, if not into the one DIR.")
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
            help="Where it ends, s of the flight; default: once all have settled in their slots.",
        ),
    ] = None,
) -> None:
    """Write the report of a flight, rehearsed or recorded.

    Exit status: 0 written, 2 there is no readable record, or the directory cannot be written to.
    """
    if animate is not None:
        if out is not None:
            raise InputError(
                "--out is the report's; --animate names the file of the moving picture itself"
            )
        animate_flight(directories, animate, begin_s=begin_s, end_s=end_s, force=force)
        return
    if begin_s is not None or end_s is not None:
        raise InputError("--from and --to are of a moving picture; give --animate FILE, too")
    record = read_flight(directories)
    if out is None and len(directories) > 1:
        raise InputError("say with --out where the report of several directories goes")
    where = directories[0] if out is None else out
    # A report beside a rehearsal's record belongs to that rehearsal, even without a summary.
    if out is not None or not (where / RECORD_NAME).exists():
        refuse_foreign(where, record.mission, REPORT_NAMES, force=force)
    elif where.is_symlink():
        raise InputError(f"{where}: is a symbolic link; give the directory that it leads to")
    write_report_of(record, where)


def animate_flight(
    directories: Sequence[Path],
    file: Path,
    *,
    begin_s: float | None,
    end_s: float | None,
    force: bool,
) -> None:
    """Write a moving picture of a flight from `begin_s` to `end_s`; `force` replaces an existing file.

    Raises:
        InputError: there is no flight, nothing to show, or the file cannot be written.
    """
    # Imported here, since it brings the plotting library, which few commands need.
    from vfguide.lab.report.animation import format_of, write_animation

    format_of(file)
    refuse_file(file, force=force)
    record = read_flight(directories)
    with whole_file(file) as partial:
        span = write_animation(record, partial, begin_s=begin_s, end_s=end_s)
    Terminal().tell(f"{file}: {span.begin_s:g} to {span.end_s:g} s of the flight")


def read_flight(directories: Sequence[Path]) -> FlightRecord:
    """Read the flight in some directories.

    Raises:
        InputError: there is none, or a damaged one.
    """
    for directory in directories:
        if directory.is_file():
            raise InputError(f"{directory}: is a file; give its directory, {directory.parent}")
        if not directory.is_dir():
            raise InputError(
                f"{directory}: no such directory; give one that `vfguide fly --out` wrote, "
                "or companions recorded into"
            )
    first = directories[0]
    if len(directories) == 1 and (first / RECORD_NAME).exists():
        record = FlightRecord.load(first / RECORD_NAME)
        return replace(record, wall_s=recorded_wall_s(first / SUMMARY_NAME))
    for rehearsal in directories:
        if (rehearsal / RECORD_NAME).exists():
            raise InputError(
                f"{rehearsal}: is a rehearsal, and the report is of one at a time; give it alone"
            )
    if not find_recordings(directories):
        for left in sorted(first.glob(f"{PARTIAL}*")):
            if find_recordings([left]):
                raise InputError(
                    f"{first}: holds no flight that ended; give {left}, where companions recorded"
                )
        raise InputError(
            f"{first}: holds neither {RECORD_NAME} nor recordings; give a directory that "
            "`vfguide fly --out` wrote, or companions recorded into"
        )
    from vfguide.lab.debrief.flight import collect, flight_of

    return flight_of(collect(directories))


def write_report_of(record: FlightRecord, where: Path) -> None:
    """Write summary and report into a directory, made if need be, and print the summary.

    Raises:
        InputError: it cannot be written to.
    """
    # Imported here, since it brings the plotting library, which few commands need.
    from vfguide.lab.report.page import write_report

    summary = summarise(record)
    text = json.dumps(summary_json(summary), indent=2)
    try:
        where.mkdir(parents=True, exist_ok=True)
        with written_beside(where) as partial:
            (partial / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
            write_report(record, partial)
    except OSError as error:
        if isinstance(error, FileExistsError | NotADirectoryError):
            raise InputError(f"{where}: is a file; give a directory with --out") from error
        raise InputError(
            f"{where}: cannot be written to ({error.strerror}); {WRITE_REMEDY}"
        ) from error
    output = Terminal()
    output.print(summary_table(summary))
    for note in record.notes:
        output.tell(note)
    output.tell(f"report: {where / PAGE_NAME}")


def recorded_wall_s(path: Path) -> float | None:
    """Return the real time that the flight took, s, from its first summary; the record does not hold it."""
    try:
        with open_regular(path) as file:
            wall_s = float(json.loads(file.read(LONGEST_SUMMARY))["wall_s"])
    # The file is about to be replaced, so a damaged one does not matter.
    except (OSError, ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    return wall_s if math.isfinite(wall_s) and wall_s > 0.0 else None
