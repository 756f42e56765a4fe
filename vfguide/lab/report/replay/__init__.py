"""Replay data and page part of a flight: JSON with its series as integers in base64, as fine as readers see.

An event appears on the time line once, for all vehicles to which it happened.
"""

import json
import math
from base64 import b64encode
from collections.abc import Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from importlib.resources import files

import numpy as np

from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.lab.report.colours import NIGHT_COLOURS, vehicle_colours
from vfguide.lab.report.figures import slot_error, slot_track, window_s
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord, VehicleRecord

FORMAT = 1
"""Version of the data's layout; the page also holds the script that reads it."""

FINEST_STEP_S = 0.2
"""Shortest step between samples; the replay draws curves through positions and velocities between them."""

COARSEST_STEP_S = 1.0
"""Longest step between samples in long flights of many aircraft, as far as `GREATEST_BYTES` allows."""

USUAL_BYTES = 600_000
"""Bytes of series at the finest steps; a longer flight gets coarser ones."""

GREATEST_BYTES = 12_000_000
"""Largest number of bytes of series in a page."""

MOST_PATH_POINTS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesKind:
    """Number format of a series."""

    unit: float
    """Value of one integer step, in s, m, m/s or degrees."""
    bits: int
    """8, 16 or 32. Unknown values are the smallest integer, or the largest with 8 bits."""


MILLIMETRES = SeriesKind(unit=0.001, bits=32)
CENTIMETRES = SeriesKind(unit=0.01, bits=32)
MILLISECONDS = SeriesKind(unit=0.001, bits=32)
SPEED = SeriesKind(unit=0.01, bits=16)
ANGLE = SeriesKind(unit=0.01, bits=16)
NUMBER = SeriesKind(unit=1.0, bits=8)

KINDS = {
    "north_m": MILLIMETRES,
    "east_m": MILLIMETRES,
    "altitude_m": CENTIMETRES,
    "course_deg": ANGLE,
    "heading_deg": ANGLE,
    "bank_deg": ANGLE,
    "ground_speed_m_s": SPEED,
    "airspeed_m_s": SPEED,
    "wind_north_m_s": SPEED,
    "wind_east_m_s": SPEED,
    "course_setpoint_deg": ANGLE,
    "speed_setpoint_m_s": SPEED,
    "along_m": MILLIMETRES,
    "across_m": MILLIMETRES,
    "mode": NUMBER,
    "limited": NUMBER,
}
"""Series of every vehicle."""

SLOT_KINDS: dict[str, SeriesKind] = dict.fromkeys(
    ("slot_north_m", "slot_east_m", "slot_altitude_m"), CENTIMETRES
)
"""Further series of followers whose slots changed in flight."""

AGE_KINDS = {"leader_age_s": MILLISECONDS}
"""Further series of followers that recorded the age of the leader's state."""

TYPES = {8: "<u1", 16: "<i2", 32: "<i4"}


def replay_json(record: FlightRecord) -> str:
    """Return the data as JSON that is safe inside a script element, whatever the names in it."""
    text = json.dumps(
        describe_flight(record), ensure_ascii=True, allow_nan=False, separators=(",", ":")
    )
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def describe_flight(record: FlightRecord) -> dict[str, object]:
    """Return everything that the replay shows of a flight."""
    stride = choose_stride(record)
    time_ms = np.round(1000.0 * record.time_s[::stride]).astype(np.float64)
    day = vehicle_colours(record)
    night = vehicle_colours(record, NIGHT_COLOURS)
    return {
        "format": FORMAT,
        "mission": record.mission,
        "estimated": record.mode == "recorded",
        "time": encode(time_ms, SeriesKind(unit=0.001, bits=32), in_units=True),
        "window_s": list(window_s(record)),
        "modes": list(record.mode_names),
        "path": ground_line(record.path_north_m, record.path_east_m),
        "outlines": [
            {"kind": one.kind, **ground_line(one.north_m, one.east_m)} for one in record.outlines
        ],
        "flown_paths": flown_paths(record),
        "events": describe_events(record),
        "vehicles": [
            {
                "name": vehicle.name,
                "leads": vehicle.role == "leader",
                "slot": [vehicle.slot_forward_m, vehicle.slot_right_m, vehicle.slot_up_m],
                "colours": [day[vehicle.name], night[vehicle.name]],
                "limits": None if vehicle.limits is None else vehicle.limits.describe(),
                "series": {
                    name: encode(values[::stride], (KINDS | SLOT_KINDS | AGE_KINDS)[name])
                    for name, values in series_of(record, vehicle).items()
                },
            }
            for vehicle in record.vehicles
        ],
    }


def ground_line(north_m: FloatArray, east_m: FloatArray) -> dict[str, list[float]]:
    """Return at most `MOST_PATH_POINTS` points of a line and its last one."""
    drawn = np.isfinite(north_m) & np.isfinite(east_m)
    points = max(1, math.ceil(np.count_nonzero(drawn) / MOST_PATH_POINTS))
    north, east = (one[drawn] for one in (north_m, east_m))
    chosen = sorted({*range(0, north.size, points), *range(north.size)[-1:]})
    return {"north_m": rounded(north[chosen]), "east_m": rounded(east[chosen])}


def choose_stride(record: FlightRecord) -> int:
    """Return the stride between the samples shown, so that the page stays small."""
    samples = record.time_s.size
    if samples < 2 or record.duration_s <= 0.0:
        return 1
    aged = any(one.leader_age_s is not None for one in record.followers)
    kinds = [
        *KINDS.values(),
        *(SLOT_KINDS.values() if moves_slots(record) else ()),
        *(AGE_KINDS.values() if aged else ()),
    ]
    bytes_per_sample: int = len(record.vehicles) * sum(kind.bits // 8 for kind in kinds)
    whole = samples * bytes_per_sample
    step_s = record.duration_s / (samples - 1)
    usual = max(FINEST_STEP_S, step_s * whole / USUAL_BYTES)
    wanted_s = max(min(usual, COARSEST_STEP_S), step_s * whole / GREATEST_BYTES)
    # A smaller stride would exceed the limits; the tolerance is for rounding errors.
    return max(1, math.ceil(wanted_s / step_s - 1e-6))


def series_of(record: FlightRecord, vehicle: VehicleRecord) -> dict[str, FloatArray]:
    """Return a vehicle's series in the units of their names; NaN where unknown."""
    sent = vehicle.airspeed_setpoint_m_s
    series = {
        "north_m": vehicle.north_m,
        "east_m": vehicle.east_m,
        "altitude_m": vehicle.altitude_amsl_m,
        "course_deg": in_degrees(vehicle.course_rad),
        "heading_deg": in_degrees(vehicle.heading_rad),
        "bank_deg": in_degrees(vehicle.bank_rad),
        "ground_speed_m_s": vehicle.ground_speed_m_s,
        "airspeed_m_s": vehicle.airspeed_m_s,
        "wind_north_m_s": vehicle.wind_north_m_s,
        "wind_east_m_s": vehicle.wind_east_m_s,
        "course_setpoint_deg": in_degrees(vehicle.course_setpoint_rad),
        "speed_setpoint_m_s": np.where(np.isfinite(sent), sent, vehicle.ground_speed_setpoint_m_s),
        "mode": vehicle.mode.astype(np.float64),
        "limited": vehicle.limited.astype(np.float64),
    }
    if vehicle.role == "follower":
        error = slot_error(record.reference, vehicle)
        series |= {"along_m": error.along_track_m, "across_m": error.cross_track_m}
        if vehicle.leader_age_s is not None:
            series["leader_age_s"] = vehicle.leader_age_s
        if moves_slots(record):
            leader = record.reference
            places = (
                *slot_track(leader, *vehicle.slot_m),
                leader.altitude_amsl_m + vehicle.slot_height_m,
            )
            series |= dict(zip(SLOT_KINDS, places, strict=True))
    return series


def moves_slots(record: FlightRecord) -> bool:
    """Check whether slots changed in flight or a deputy led; the page computes all other slots itself."""
    changed = any(one.slot_forward_series_m is not None for one in record.followers)
    return changed or record.reference is not record.leader


def in_degrees(angles_rad: FloatArray) -> FloatArray:
    """Convert angles to degrees within ±180."""
    wrapped: FloatArray = np.degrees(np.arctan2(np.sin(angles_rad), np.cos(angles_rad)))
    return wrapped


def encode(values: FloatArray, kind: SeriesKind, *, in_units: bool = False) -> dict[str, object]:
    """Encode a series; values that the number format cannot hold become unknown.

    With `in_units` the values are in the format's unit already.
    """
    limits = np.iinfo(np.dtype(TYPES[kind.bits]))
    unknown = limits.max if kind.bits == 8 else limits.min
    counted = values if in_units else values / kind.unit
    with np.errstate(invalid="ignore"):
        whole = np.round(counted)
        known = np.isfinite(whole) & (whole > limits.min if kind.bits > 8 else whole >= 0)
        known &= whole <= limits.max - (kind.bits == 8)
    numbers = np.where(known, whole, float(unknown)).astype(TYPES[kind.bits])
    return {
        "unit": kind.unit,
        "bits": kind.bits,
        "data": b64encode(numbers.tobytes()).decode("ascii"),
    }


def rounded(places_m: FloatArray) -> list[float]:
    """Round places to a centimetre."""
    return [round(float(place), 2) for place in places_m]


TOGETHER_S = 2.0
"""Events with the same text within this time are one event of all their vehicles."""

MOST_SHOWN = 1000
"""Largest number of events in a page; beyond it, plain texts give way to orders, leads and warnings."""

STEERED = frozenset(mode.value for mode in Mode if mode.steers)


@dataclass(slots=True)
class ShownEvent:
    """Entry of the time line."""

    time_s: float
    """Time of the first vehicle's event."""
    kind: str
    """`order`, `lead`, `warning` or `text`."""
    text: str
    vehicles: list[str] = field(default_factory=list)


def shown_events(record: FlightRecord) -> list[ShownEvent]:
    """Return the events of the time line but mode changes, which are a series."""
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
    """Return the kind of an event on the time line."""
    return "warning" if event.kind == "text" and event.warning else event.kind


def describe_events(record: FlightRecord) -> list[dict[str, object]]:
    """Return a flight's events for JSON, with vehicles by index."""
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
    """Return the path changes [[s, number]]: 0 is the record's path, 1 the first other one, None no path.

    The first steered vehicle counts, leader before followers, since a companion that has ended knows of no
    order. The result is empty if it was the record's path all the time.
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


SCRIPTS = (
    "flight.js",
    "camera.js",
    "scene.js",
    "timeline.js",
    "events.js",
    "numbers.js",
    "player.js",
)
"""Scripts in order of their dependence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PagePart:
    """Parts of a page that shows a replay; all empty without a replay."""

    style: str
    markup: str
    script: str
    """Script for the end of the page."""


NOTHING = PagePart(style="", markup="", script="")


def replay_of(record: FlightRecord) -> PagePart:
    """Return the replay of a flight; nothing for a flight that ended at once."""
    if record.time_s.size < 2 or record.time_s[-1] <= record.time_s[0]:
        return NOTHING
    markup = read("replay.html").replace("<!-- below -->\n", read("numbers.html"))
    data = f'<script type="application/json" id="replay-data">{replay_json(record)}</script>\n'
    return PagePart(
        style=read("replay.css"), markup=f"<h2>Replay</h2>\n{markup}{data}", script=program()
    )


def program(start: str = "startReplay", more: Iterable[str] = ()) -> str:
    """Join all scripts and `more` into a single function scope that calls `start`."""
    whole = "\n".join([*(read(name) for name in SCRIPTS), *more])
    return f'"use strict";\n(() => {{\n{whole}\n{start}();\n}})();\n'


def hash_source(content: str) -> str:
    """Return the hash that lets a content security policy run exactly this inline script or style."""
    digest = b64encode(sha256(content.encode()).digest()).decode("ascii")
    return f"'sha256-{digest}'"


def read(name: str) -> str:
    """Return a file of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")
