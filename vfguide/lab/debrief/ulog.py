"""Reader of PX4's own logs, `.ulg`, from PX4 1.10 on.

Format: docs.px4.io, ULog File Format. Only the wanted fields of a topic are unpacked, however large its
description says that it is.
"""

import re
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.lab.debrief.autopilot_log import (
    AutopilotLog,
    LogRows,
    Telemetry,
    at_times,
    in_this_era,
    log_file,
    newest,
    told,
    unwrapped,
)

MAGIC = b"ULog\x01\x12\x35"
SYNC = b"\x2f\x73\x13\x20\x25\x0c\xbb\x12"
KINDS = b"BFIMPQARDLCSO"
SYSTEM_ID = b"int32_t MAV_SYS_ID"

NUMBERS = {"int8_t": "b", "uint8_t": "B", "bool": "B", "char": "B", "int16_t": "h", "uint16_t": "H"}
NUMBERS |= {"int32_t": "i", "uint32_t": "I", "int64_t": "q", "uint64_t": "Q"}
NUMBERS |= {"float": "f", "double": "d"}

LONGEST = 0xFFFF
"""Maximum size of a message, bytes; a description of a larger one is invalid."""

DEEPEST = 8
"""Maximum nesting depth of topics."""

FIELD = re.compile(r"([a-zA-Z_]\w*)(?:\[(\d{1,6})\])? (\w+)")

TOPICS: dict[str, tuple[tuple[str, ...], ...]] = {
    "vehicle_global_position": (("lat", "lon", "alt"),),
    # Up to 1.11 the heading was called yaw.
    "vehicle_local_position": (("vx", "vy", "heading"), ("vx", "vy", "yaw")),
    "vehicle_attitude": (("q[0]", "q[1]", "q[2]", "q[3]"),),
    # True and equivalent airspeed; only up to 1.11 the second was called equivalent.
    "airspeed_validated": (
        ("true_airspeed_m_s", "calibrated_airspeed_m_s"),
        ("true_airspeed_m_s", "equivalent_airspeed_m_s"),
    ),
    "airspeed": (("true_airspeed_m_s", "indicated_airspeed_m_s"),),
    "vehicle_gps_position": (("time_utc_usec",),),
    "sensor_gps": (("time_utc_usec",),),
    "fixed_wing_lateral_setpoint": (("course",),),
    "fixed_wing_longitudinal_setpoint": (("equivalent_airspeed",),),
}
"""Fields read of each topic, with alternative names: the first set that exists is used."""

FINEST_POSITION_S = 0.04
"""Least interval of positions that are kept, s: PX4 writes a hundred per second."""


class TopicField(NamedTuple):
    """Field of a topic's description: kind of number or nested topic, array length and name."""

    kind: str
    length: int
    name: str


def read_ulog(path: Path) -> AutopilotLog:
    """Read a log.

    Raises:
        InputError: the file is damaged, no such log, or without position or system ID.
    """
    rows = LogRows()
    system_id = None
    with log_file(path, "PX4 log") as stream:
        for name, value in messages(stream):
            if isinstance(value, float):
                system_id = value if system_id is None else system_id
            else:
                rows.add(name, 1e-6 * value[0], *value[1:])
    table = {name: rows.table(name, 1 + len(ways[0])) for name, ways in TOPICS.items()}
    position = thinned(table["vehicle_global_position"])
    velocity, attitude = table["vehicle_local_position"], table["vehicle_attitude"]
    airspeed = table["airspeed_validated"]
    airspeed = airspeed if len(airspeed) else table["airspeed"]
    satellite = table["vehicle_gps_position"]
    satellite = satellite if len(satellite) else table["sensor_gps"]
    satellite = satellite[satellite[:, 1] > 0.0]
    satellite[:, 1] = in_this_era(1e-6 * satellite[:, 1])
    course, speed = (table[f"fixed_wing_{one}_setpoint"] for one in ("lateral", "longitudinal"))
    system = told(path, system_id, position)
    when, asked_at = position[:, 0], course[:, 0]
    true, equivalent = (at_times(asked_at, airspeed[:, [0, one]]) for one in (1, 2))
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = true / equivalent
    asked = newest(asked_at, speed) * np.where(np.isfinite(factor), factor, 1.0)
    return AutopilotLog(
        path=path,
        autopilot="PX4",
        system_id=system,
        telemetry=Telemetry(
            positions=np.column_stack(
                [
                    position,
                    at_times(when, velocity[:, :2]),
                    at_times(when, velocity[:, [0, 2]]),
                    at_times(when, unwrapped(velocity[:, [0, 3]])),
                ]
            ),
            airspeeds=airspeed[:, :2],
            banks=np.column_stack([attitude[:, 0], roll_of(attitude[:, 1:])]),
            gps_times=satellite,
        ),
        setpoints=np.column_stack([course, asked]),
        notes=rows.notes(path),
    )


def messages(stream: BinaryIO) -> Iterator[tuple[str, float | tuple[float, ...]]]:
    """Yield (topic, (time in µs, wanted fields)) and ("", system ID); for errors see `entries`."""
    topics: dict[str, list[TopicField]] = {}
    readers: dict[int, tuple[str, struct.Struct, tuple[int, ...]]] = {}
    for kind, body in entries(stream):
        if kind == b"F":
            name, _, described = body.decode("ascii", "replace").partition(":")
            topics[name] = fields_of(described)
        elif kind == b"P" and body[1:19] == SYSTEM_ID and len(body) == 23:
            yield "", float(struct.unpack_from("<i", body, 19)[0])
        elif kind == b"A" and len(body) > 3 and body[0] == 0:
            name = body[3:].decode("ascii", "replace")
            if (reader := reader_of(name, topics)) is not None:
                readers[int.from_bytes(body[1:3], "little")] = (name, *reader)
        elif kind == b"D" and (found := readers.get(int.from_bytes(body[:2], "little"))):
            name, form, order = found
            if len(body) >= form.size + 2:
                values = form.unpack_from(body, 2)
                yield name, tuple(float(values[at]) for at in order)


def entries(stream: BinaryIO) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and body of each entry of a log, which may be cut off.

    Raises:
        ValueError: the stream is no ULog, or has an unknown variant of the format.
    """
    if stream.read(16)[:7] != MAGIC:
        raise ValueError("is no ULog")
    appended: list[int] = []
    while len(head := stream.read(3)) == 3:
        size, kind = int.from_bytes(head[:2], "little"), head[2:]
        if kind not in KINDS:
            if not to_next_sync(stream):
                return
            continue
        body = stream.read(size)
        if appended and stream.tell() > appended[0]:
            # The log goes on at the data appended during a failure, which cut off the message before.
            stream.seek(appended.pop(0))
        elif len(body) < size:
            return
        else:
            if kind == b"B" and size >= 40:
                appended = appended_at(body)
            yield kind, body


def to_next_sync(stream: BinaryIO) -> bool:
    """Seek behind the next sync mark of a damaged log; return whether there is one."""
    start = stream.seek(-2, 1)
    waiting = b""
    while chunk := stream.read(1 << 16):
        waiting += chunk
        if (found := waiting.find(SYNC)) >= 0:
            stream.seek(start + found + len(SYNC))
            return True
        start += max(len(waiting) - len(SYNC), 0)
        waiting = waiting[-len(SYNC) :]
    return False


def appended_at(flags: bytes) -> list[int]:
    """Return the offsets of appended data from the body of the flags entry, in order.

    Raises:
        ValueError: the log has unknown incompatible flags.
    """
    if flags[8] & ~1 or any(flags[9:16]):
        raise ValueError("has flags that are not known")
    offsets = struct.unpack_from("<3Q", flags, 16) if flags[8] else ()
    return sorted(one for one in offsets if 16 < one < 1 << 40)


def fields_of(described: str) -> list[TopicField]:
    """Return the fields of a topic's description; none where it is not valid."""
    found = [FIELD.fullmatch(one.strip()) for one in described.rstrip(";").split(";")]
    return (
        [TopicField(one[1], int(one[2] or 1), one[3]) for one in found if one] if all(found) else []
    )


def reader_of(
    name: str, topics: Mapping[str, list[TopicField]]
) -> tuple[struct.Struct, tuple[int, ...]] | None:
    """Return the structure of a topic's time and wanted fields in a message, and the order to put them in."""
    places: dict[str, tuple[int, str]] = {}
    at = 0
    sizes: dict[str, int] = {}
    for field in topics.get(name, ()):
        number = NUMBERS.get(field.kind)
        size = size_of(field.kind, topics, sizes, DEEPEST)
        if number is not None and field.length <= 4:
            for index in range(field.length):
                places[f"{field.name}[{index}]"] = at + index * size, number
            places[field.name] = at, number
        at += size * field.length
        if at > LONGEST or not size:
            break
    for way in TOPICS.get(name, ()):
        wanted = ("timestamp", *way)
        if all(one in places for one in wanted):
            ordered = sorted(wanted, key=lambda one: places[one][0])
            form, end = "<", 0
            for one in ordered:
                offset, number = places[one]
                form += f"{offset - end}x{number}"
                end = offset + struct.calcsize(number)
            return struct.Struct(form), tuple(ordered.index(one) for one in wanted)
    return None


def size_of(
    kind: str, topics: Mapping[str, list[TopicField]], sizes: dict[str, int], deepest: int
) -> int:
    """Return the size of a kind of field, bytes; 0 where it is unknown or impossibly large."""
    if (number := NUMBERS.get(kind)) is not None:
        return struct.calcsize(number)
    if kind not in sizes:
        sizes[kind] = 0
        parts = [
            size_of(one.kind, topics, sizes, deepest - 1) * one.length if deepest else 0
            for one in topics.get(kind, ())
        ]
        sizes[kind] = sum(parts) if all(parts) and sum(parts) <= LONGEST else 0
    return sizes[kind]


def thinned(rows: FloatArray) -> FloatArray:
    """Return the first row of each time step of `FINEST_POSITION_S`."""
    steps = np.floor(rows[:, 0] / FINEST_POSITION_S)
    return rows[np.flatnonzero(np.diff(steps, prepend=-1.0))]


def roll_of(quaternions: FloatArray) -> FloatArray:
    """Return bank angles, rad, of attitude quaternions (w, x, y, z)."""
    w, x, y, z = quaternions.T
    roll: FloatArray = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll
