"""How a vehicle answered: as its companion flew it, or as its mission declares it.

Beside a companion's other logs it is a file of comma-separated values, `NAME.response.csv`, with a line for
each time that another response was flown by; the last one is how the vehicle was finally flown. In a flight
record it is an object in the description of the vehicle.
"""

import csv
import io
import math
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import msgspec

from vfguide.regular_file import open_regular, whole_lines

SUFFIX = ".response.csv"
"""Follows the vehicle's name."""


class VehicleResponse(msgspec.Struct, frozen=True, kw_only=True):
    """How course and speed of a vehicle answer, and whether it slips; None for what nobody said."""

    alpha_1_s: float | None = None
    """Bandwidth of the course hold, 1/s."""
    course_dead_time_s: float | None = None
    """From a course to the first answer, s."""
    course_lag_s: float | None = None
    """Time constant with which the turn then follows, s."""
    course_spread: float | None = None
    """The true alpha lies within alpha / spread and alpha * spread."""
    beta_1_s: float | None = None
    """Bandwidth of the speed hold, 1/s."""
    speed_dead_time_s: float | None = None
    """From a speed to the first answer, s."""
    speed_lag_s: float | None = None
    """Time constant with which the acceleration then follows, s."""
    speed_spread: float | None = None
    """The true beta lies within beta / spread and beta * spread."""
    slips: bool | None = None
    """Whether it turns less than its bank says."""
    turn_efficiency: float | None = None
    """What it turns of that, where flight has shown it."""
    max_bank_deg: float | None = None
    """How far it banks, degrees."""


NUMBERS = tuple(name for name in VehicleResponse.__struct_fields__ if name != "slips")

COLUMNS = ("time_s", *VehicleResponse.__struct_fields__)

RESPONSE_HEADER = (",".join(COLUMNS) + "\n").encode()
"""First line of the file."""


def encode_response(time_s: float, response: VehicleResponse) -> bytes:
    """Return a response as one line of the file.

    Args:
        time_s: since when it is flown by, s of the companion's own clock.
        response: that is flown by.
    """
    line = io.StringIO()
    said = ("" if (v := getattr(response, n)) is None else f"{v:.4f}" for n in NUMBERS)
    numbers = dict(zip(NUMBERS, said, strict=True))
    slips = "" if response.slips is None else str(int(response.slips))
    row = {"time_s": f"{time_s:.6f}", "slips": slips, **numbers}
    csv.DictWriter(line, COLUMNS, lineterminator="\n").writerow(row)
    return line.getvalue().encode()


def read_response(*paths: Path) -> VehicleResponse | None:
    """Return what a vehicle was flown by last; None where no file tells it.

    Args:
        paths: files of its starts in their order; of one that is cut off the whole lines count.
    """
    newest = None
    for path in paths:
        with (
            suppress(OSError, ValueError, csv.Error),
            TextIOWrapper(open_regular(path), newline="", encoding="utf-8") as file,
        ):
            for row in csv.DictReader(whole_lines(file)):
                entry: dict[str, object] = {n: float(t) for n in NUMBERS if (t := row.get(n))}
                if row.get("slips"):
                    entry["slips"] = row["slips"] == "1"
                newest = compose_response(entry)
    return newest


def describe_response(response: VehicleResponse | None) -> dict[str, object] | None:
    """Return a response ready for JSON."""
    return None if response is None else msgspec.structs.asdict(response)


def compose_response(entry: Any) -> VehicleResponse | None:  # noqa: ANN401
    """Return a response from its description.

    Raises:
        ValueError: it is none.
    """
    if entry is None:
        return None
    try:
        found = msgspec.convert(entry, VehicleResponse)
    except msgspec.ValidationError as error:
        raise ValueError(f"a response is damaged: {error}") from error
    numbers = [getattr(found, name) for name in NUMBERS]
    if not all(number is None or math.isfinite(number) for number in numbers):
        raise ValueError("a response is not finite")
    return found
