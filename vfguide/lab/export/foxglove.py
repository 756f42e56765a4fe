"""Export to MCAP for Foxglove, Lichtblick and PlotJuggler: map positions, aircraft in 3D, numbers, modes.

Foxglove and Lichtblick draw the messages of Foxglove's SDK by themselves. The numbers of a vehicle are JSON
with a schema of their own.
"""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from foxglove import Channel, Context, open_mcap
from foxglove.messages import (
    ArrowPrimitive,
    Color,
    FrameTransform,
    LinePrimitive,
    LocationFix,
    Log,
    LogLevel,
    Point3,
    Pose,
    Quaternion,
    SceneEntity,
    SceneUpdate,
    TextPrimitive,
    Timestamp,
    Vector3,
)

from vfguide.lab.export.columns import UNITS, Part, begin_of, finest_stride, parts_of
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.figures import slot_track
from vfguide.record.flight import FlightRecord, VehicleRecord

STATE: dict[str, Any] = {
    "title": "vfguide.VehicleState",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
        },
        "mode": {"type": "string"},
        "limited": {"type": "boolean"},
        **{name: {"type": "number", "description": unit} for name, unit in UNITS.items()},
    },
}
"""JSON schema of a vehicle's known numbers."""

FRAME = "formation"
"""Local frame: x east, y north, z up from the origin's altitude."""

SECOND_NS = 1_000_000_000

PLACE = ("latitude_deg", "longitude_deg", "altitude_amsl_m", "north_m", "east_m")
"""Numbers of a vehicle's position."""

ARROW_M = 6.0
"""Length of an aircraft's arrow in the scene, m."""

LEVEL = Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)

Message = FrameTransform | LocationFix | Log | SceneUpdate
State = dict[str, Any]
Stand = tuple[float, float, float, float]
"""East, north and up in the local frame, m, and heading, degrees."""


def write_mcap(record: FlightRecord, path: Path) -> None:
    """Write a flight.

    Raises:
        OSError: the file cannot be written.
        InputError: the record has no geographic origin.
    """
    context, begin_ns = Context(), round(begin_of(record) * 1e9)
    with path.open("wb") as file, open_mcap(file, context=context) as writer:
        topics = FoxgloveTopics(context)
        put_path(record, topics, begin_ns)
        for part in parts_of(record):
            put_part(record, part, topics, begin_ns)
        for event in record.events:
            # Modes come from the samples, which records of all versions have.
            if event.kind != "mode":
                level = LogLevel.Warning if event.warning else LogLevel.Info
                time_ns = begin_ns + round(event.time_s * 1e9)
                put_line(topics, event.vehicle, event.text, time_ns, level=level)
        writer.write_metadata("flight", {"mission": record.mission, "mode": record.mode})


class FoxgloveTopics:
    """Channels by topic, each made for the topic's first message."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._channels: dict[str, Channel] = {}

    def put(self, topic: str, time_ns: int, message: Message | State) -> None:
        """Log one message at a time in ns since 1970."""
        channel = self._channels.get(topic)
        if isinstance(message, dict):
            schema: Any = STATE
            encoding, data = "json", json.dumps(message, allow_nan=False).encode()
        else:
            schema = message.get_schema()
            encoding, data = "protobuf", message.encode()
        if channel is None:
            channel = self._channels[topic] = Channel(
                topic, schema=schema, message_encoding=encoding, context=self._context
            )
        channel.log(data, log_time=time_ns)


def put_path(record: FlightRecord, topics: FoxgloveTopics, time_ns: int) -> None:
    """Put the planned path, once for the whole flight."""
    height = record.leader.altitude_amsl_m
    known = height[np.isfinite(height)]
    up = float(known[0]) - altitude_of_origin(record) if known.size else 0.0
    line = path_line(record.path_east_m.tolist(), record.path_north_m.tolist(), up)
    topics.put("/scene/path", time_ns, scene("path", time_ns, lines=[line]))


def path_line(east_m: list[float], north_m: list[float], up_m: float) -> LinePrimitive:
    """Return a line along the known points of a path at a height above the origin, m."""
    points = [
        Point3(x=east, y=north, z=up_m)
        for east, north in zip(east_m, north_m, strict=True)
        if math.isfinite(east) and math.isfinite(north)
    ]
    return LinePrimitive(
        pose=Pose(position=Vector3(), orientation=LEVEL),
        thickness=2.0,
        scale_invariant=True,
        points=points,
        color=colour_of("#9aa0a8", 0.8),
    )


def put_part(record: FlightRecord, part: Part, topics: FoxgloveTopics, begin_ns: int) -> None:
    """Put some samples of one vehicle: state, scene and changes of mode."""
    vehicle, name = part.vehicle, part.vehicle.name
    every = finest_stride(record)
    changed = np.diff(vehicle.mode, prepend=vehicle.mode[0] - 1) != 0
    colour, origin_m = vehicle_colours(record)[name], altitude_of_origin(record)
    slots = None if vehicle.role == "leader" else slots_of(record, vehicle)
    for number, time_s in enumerate(part.time_s.tolist()):
        sample, time_ns = part.first + number, begin_ns + round(time_s * 1e9)
        row = {one: float(column[number]) for one, column in part.numbers.items()}
        put_state(topics, name, row, time_ns, mode=part.modes[number], limited=part.limited[number])
        if changed[sample]:
            put_line(topics, name, part.modes[number], time_ns)
        if sample % every == 0:
            slot = None if slots is None else slots[sample]
            put_scene(topics, name, colour, row, slot=slot, origin_m=origin_m, time_ns=time_ns)


def put_state(
    topics: FoxgloveTopics, name: str, row: dict[str, float], time_ns: int, **more: object
) -> None:
    """Put all known numbers of a vehicle and further values."""
    known = {one: value for one, value in row.items() if one in UNITS and math.isfinite(value)}
    topics.put(f"/{name}/state", time_ns, {"timestamp": stamp_of(time_ns), **more, **known})


def slots_of(record: FlightRecord, vehicle: VehicleRecord) -> list[Stand]:
    """Return a follower's slot at each sample, headed along the leader's course."""
    leader = record.reference
    north, east = slot_track(leader, *vehicle.slot_m)
    up = leader.altitude_amsl_m + vehicle.slot_height_m - altitude_of_origin(record)
    course = np.degrees(leader.course_rad)
    rows: list[Stand] = list(zip(*(one.tolist() for one in (east, north, up, course)), strict=True))
    return rows


def put_line(
    topics: FoxgloveTopics,
    vehicle: str,
    text: str,
    time_ns: int,
    *,
    level: LogLevel = LogLevel.Info,
) -> None:
    """Put a line of a vehicle's companion into the log."""
    message = Log(timestamp=stamp(time_ns), level=level, message=f"{vehicle}: {text}", name=vehicle)
    topics.put("/log", time_ns, message)


def put_scene(
    topics: FoxgloveTopics,
    name: str,
    colour: str,
    row: dict[str, float],
    *,
    slot: Stand | None,
    origin_m: float,
    time_ns: int,
) -> None:
    """Put a vehicle's geographic position, frame transform, arrows and label, as far as they are known.

    `row` has its numbers by name; `origin_m` is the altitude of the local frame's origin, m.
    """
    latitude, longitude, altitude, north, east = (row.get(one, math.nan) for one in PLACE)
    if not is_known((latitude, longitude, altitude, north, east)):
        return
    heading, bank = row.get("heading_deg", math.nan), row.get("bank_deg", math.nan)
    fix = LocationFix(
        timestamp=stamp(time_ns),
        frame_id=name,
        latitude=latitude,
        longitude=longitude,
        altitude=altitude,
    )
    topics.put(f"/{name}/location", time_ns, fix)
    transform = FrameTransform(
        timestamp=stamp(time_ns),
        parent_frame_id=FRAME,
        child_frame_id=name,
        translation=Vector3(x=east, y=north, z=altitude - origin_m),
        rotation=turned_to(heading, bank if math.isfinite(bank) else 0.0),
    )
    topics.put("/tf", time_ns, transform)
    at = (east, north, altitude - origin_m, heading)
    if not is_known(at):
        return
    arrows = [arrow_at(at, colour_of(colour, 1.0))]
    if slot is not None and is_known(slot):
        arrows.append(arrow_at(slot, colour_of(colour, 0.3)))
    label = TextPrimitive(
        pose=pose_at(at),
        billboard=True,
        font_size=14.0,
        scale_invariant=True,
        color=colour_of(colour, 1.0),
        text=name,
    )
    topics.put(f"/scene/{name}", time_ns, scene(name, time_ns, arrows=arrows, texts=[label]))


def is_known(numbers: Sequence[float]) -> bool:
    """Check whether all numbers are finite."""
    return all(math.isfinite(one) for one in numbers)


def pose_at(stand: Stand) -> Pose:
    """Return the pose of the tail of an arrow that is centred on a place."""
    east, north, up, heading_deg = stand
    back_east = 0.5 * ARROW_M * math.sin(math.radians(heading_deg))
    back_north = 0.5 * ARROW_M * math.cos(math.radians(heading_deg))
    place = Vector3(x=east - back_east, y=north - back_north, z=up)
    return Pose(position=place, orientation=turned_to(heading_deg, 0.0))


def arrow_at(stand: Stand, colour: Color) -> ArrowPrimitive:
    """Return an arrow that is centred on a place."""
    return ArrowPrimitive(
        pose=pose_at(stand),
        shaft_length=0.6 * ARROW_M,
        shaft_diameter=0.2 * ARROW_M,
        head_length=0.4 * ARROW_M,
        head_diameter=0.5 * ARROW_M,
        color=colour,
    )


def scene(name: str, time_ns: int, **primitives: Any) -> SceneUpdate:  # noqa: ANN401 - lists of each kind
    """Return a scene entity that stays until the next of its name."""
    entity = SceneEntity(
        timestamp=stamp(time_ns), frame_id=FRAME, id=name, frame_locked=True, **primitives
    )
    return SceneUpdate(entities=[entity])


def turned_to(heading_deg: float, bank_deg: float) -> Quaternion:
    """Return the attitude of a heading and a bank angle, degrees, as a Foxglove quaternion."""
    return Quaternion(**dict(zip("xyzw", attitude(heading_deg, bank_deg), strict=True)))


def attitude(heading_deg: float, bank_deg: float) -> tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a heading and a bank angle, degrees; body x ahead, z up.

    East is x and north is y: a heading of 90° is no rotation, and headings increase against the yaw angle.
    """
    yaw = math.radians(90.0 - heading_deg) if math.isfinite(heading_deg) else 0.0
    roll = math.radians(bank_deg)
    sine, cosine = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    roll_sine, roll_cosine = math.sin(roll / 2.0), math.cos(roll / 2.0)
    return (cosine * roll_sine, sine * roll_sine, sine * roll_cosine, cosine * roll_cosine)


def colour_of(code: str, opacity: float) -> Color:
    """Return the colour of a code such as #0072b2."""
    red, green, blue = (int(code[place : place + 2], 16) / 255.0 for place in (1, 3, 5))
    return Color(r=red, g=green, b=blue, a=opacity)


def stamp_of(time_ns: int) -> State:
    """Return a time in ns as Foxglove's JSON."""
    return dict(zip(("sec", "nsec"), divmod(time_ns, SECOND_NS), strict=True))


def stamp(time_ns: int) -> Timestamp:
    """Return a time in ns as a Foxglove timestamp."""
    return Timestamp(*divmod(time_ns, SECOND_NS))


def altitude_of_origin(record: FlightRecord) -> float:
    """Return the altitude of the local frame's origin above mean sea level, m; 0 where not known."""
    return 0.0 if record.origin is None else record.origin.altitude_amsl_m
