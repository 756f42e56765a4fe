"""`vfguide export`: a flight as a file for other tools."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from vfguide.commands.output import refuse_file, whole_file
from vfguide.commands.report import read_flight
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.extras import missing_library
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord, Origin

ENDINGS = (".mcap", ".kml", ".kmz", ".csv", ".parquet", ".plan")

Write = Callable[[FlightRecord, Path], None]


def export_flight(
    directories: Sequence[Path], out: Path, *, mission: Mission | None, force: bool
) -> None:
    """Write the flight that some directories hold in the format that the file's name asks for.

    Args:
        directories: as of a report.
        out: where to.
        mission: says where on the earth the flight was, if its record does not.
        force: whether a file that is there may be replaced.

    Raises:
        InputError: there is no flight in them, the ending is unknown, or the file cannot be written.
    """
    write = writer_for(out)
    refuse_file(out, force=force)
    record = read_flight(directories)
    if record.time_s.size == 0:
        raise InputError(f"{directories[0]}: the flight broke at once: there is nothing to export")
    if record.origin is None and mission is not None:
        if mission.name != record.mission:
            raise InputError(
                f"the flight is of the mission {record.mission!r}, not {mission.name!r}; "
                "name its own with --mission"
            )
        record = replace(record, origin=Origin(**mission.origin.model_dump()))
    with whole_file(out) as unfinished:
        write(record, unfinished)
    Terminal().tell(f"{out}: {out.stat().st_size / 1e6:.1f} MB")


def writer_for(out: Path) -> Write:
    """What writes a file of this name.

    Raises:
        InputError: nothing does, or its library is not installed.
    """
    # Each where it is needed, for each brings a library of its own.
    try:
        match out.suffix.lower():
            case ".mcap":
                from vfguide.lab.export.foxglove import write_mcap

                return write_mcap
            case ".csv":
                from vfguide.lab.export.comma_separated import write_csv

                return write_csv
            case ".parquet":
                from vfguide.lab.export.parquet import write_parquet

                return write_parquet
            case ".plan":
                from vfguide.lab.export.plan import write_plan

                return write_plan
            case ".kml" | ".kmz" as ending:
                from vfguide.lab.export.earth import write_earth

                return partial(write_earth, compressed=ending == ".kmz")
    except ImportError as error:
        if (remedy := missing_library(error)) is None:
            raise
        raise InputError(f"{out}: {remedy}, or write a .csv") from error
    raise InputError(f"{out}: ends in none of {', '.join(ENDINGS)}; the ending is the format")
