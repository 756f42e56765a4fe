"""Comma-separated values, a row for each vehicle at each sample: for spreadsheets, MATLAB and pandas."""

import csv
import math
from pathlib import Path

from vfguide.lab.export.columns import UNITS, begin_of, moment, parts_of
from vfguide.record.flight import FlightRecord

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def write_csv(record: FlightRecord, path: Path) -> None:
    """Write a flight; units are in the names of the columns, and what is not known is left empty.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
    begin = begin_of(record)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time_s", "time_utc", "vehicle", *UNITS, "mode", "limited"))
        for part in parts_of(record):
            name = harmless(part.vehicle.name)
            columns = [values.tolist() for values in part.numbers.values()]
            for time_s, mode, limited, *numbers in zip(
                part.time_s.tolist(), part.modes, part.limited, *columns, strict=True
            ):
                writer.writerow(
                    (
                        f"{time_s:.3f}",
                        moment(begin + time_s),
                        name,
                        *(plain(number) for number in numbers),
                        harmless(mode),
                        int(limited),
                    )
                )


def plain(number: float) -> str:
    """A number with as many digits as tell millimetres of a position on the earth; nothing if not known."""
    return f"{number:.9g}" if math.isfinite(number) else ""


def harmless(text: str) -> str:
    """A name that no spreadsheet takes for a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text
