"""What companions had to say on a flight, each at its time: changes of mode, orders, who leads, warnings.

Beside a companion's other logs it is a file of comma-separated values, `NAME.events.csv`:

    time_s,formation_time_s,kind,warning,text
    12.300000,12.300000,order,0,"order 1 is flown from now on: vee, 30 m apart"

In a flight record it is a list of objects in the description. A line is whole once its line feed is written:
what a killed companion leaves is read up to there.
"""

import csv
import io
import math
from collections.abc import Iterable
from contextlib import suppress
from io import TextIOWrapper
from pathlib import Path
from typing import Any, Literal, get_args

import msgspec
from msgspec.structs import asdict

from vfguide.regular_file import open_regular, whole_lines

EventKind = Literal["mode", "order", "lead", "text"]
"""`mode`: of the companion; `order`: what becomes of one; `lead`: who leads; `text`: all else."""

SUFFIX = ".events.csv"
"""Follows the vehicle's name."""

COLUMNS = ("time_s", "formation_time_s", "kind", "warning", "text")

HEADER = (",".join(COLUMNS) + "\n").encode()
"""First line of the file."""

LONGEST_TEXT = 300
"""Characters of an event that are kept."""

MOST_EVENTS = 20_000
"""Events of a vehicle, or of a record, that are read at most: one a second for five hours."""

LONGEST_FLIGHT_S = 1e7
"""An event of a record is no later than this."""


class FlightEvent(msgspec.Struct, frozen=True, kw_only=True):
    """Something that a companion said, or that happened to it."""

    time_s: float
    """When: of a flight record from its beginning, in a companion's file on its own clock."""
    vehicle: str
    """Whose companion."""
    kind: EventKind
    """What it is about."""
    text: str
    """In one line, as the companion's log has it."""
    warning: bool = False
    """Whether it is something to worry about."""


def encode_event(event: FlightEvent, formation_time_s: float) -> bytes:
    """An event as one line of the file.

    Args:
        event: at a time of the companion's own clock.
        formation_time_s: the same moment on the formation's clock, s; NaN while that is not known.
    """
    line = io.StringIO()
    fields = (
        f"{event.time_s:.6f}",
        f"{formation_time_s:.6f}",
        event.kind,
        int(event.warning),
        plain(event.text),
    )
    csv.writer(line, lineterminator="\n").writerow(fields)
    return line.getvalue().encode()


def read_events(vehicle: str, *paths: Path, zero_s: float = 0.0) -> list[FlightEvent]:
    """What a companion had to say, in order.

    Args:
        vehicle: its name.
        paths: files of its starts. One that is missing or cut off holds what can be read of it.
        zero_s: the companion's clock at time 0 of the flight.
    """
    found: list[FlightEvent] = []
    for path in paths:
        with (
            suppress(OSError, csv.Error),
            TextIOWrapper(
                open_regular(path), newline="", encoding="utf-8", errors="replace"
            ) as file,
        ):
            for row in csv.DictReader(whole_lines(file)):
                if len(found) >= MOST_EVENTS:
                    break
                with suppress(ValueError, TypeError, LookupError):
                    found.append(_event(vehicle, row, zero_s))
    return sorted(found, key=lambda event: event.time_s)


def describe_events(events: Iterable[FlightEvent]) -> list[dict[str, object]]:
    """Events ready for JSON."""
    return [asdict(event) for event in events]


def merged_events(events: Iterable[FlightEvent]) -> tuple[FlightEvent, ...]:
    """Events of several vehicles in the order of their times, as many as a record holds.

    Where they are too many, other texts are left out before what to worry about, orders and who leads.
    """
    by_worth = sorted(events, key=lambda event: (event.kind == "text") - 2 * event.warning)
    return tuple(sorted(by_worth[:MOST_EVENTS], key=lambda event: event.time_s))


def compose_events(entries: Any) -> tuple[FlightEvent, ...]:  # noqa: ANN401
    """Events from their description; LookupError, TypeError or ValueError where it is none."""
    if not isinstance(entries, list) or len(entries) > MOST_EVENTS:
        raise ValueError("its events are no list, or too many")
    events = tuple(
        _checked(
            time_s=float(entry["time_s"]),
            vehicle=str(entry["vehicle"]),
            kind=entry["kind"],
            text=str(entry["text"]),
            warning=bool(entry["warning"]),
        )
        for entry in entries
    )
    if any(not 0.0 <= event.time_s <= LONGEST_FLIGHT_S for event in events):
        raise ValueError("an event is of no time of the flight")
    return events


def _event(vehicle: str, row: dict[str, str], zero_s: float) -> FlightEvent:
    return _checked(
        time_s=float(row["time_s"]) - zero_s,
        vehicle=vehicle,
        kind=row["kind"],
        text=row["text"],
        warning=row["warning"] == "1",
    )


def _checked(*, time_s: float, vehicle: str, kind: Any, text: str, warning: bool) -> FlightEvent:  # noqa: ANN401
    if not math.isfinite(time_s) or kind not in get_args(EventKind) or not isinstance(text, str):
        raise ValueError("an event has no time or text, or is of no known kind")
    return FlightEvent(time_s=time_s, vehicle=vehicle, kind=kind, text=plain(text), warning=warning)


def plain(text: str) -> str:
    """The printable characters of a text in one line, as long as it is kept."""
    words = " ".join(text.split())
    return "".join(letter for letter in words if letter.isprintable())[:LONGEST_TEXT]
