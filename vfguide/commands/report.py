"""`vfguide report`: the report of a flight that was recorded before."""

import json
import math
from dataclasses import replace
from pathlib import Path

from vfguide.commands.fly import RECORD_NAME, SUMMARY_NAME
from vfguide.commands.terminal import Terminal
from vfguide.errors import InputError
from vfguide.record.flight import FlightRecord
from vfguide.report.metrics import summarise, summary_json
from vfguide.report.table import summary_table


def write_again(directory: Path) -> None:
    """Write summary, plots and page of the record in a directory.

    Raises:
        InputError: there is no record, it is damaged, or the directory cannot be written to.
    """
    # Here, because it brings the plotting library, which no other command needs.
    from vfguide.report.page import write_report

    path = directory / RECORD_NAME
    if not directory.is_dir():
        raise InputError(f"{directory}: no such directory; give one that `vfguide fly --out` wrote")
    if not path.exists():
        raise InputError(
            f"{directory}: holds no {RECORD_NAME}; give a directory that `vfguide fly --out` wrote"
        )
    record = replace(FlightRecord.load(path), wall_s=recorded_wall_s(directory / SUMMARY_NAME))
    summary = summarise(record)
    try:
        text = json.dumps(summary_json(summary), indent=2)
        (directory / SUMMARY_NAME).write_text(text + "\n", encoding="utf-8")
        page = write_report(record, directory)
    except OSError as error:
        raise InputError(f"{directory}: cannot be written to ({error.strerror})") from error
    output = Terminal()
    output.print(summary_table(summary))
    output.tell(f"report: {page}")


def recorded_wall_s(path: Path) -> float | None:
    """How long the flight took, s, as its first summary tells; the record does not."""
    try:
        wall_s = float(json.loads(path.read_text(encoding="utf-8"))["wall_s"])
    # Whatever became of the file: it is about to be written anew.
    except (OSError, ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    return wall_s if math.isfinite(wall_s) and wall_s > 0.0 else None
