"""Reader of ArduPilot's own logs, `.BIN`, from ArduPlane 3.9 on.

Format: an FMT message describes each kind of message before its first (ArduPilot, AP_Logger, LogStructure.h).
"""

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
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

GPS_EPOCH_UNIX_S = 315_964_800.0
WEEK_S = 604_800.0

LEAP_S = 18.0
"""Lead of GPS time over UTC, s; a wrong value would shift all aircraft alike."""

FIX_3D = 3
SYSTEM_ID_NAMES = {"MAV_SYSID", "SYSID_THISMAV"}

SYNC = b"\xa3\x95"
DESCRIPTION, DESCRIPTION_LENGTH = 128, 89
"""Number and length of an FMT message."""

CHUNK = 1 << 20
LONGEST = 255
"""Maximum message length, bytes."""

CODES = {**{letter: letter for letter in "bBhHiIfdqQ"}}
CODES |= {"g": "e", "n": "4s", "N": "16s", "Z": "64s", "a": "64s"}
CODES |= {"c": "h", "C": "H", "e": "i", "E": "I", "L": "i", "M": "B"}
SCALES = {**dict.fromkeys("cCeE", 0.01), "L": 1e-7}

Message = Mapping[str, Any]


class MessageLayout(msgspec.Struct, frozen=True):
    """Layout of a kind of message."""

    name: str
    length: int
    """Length with the three bytes of the header."""
    unpack: Callable[[bytes, int], tuple[Any, ...]] | None
    """Unpacking function; None where the description contradicts itself."""
    columns: tuple[tuple[str, float], ...]
    """Name and scale of each column; scale 0 for text."""


def _position(one: Message) -> tuple[float, ...] | None:
    # Before it has an origin, the estimator reports where the vehicle was left last.
    known = math.isfinite(one.get("RelOriginAlt", 0.0))
    return (one["Lat"], one["Lng"], one["Alt"]) if known else None


def _velocity(one: Message) -> tuple[float, ...] | None:
    # From 4.1 on all estimator cores share a kind of message; core 0 is read.
    return (one["VN"], one["VE"]) if one.get("C", 0) == 0 else None


def _satellite_time(one: Message) -> tuple[float, ...] | None:
    week, milliseconds = one["GWk"], one["GMS"]
    if not _has_fix(one) or (week, milliseconds) == (0, 0):
        return None
    return (GPS_EPOCH_UNIX_S + WEEK_S * week + 1e-3 * milliseconds - LEAP_S,)


def _satellite_position(one: Message) -> tuple[float, ...] | None:
    course, speed = math.radians(one["GCrs"]), one["Spd"]
    place = (one["Lat"], one["Lng"], one["Alt"])
    return (*place, speed * math.cos(course), speed * math.sin(course)) if _has_fix(one) else None


def _has_fix(one: Message) -> bool:
    return bool(one.get("I", 0) == 0 and one["Status"] >= FIX_3D)


def _airspeed(one: Message) -> tuple[float, ...] | None:
    """Return equivalent airspeed and the factor to true airspeed; factor 0 where it is not logged."""
    if "As" in one:
        return one["As"], one["E2T"]
    return (one["Aspd"], 0.0) if "Aspd" in one else None


READERS: dict[str, tuple[tuple[str, int, Callable[[Message], tuple[float, ...] | None]], ...]] = {
    "POS": (("POS", 4, _position),),
    "XKF1": (("XKF1", 3, _velocity),),
    "NKF1": (("NKF1", 3, _velocity),),
    "ATT": (("ATT", 3, lambda one: (math.radians(one["Roll"]), math.radians(one["Yaw"]))),),
    "CTUN": (("CTUN", 3, _airspeed),),
    "ARSP": (("ARSP", 3, lambda one: None if one.get("I", 0) else (one["Airspeed"], 0.0)),),
    "GPS": (("times", 2, _satellite_time), ("GPS", 6, _satellite_position)),
    "OFG": (("OFG", 3, lambda one: (one["Hdg"], one["Arsp"])),),
}
"""By kind of message: name of a table, its number of columns with the time, and their source."""


def read_dataflash(path: Path) -> AutopilotLog:
    """Read a log.

    Raises:
        InputError: the file is damaged, no such log, or without position or system ID.
    """
    rows = LogRows()
    system_id = None
    with log_file(path, "ArduPilot log") as stream:
        for name, one in messages(stream, {*READERS, "PARM"}):
            if name == "PARM":
                if one.get("Name") in SYSTEM_ID_NAMES and 0.0 < one.get("Value", 0.0) < 256.0:
                    system_id = one["Value"]
                continue
            for table, _, columns in READERS[name]:
                try:
                    values = columns(one)
                    time_s = 1e-6 * one["TimeUS"]
                except KeyError:
                    continue
                if values is not None:
                    rows.add(table, time_s, *values)
    found = {
        table: rows.table(table, count) for tables in READERS.values() for table, count, _ in tables
    }
    positions = with_courses(found)
    return AutopilotLog(
        path=path,
        autopilot="ArduPilot",
        system_id=told(path, system_id, positions),
        telemetry=telemetry_of(found, positions),
        setpoints=setpoints_of(found, positions),
        notes=rows.notes(path),
    )


def messages(stream: BinaryIO, wanted: set[str]) -> Iterator[tuple[str, Message]]:
    """Yield name and fields of each message of the wanted kinds; skip damaged data.

    Raises:
        ValueError: the stream describes no kind of message.
    """
    layouts: dict[int, MessageLayout] = {}
    lengths = {DESCRIPTION: DESCRIPTION_LENGTH}
    waiting, last = b"", False
    while not last:
        chunk = stream.read(CHUNK)
        waiting += chunk
        at, last = 0, len(chunk) < CHUNK
        while (at := waiting.find(SYNC, at)) >= 0 and at + 3 <= len(waiting):
            if not last and at + LONGEST > len(waiting):
                break
            kind = waiting[at + 2]
            end = at + lengths.get(kind, LONGEST + 1)
            if end > len(waiting) or kind not in lengths:
                at += 1
                continue
            if kind == DESCRIPTION:
                number, layout = layout_of(waiting[at + 3 : end])
                lengths[number], layouts[number] = layout.length, layout
            elif (layout := layouts[kind]).name in wanted and layout.unpack is not None:
                values = layout.unpack(waiting, at + 3)
                yield layout.name, fields_of(layout, values)
            at = end
        waiting = waiting[at:] if at >= 0 else waiting[-1:]
    if not layouts:
        raise ValueError("no message is described")


def layout_of(body: bytes) -> tuple[int, MessageLayout]:
    """Return number and layout of a kind of message from the body of its FMT message."""
    number, length, *texts = struct.unpack("<BB4s16s64s", body)
    name, letters, columns = (one.split(b"\0")[0].decode("ascii", "replace") for one in texts)
    form = struct.Struct("<" + "".join(CODES.get(letter, "") for letter in letters))
    names = columns.split(",")
    sound = form.size + 3 == length and len(names) == len(letters)
    scales = [0.0 if letter in "nNZa" else SCALES.get(letter, 1.0) for letter in letters]
    return number, MessageLayout(
        name=name,
        length=max(length, 3),
        unpack=form.unpack_from if sound else None,
        columns=tuple(zip(names, scales, strict=False)),
    )


def fields_of(layout: MessageLayout, values: tuple[Any, ...]) -> Message:
    """Return values by name, numbers scaled to their units and text decoded."""
    return {
        name: value * scale if scale else value.split(b"\0")[0].decode("ascii", "replace")
        for (name, scale), value in zip(layout.columns, values, strict=True)
    }


def with_courses(table: Mapping[str, FloatArray]) -> FloatArray:
    """Return rows of time, position and velocity by the estimator, or else by the satellite receiver."""
    positions = table["POS"]
    if not len(positions):
        return table["GPS"]
    when = positions[:, 0]
    for name in ("XKF1", "NKF1"):
        if len(velocity := table[name]):
            break
    else:
        velocity = table["GPS"][:, [0, 4, 5]]
    columns = [at_times(when, velocity[:, [0, column]]) for column in (1, 2)]
    return np.column_stack([positions, *columns])


def telemetry_of(table: Mapping[str, FloatArray], positions: FloatArray) -> Telemetry:
    """Make the telemetry of an autopilot from its tables."""
    attitude, airspeeds = table["ATT"], true_airspeeds(table, positions)
    times = table["times"].copy()
    times[:, 1] = in_this_era(times[:, 1])
    heading = at_times(positions[:, 0], unwrapped(attitude[:, [0, 2]]))
    return Telemetry(
        positions=np.column_stack([positions, heading]),
        airspeeds=airspeeds[:, :2],
        banks=attitude[:, :2],
        gps_times=times,
    )


def true_airspeeds(table: Mapping[str, FloatArray], positions: FloatArray) -> FloatArray:
    """Return rows of time, true airspeed and its ratio to equivalent airspeed, which ArduPilot controls.

    Logs up to 4.0 lack the ratio: that of the standard atmosphere is taken.
    """
    found = (table["CTUN"] if len(table["CTUN"]) else table["ARSP"]).copy()
    altitude = at_times(found[:, 0], positions[:, [0, 3]])
    # U.S. Standard Atmosphere 1976, below 11 km: the density ratio is (1 - 2.2558e-5 h) ** 4.2559.
    standard = np.clip(1.0 - 2.2558e-5 * altitude, 0.1, 2.0) ** (-0.5 * 4.2559)
    found[:, 2] = np.where(found[:, 2] > 0.0, found[:, 2], np.where(standard > 0.0, standard, 1.0))
    found[:, 1] *= found[:, 2]
    return found


def setpoints_of(table: Mapping[str, FloatArray], positions: FloatArray) -> FloatArray:
    """Return rows of time, course setpoint and true airspeed setpoint."""
    asked = table["OFG"].copy()
    factor = newest(asked[:, 0], true_airspeeds(table, positions)[:, [0, 2]])
    asked[:, 2] *= np.where(np.isfinite(factor), factor, 1.0)
    return asked
