"""Events that companions report during a flight: mode changes, orders, changes of leader, warnings.

A companion writes them as comma-separated values to `NAME.events.csv`:

    time_s,formation_time_s,kind,warning,text
    12.300000,12.300000,order,0,"order 1 is flown from now on: vee, 30 m apart"

A flight record holds them as a list of objects in its description. A line is complete once its line feed is
written; a file of a killed companion is read up to there.
"""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Literal

import msgspec

from vfguide.record.log import CompanionLog, plain

EventKind = Literal["mode", "order", "lead", "text"]
"""`mode`: supervisor mode; `order`: progress of an order; `lead`: change of leader; `text`: all else."""

SUFFIX = ".events.csv"
"""Suffix after the vehicle's name."""

MOST_EVENTS = 20_000
"""Maximum number of events read of a vehicle or a record: one a second for five hours."""

LONGEST_FLIGHT_S = 1e7
"""Maximum time of an event in a record."""


class FlightEvent(msgspec.Struct, frozen=True, kw_only=True):
    """An event that a companion reports."""

    time_s: float
    """Time, s: from the beginning of a flight record, or on the companion's own clock in its file."""
    vehicle: str
    """Vehicle of the companion."""
    kind: EventKind
    text: str
    """One-line text as in the companion's log."""
    warning: bool = False
    """Whether the event is a warning."""


EVENTS = CompanionLog(FlightEvent, ("time_s", "formation_time_s", "kind", "warning", "text"))


def encode_event(event: FlightEvent, formation_time_s: float) -> bytes:
    """Encode an event as one line of the file.

    The event's time is on the companion's own clock. `formation_time_s` is the same moment on the
    formation's clock, s; NaN if unknown.
    """
    return EVENTS.encode(event, formation_time_s=formation_time_s)


def read_events(vehicle: str, *paths: Path, zero_s: float = 0.0) -> list[FlightEvent]:
    """Return a companion's events in order of time, from the files of its starts.

    Files may be missing or truncated. `zero_s` is the companion's clock at time 0 of the flight, s.
    """
    found = [
        msgspec.structs.replace(event, time_s=event.time_s - zero_s)
        for event in islice(EVENTS.read(*paths, vehicle=vehicle), MOST_EVENTS)
    ]
    return sorted(found, key=lambda event: event.time_s)


def merged_events(events: Iterable[FlightEvent]) -> tuple[FlightEvent, ...]:
    """Merge events of several vehicles in order of time, up to the limit of a record.

    If there are too many, texts without warnings are dropped first, and warnings last.
    """
    by_worth = sorted(events, key=lambda event: (event.kind == "text") - 2 * event.warning)
    return tuple(sorted(by_worth[:MOST_EVENTS], key=lambda event: event.time_s))


def checked_events(events: tuple[FlightEvent, ...]) -> tuple[FlightEvent, ...]:
    """Return a record's events with texts safe for a terminal; ValueError if they are invalid."""
    if len(events) > MOST_EVENTS:
        raise ValueError("it has too many events")
    if any(not 0.0 <= event.time_s <= LONGEST_FLIGHT_S for event in events):
        raise ValueError("an event is of no time of the flight")
    return tuple(msgspec.structs.replace(event, text=plain(event.text)) for event in events)
