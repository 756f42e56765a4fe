"""What happened on a flight, as the replay's time line has it: once for all vehicles to which it happened."""

from dataclasses import dataclass, field

import numpy as np

from vfguide.companion.supervisor import Mode
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord

TOGETHER_S = 2.0
"""What several vehicles say within this time is one event of all of them."""

MOST_SHOWN = 1000
"""Events of a page. Of more, what is only told makes way: orders, who leads and warnings count first."""

STEERED = frozenset(mode.value for mode in Mode if mode.steers)


@dataclass(slots=True)
class ShownEvent:
    """One entry of the time line."""

    time_s: float
    """Time at which the first vehicle said it, s."""
    kind: str
    """`order`, `lead`, `warning` or `text`."""
    text: str
    """What they said."""
    vehicles: list[str] = field(default_factory=list)
    """Who."""


def shown_events(record: FlightRecord) -> list[ShownEvent]:
    """What the time line shows beside changes of mode, which are among the series."""
    found: list[ShownEvent] = []
    open_ones: dict[tuple[str, str], ShownEvent] = {}
    for event in record.events:
        if event.kind == "mode":
            continue
        key = kind_of(event), event.text
        known = open_ones.get(key)
        if known is None or event.time_s - known.time_s > TOGETHER_S:
            known = ShownEvent(event.time_s, *key)
            open_ones[key] = known
            found.append(known)
        if event.vehicle not in known.vehicles:
            known.vehicles.append(event.vehicle)
    if len(found) > MOST_SHOWN:
        found = [one for one in found if one.kind != "text"]
    return found[:MOST_SHOWN]


def kind_of(event: FlightEvent) -> str:
    """How the time line marks it."""
    return "warning" if event.kind == "text" and event.warning else event.kind


def describe_events(record: FlightRecord) -> list[dict[str, object]]:
    """The events of a flight, ready for JSON; vehicles by their numbers."""
    rows = {vehicle.name: row for row, vehicle in enumerate(record.vehicles)}
    return [
        {
            "t": round(one.time_s, 2),
            "kind": one.kind,
            "vehicles": sorted(rows[name] for name in one.vehicles if name in rows),
            "text": one.text,
        }
        for one in shown_events(record)
    ]


def flown_paths(record: FlightRecord) -> list[list[float | None]]:
    """Which path was flown from when on: [[s, number]], 0 the record's, 1 the first other one, None none.

    The first vehicle that is steered counts, the leader before the followers: a companion that has ended
    knows of no order. Empty where it was the record's all the time.
    """
    if all(vehicle.path_number is None for vehicle in record.vehicles):
        return []
    steered = np.array([STEERED.issuperset({name}) for name in record.mode_names])
    chosen = np.full_like(record.time_s, -1.0)
    for vehicle in reversed(record.vehicles):
        path = vehicle.path_number
        numbers = np.zeros_like(record.time_s) if path is None else path
        counts = steered[np.clip(vehicle.mode, 0, steered.size - 1)]
        chosen = np.where(counts, np.where(np.isfinite(numbers), numbers, -2.0), chosen)
    changes: list[list[float | None]] = [[float(record.time_s[0]), 0.0]]
    for time_s, number in zip(record.time_s.tolist(), chosen.tolist(), strict=True):
        value = None if number == -2.0 else number
        if number != -1.0 and value != changes[-1][1]:
            changes.append([round(time_s, 2), value])
    return changes
