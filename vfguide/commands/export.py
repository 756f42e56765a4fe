"""`vfguide export`: a flight as a file for other tools."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vfguide.commands.options import Force, directory_of
from vfguide.commands.output import refuse_file, whole_file
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError, missing_library
from vfguide.mission import read_mission

if TYPE_CHECKING:
    from vfguide.record.flight import FlightRecord

ENDINGS = (".mcap", ".kml", ".kmz", ".csv", ".parquet", ".plan")

Write = Callable[["FlightRecord", Path], None]


def export(
    directories: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR...",
            help="What `vfguide fly --out DIR` wrote, or what companions recorded.",
            parser=directory_of,
        ),
    ],
    *,
    out: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="File to write; its ending is the format: .mcap, .kml, .kmz, .csv, .parquet or .plan.",
        ),
    ],
    mission: Annotated[
        Path | None,
        typer.Option(
            metavar="MISSION",
            help="Mission of a record from an earlier version, which does not say where it was flown.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Write a flight for other tools: Foxglove, Google Earth, spreadsheets, pandas.

    Exit status: 0 written, 2 there is no readable record, or the file cannot be written.
    """
    from vfguide.commands.report import read_flight
    from vfguide.record.flight import RecordOrigin

    flown = None if mission is None else read_mission(mission).mission
    write = writer_for(out)
    refuse_file(out, force=force)
    record = read_flight(directories)
    if record.time_s.size == 0:
        raise InputError(f"{directories[0]}: the flight broke at once: there is nothing to export")
    if record.origin is None and flown is not None:
        if flown.name != record.mission:
            raise InputError(
                f"the flight is of the mission {record.mission!r}, not {flown.name!r}; "
                "name its own with --mission"
            )
        record = replace(record, origin=RecordOrigin(**flown.origin.model_dump()))
    with whole_file(out) as unfinished:
        write(record, unfinished)
    Terminal().tell(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


def writer_for(out: Path) -> Write:
    """Return the function that writes a file with this ending.

    Raises:
        InputError: the ending is unknown, or its library is not installed.
    """
    # Imported where needed, since each brings a library of its own.
    try:
        match out.suffix.lower():
            case ".mcap":
                from vfguide.lab.export.foxglove import write_mcap

                return write_mcap
            case ".csv":
                from vfguide.lab.export.columns import write_csv

                return write_csv
            case ".parquet":
                from vfguide.lab.export.columns import write_parquet

                return write_parquet
            case ".plan":
                from vfguide.lab.export.earth import write_plan

                return write_plan
            case ".kml" | ".kmz" as ending:
                from vfguide.lab.export.earth import write_earth

                return partial(write_earth, compressed=ending == ".kmz")
    except ImportError as error:
        if (remedy := missing_library(error)) is None:
            raise
        raise InputError(f"{out}: {remedy}, or write a .csv") from error
    raise InputError(f"{out}: ends in none of {', '.join(ENDINGS)}; the ending is the format")
