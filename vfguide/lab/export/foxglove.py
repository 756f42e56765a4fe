"""MCAP for Foxglove, Lichtblick and PlotJuggler: places on a map, aircraft in 3D, every number, the modes.

Messages that Foxglove and Lichtblick draw by themselves, described as JSON Schema.

The names, fields and units of `foxglove.…` are Foxglove's well-known message types: https://docs.foxglove.dev/docs/sdk/schemas.
Only the fields that are written here are described.
"""

import json
import math
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mcap.writer import Writer

from vfguide.lab.export.columns import UNITS, Part, begin_of, parts_of
from vfguide.lab.report.colours import vehicle_colours
from vfguide.lab.report.geometry import slot_track
from vfguide.record.flight import FlightRecord, VehicleRecord

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
TEXT: Schema = {"type": "string"}


def structure(title: str, **fields: Schema) -> Schema:
    """An object with these fields."""
    return {"title": title, "type": "object", "properties": fields}


def listing(of: Schema) -> Schema:
    """An array."""
    return {"type": "array", "items": of}


def seconds(title: str) -> Schema:
    """A time or a duration, of seconds and nanoseconds."""
    whole = {"type": "integer", "minimum": 0}
    return structure(title, sec=whole, nsec={**whole, "maximum": 999_999_999})


TIME = seconds("time")
VECTOR = structure("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
POINT = structure("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = structure("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = structure("foxglove.Pose", position=VECTOR, orientation=QUATERNION)
COLOUR = structure("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)

ARROW = structure(
    "foxglove.ArrowPrimitive",
    pose=POSE,
    shaft_length=NUMBER,
    shaft_diameter=NUMBER,
    head_length=NUMBER,
    head_diameter=NUMBER,
    color=COLOUR,
)
TEXT_MARK = structure(
    "foxglove.TextPrimitive",
    pose=POSE,
    billboard={"type": "boolean"},
    font_size=NUMBER,
    scale_invariant={"type": "boolean"},
    color=COLOUR,
    text=TEXT,
)
LINE = structure(
    "foxglove.LinePrimitive",
    type={"type": "integer"},
    pose=POSE,
    thickness=NUMBER,
    scale_invariant={"type": "boolean"},
    points=listing(POINT),
    color=COLOUR,
    colors=listing(COLOUR),
    indices=listing({"type": "integer", "minimum": 0}),
)
ENTITY = structure(
    "foxglove.SceneEntity",
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=seconds("duration"),
    frame_locked={"type": "boolean"},
    metadata=listing(structure("foxglove.KeyValuePair", key=TEXT, value=TEXT)),
    arrows=listing(ARROW),
    lines=listing(LINE),
    texts=listing(TEXT_MARK),
)

SCHEMAS: dict[str, Schema] = {
    "foxglove.LocationFix": structure(
        "foxglove.LocationFix",
        timestamp=TIME,
        frame_id=TEXT,
        latitude=NUMBER,
        longitude=NUMBER,
        altitude=NUMBER,
        position_covariance={**listing(NUMBER), "minItems": 9, "maxItems": 9},
        position_covariance_type={"type": "integer", "enum": [0, 1, 2, 3]},
    ),
    "foxglove.FrameTransform": structure(
        "foxglove.FrameTransform",
        timestamp=TIME,
        parent_frame_id=TEXT,
        child_frame_id=TEXT,
        translation=VECTOR,
        rotation=QUATERNION,
    ),
    "foxglove.SceneUpdate": structure(
        "foxglove.SceneUpdate",
        deletions=listing(
            structure(
                "foxglove.SceneEntityDeletion",
                timestamp=TIME,
                type={"type": "integer"},
                id=TEXT,
            )
        ),
        entities=listing(ENTITY),
    ),
    "foxglove.Log": structure(
        "foxglove.Log",
        timestamp=TIME,
        level={"type": "integer", "enum": [0, 1, 2, 3, 4, 5]},
        message=TEXT,
        name=TEXT,
        file=TEXT,
        line={"type": "integer", "minimum": 0},
    ),
    "vfguide.VehicleState": structure(
        "vfguide.VehicleState",
        timestamp=TIME,
        mode=TEXT,
        limited={"type": "boolean"},
        **{name: {"type": "number", "description": unit} for name, unit in UNITS.items()},
    ),
}
"""Every message that is written, by its name."""


FRAME = "formation"
"""The local frame: x east, y north, z up from the origin's height."""

FINEST_STEP_S = 0.2
"""s between two pictures of the scene; numbers keep the record's own steps."""

ARROW_M = 6.0
"""Length of an aircraft in the scene, m."""

INFO, WARNING = 2, 3
"""Levels of a line of the log, as Foxglove counts them."""

Message = dict[str, object]


def write_mcap(record: FlightRecord, path: Path) -> None:
    """Write a flight.

    Raises:
        OSError: it cannot be written.
        InputError: the record does not say where on the earth it was flown.
    """
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library=f"vfguide {version('vfguide')}")
        topics = FoxgloveTopics(writer)
        begin_ns = round(begin_of(record) * 1e9)
        put_path(record, topics, begin_ns)
        for part in parts_of(record):
            put_part(record, part, topics, begin_ns)
        for event in record.events:
            # Modes are those of the samples, of records of all versions.
            if event.kind != "mode":
                level = WARNING if event.warning else INFO
                time_ns = begin_ns + round(event.time_s * 1e9)
                put_line(topics, event.vehicle, event.text, time_ns, level=level)
        writer.add_metadata("flight", {"mission": record.mission, "mode": record.mode})
        writer.finish()  # type: ignore[no-untyped-call] # the library leaves it without types


class TopicSink(Protocol):
    """Whatever takes messages by topic."""

    def put(self, topic: str, schema: str, time_ns: int, message: Message) -> None:
        """Take one message, of a time in ns since 1970."""


class FoxgloveTopics:
    """Writes messages by topic; registers each topic and schema when it first comes."""

    def __init__(self, writer: Writer) -> None:
        """Write with this writer."""
        self._writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}

    def put(self, topic: str, schema: str, time_ns: int, message: Message) -> None:
        """Write one message."""
        if schema not in self._schemas:
            text = json.dumps(SCHEMAS[schema]).encode()
            self._schemas[schema] = self._writer.register_schema(schema, "jsonschema", text)
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic, "json", self._schemas[schema]
            )
        self._writer.add_message(
            channel_id=self._channels[topic],
            log_time=time_ns,
            publish_time=time_ns,
            data=json.dumps(message, allow_nan=False).encode(),
        )


def put_path(record: FlightRecord, topics: FoxgloveTopics, time_ns: int) -> None:
    """The planned path, once and for good."""
    height = record.leader.altitude_amsl_m
    known = height[np.isfinite(height)]
    up = float(known[0]) - altitude_of_origin(record) if known.size else 0.0
    line = path_line(record.path_east_m.tolist(), record.path_north_m.tolist(), up)
    topics.put("/scene/path", "foxglove.SceneUpdate", time_ns, scene("path", time_ns, lines=[line]))


def path_line(east_m: list[float], north_m: list[float], up_m: float) -> Message:
    """A line along a path at a height above the origin, m; without the points that are not known."""
    points = [
        {"x": east, "y": north, "z": up_m}
        for east, north in zip(east_m, north_m, strict=True)
        if math.isfinite(east) and math.isfinite(north)
    ]
    return {
        "type": 0,
        "pose": pose(0.0, 0.0, 0.0, (0.0, 0.0, 0.0, 1.0)),
        "thickness": 2.0,
        "scale_invariant": True,
        "points": points,
        "color": colour_of("#9aa0a8", 0.8),
        "colors": [],
        "indices": [],
    }


def label_at(arrow: Message, name: str, colour: str) -> Message:
    """A vehicle's name at its arrow."""
    return {
        "pose": arrow["pose"],
        "billboard": True,
        "font_size": 14.0,
        "scale_invariant": True,
        "color": colour_of(colour, 1.0),
        "text": name,
    }


def put_part(record: FlightRecord, part: Part, topics: FoxgloveTopics, begin_ns: int) -> None:
    """Some samples of one vehicle."""
    vehicle = part.vehicle
    step_s = record.duration_s / max(record.time_s.size - 1, 1)
    every = max(1, math.floor(FINEST_STEP_S / step_s)) if step_s > 0.0 else 1
    first = int(np.searchsorted(record.time_s, part.time_s[0]))
    for number, time_s in enumerate(part.time_s.tolist()):
        time_ns = begin_ns + round(time_s * 1e9)
        sample = first + number
        topics.put(
            f"/{vehicle.name}/state", "vfguide.VehicleState", time_ns, state(part, number, time_ns)
        )
        if number == 0 and first == 0:
            put_line(topics, vehicle.name, part.modes[0], time_ns)
        if number % every == 0:
            put_place(record, part, number, topics, time_ns)
            message = arrows_of(record, vehicle, sample, time_ns)
            if message is not None:
                topics.put(f"/scene/{vehicle.name}", "foxglove.SceneUpdate", time_ns, message)
    for time_s, (before, after) in zip(part.time_s[1:].tolist(), pairwise(part.modes), strict=True):
        if before != after:
            put_line(topics, vehicle.name, after, begin_ns + round(time_s * 1e9))


def state(part: Part, number: int, time_ns: int) -> Message:
    """All numbers of a vehicle that are known."""
    values = {name: float(column[number]) for name, column in part.numbers.items()}
    return {
        "timestamp": stamp(time_ns),
        "mode": part.modes[number],
        "limited": part.limited[number],
        **{name: value for name, value in values.items() if math.isfinite(value)},
    }


def put_line(
    topics: TopicSink, vehicle: str, text: str, time_ns: int, *, level: int = INFO
) -> None:
    """A line of the log, of a vehicle's companion."""
    message: Message = {
        "timestamp": stamp(time_ns),
        "level": level,
        "message": f"{vehicle}: {text}",
        "name": vehicle,
        "file": "",
        "line": 0,
    }
    topics.put("/log", "foxglove.Log", time_ns, message)


def put_place(
    record: FlightRecord, part: Part, number: int, topics: FoxgloveTopics, time_ns: int
) -> None:
    """Where a vehicle is on the earth, and in the local frame."""
    numbers = part.numbers
    place = [float(numbers[name][number]) for name in ("latitude_deg", "longitude_deg")]
    north, east = (float(numbers[name][number]) for name in ("north_m", "east_m"))
    altitude = float(numbers["altitude_amsl_m"][number])
    if not all(math.isfinite(one) for one in (*place, north, east, altitude)):
        return
    name = part.vehicle.name
    fix: Message = {
        "timestamp": stamp(time_ns),
        "frame_id": name,
        "latitude": place[0],
        "longitude": place[1],
        "altitude": altitude,
        "position_covariance": [0.0] * 9,
        "position_covariance_type": 0,
    }
    topics.put(f"/{name}/location", "foxglove.LocationFix", time_ns, fix)
    heading, bank = (float(numbers[one][number]) for one in ("heading_deg", "bank_deg"))
    turn = attitude(heading, bank if math.isfinite(bank) else 0.0)
    up = altitude - altitude_of_origin(record)
    transform: Message = {
        "timestamp": stamp(time_ns),
        "parent_frame_id": FRAME,
        "child_frame_id": name,
        "translation": {"x": east, "y": north, "z": up},
        "rotation": dict(zip("xyzw", turn, strict=True)),
    }
    topics.put("/tf", "foxglove.FrameTransform", time_ns, transform)


def arrows_of(
    record: FlightRecord, vehicle: VehicleRecord, sample: int, time_ns: int
) -> Message | None:
    """An arrow and a name for a vehicle, a pale arrow for its slot; None where its place is not known."""
    colour = vehicle_colours(record)[vehicle.name]
    origin = altitude_of_origin(record)
    heading = float(np.degrees(vehicle.heading_rad[sample]))
    arrow = arrow_at(
        float(vehicle.east_m[sample]),
        float(vehicle.north_m[sample]),
        float(vehicle.altitude_amsl_m[sample]) - origin,
        heading,
        colour_of(colour, 1.0),
    )
    if arrow is None:
        return None
    label = label_at(arrow, vehicle.name, colour)
    arrows = [arrow]
    if vehicle.role == "follower":
        leader, here = record.reference, slice(sample, sample + 1)
        north, east = slot_track(leader, *vehicle.slot_m)
        slot = arrow_at(
            float(east[here][0]),
            float(north[here][0]),
            float((leader.altitude_amsl_m + vehicle.slot_height_m)[sample]) - origin,
            float(np.degrees(leader.course_rad[sample])),
            colour_of(colour, 0.3),
        )
        arrows += [slot] if slot else []
    return scene(vehicle.name, time_ns, arrows=arrows, texts=[label])


def arrow_at(
    east_m: float, north_m: float, up_m: float, heading_deg: float, colour: Message
) -> Message | None:
    """An arrow whose middle is a place; None where that is not known."""
    if not all(math.isfinite(one) for one in (east_m, north_m, up_m, heading_deg)):
        return None
    back_east = 0.5 * ARROW_M * math.sin(math.radians(heading_deg))
    back_north = 0.5 * ARROW_M * math.cos(math.radians(heading_deg))
    return {
        "pose": pose(east_m - back_east, north_m - back_north, up_m, attitude(heading_deg, 0.0)),
        "shaft_length": 0.6 * ARROW_M,
        "shaft_diameter": 0.2 * ARROW_M,
        "head_length": 0.4 * ARROW_M,
        "head_diameter": 0.5 * ARROW_M,
        "color": colour,
    }


def scene(name: str, time_ns: int, **primitives: list[Message]) -> Message:
    """An entity that stands until the next of its name."""
    empty: dict[str, list[Message]] = {"arrows": [], "lines": [], "texts": []}
    entity = {
        "timestamp": stamp(time_ns),
        "frame_id": FRAME,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": True,
        "metadata": [],
        **empty,
        **primitives,
    }
    return {"deletions": [], "entities": [entity]}


def pose(x: float, y: float, z: float, orientation: tuple[float, float, float, float]) -> Message:
    """A place and a direction."""
    return {
        "position": {"x": x, "y": y, "z": z},
        "orientation": dict(zip("xyzw", orientation, strict=True)),
    }


def attitude(heading_deg: float, bank_deg: float) -> tuple[float, float, float, float]:
    """(x, y, z, w) that turns a body's axes, x ahead and z up, to a heading and then a bank.

    East is x and north is y: a heading of 90° is no turn, and headings grow against the angle of the plane.
    """
    yaw = math.radians(90.0 - heading_deg) if math.isfinite(heading_deg) else 0.0
    roll = math.radians(bank_deg)
    sine, cosine = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    roll_sine, roll_cosine = math.sin(roll / 2.0), math.cos(roll / 2.0)
    return (
        cosine * roll_sine,
        sine * roll_sine,
        sine * roll_cosine,
        cosine * roll_cosine,
    )


def colour_of(code: str, opacity: float) -> Message:
    """A colour such as #0072b2."""
    red, green, blue = (int(code[place : place + 2], 16) / 255.0 for place in (1, 3, 5))
    return {"r": red, "g": green, "b": blue, "a": opacity}


def stamp(time_ns: int) -> Message:
    """A time as Foxglove writes it."""
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    return {"sec": seconds, "nsec": nanoseconds}


def altitude_of_origin(record: FlightRecord) -> float:
    """Height of the local frame's origin, m above mean sea level."""
    return 0.0 if record.origin is None else record.origin.altitude_amsl_m
