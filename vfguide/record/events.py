"""What companions had to say on a flight, each at its time: changes of mode, orders, who leads, warnings.

Beside a companion's other logs it is a file of comma-separated values, `NAME.events.csv`:

    time_s,formation_time_s,kind,warning,text
    12.300000,12.300000,order,0,"order 1 is flown from now on: vee, 30 m apart"

In a flight record it is a list of objects in the description. A line is whole once its line feed is written:
what a killed companion leaves is read up to there.
"""

from collections.abc import Iterable
from itertools import islice
from pathlib import Path
from typing import Literal

import msgspec

from vfguide.record.log import CompanionLog, plain

EventKind = Literal["mode", "order", "lead", "text"]
"""`mode`: of the companion; `order`: what becomes of one; `lead`: who leads; `text`: all else."""

SUFFIX = ".events.csv"
"""Follows the vehicle's name."""

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


EVENTS = CompanionLog(FlightEvent, ("time_s", "formation_time_s", "kind", "warning", "text"))


def encode_event(event: FlightEvent, formation_time_s: float) -> bytes:
    """An event as one line of the file.

    Args:
        event: at a time of the companion's own clock.
        formation_time_s: the same moment on the formation's clock, s; NaN while that is not known.
    """
    return EVENTS.encode(event, formation_time_s=formation_time_s)


def read_events(vehicle: str, *paths: Path, zero_s: float = 0.0) -> list[FlightEvent]:
    """What a companion had to say, in order.

    Args:
        vehicle: its name.
        paths: files of its starts. One that is missing or cut off holds what can be read of it.
        zero_s: the companion's clock at time 0 of the flight.
    """
    found = [
        msgspec.structs.replace(event, time_s=event.time_s - zero_s)
        for event in islice(EVENTS.read(*paths, vehicle=vehicle), MOST_EVENTS)
    ]
    return sorted(found, key=lambda event: event.time_s)


def merged_events(events: Iterable[FlightEvent]) -> tuple[FlightEvent, ...]:
    """Events of several vehicles in the order of their times, as many as a record holds.

    Where they are too many, other texts are left out before what to worry about, orders and who leads.
    """
    by_worth = sorted(events, key=lambda event: (event.kind == "text") - 2 * event.warning)
    return tuple(sorted(by_worth[:MOST_EVENTS], key=lambda event: event.time_s))


def checked_events(events: tuple[FlightEvent, ...]) -> tuple[FlightEvent, ...]:
    """Events that a record's file tells, their texts fit for a terminal; ValueError where they are none."""
    if len(events) > MOST_EVENTS:
        raise ValueError("it has too many events")
    if any(not 0.0 <= event.time_s <= LONGEST_FLIGHT_S for event in events):
        raise ValueError("an event is of no time of the flight")
    return tuple(msgspec.structs.replace(event, text=plain(event.text)) for event in events)
