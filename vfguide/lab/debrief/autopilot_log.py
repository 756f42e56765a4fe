"""Flight data of an autopilot, from telemetry or its own log, independent of the autopilot's make."""

import os
import struct
from array import array
from collections.abc import Callable, Iterator, MutableSequence, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVError, MAVLink, MAVLink_message

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.mavlink.codec import UNKNOWN_HEADING, airspeed_report, position_report
from vfguide.record.tlog import read_tlog
from vfguide.regular_file import open_regular

LONGEST_FLIGHT_S = 86_400.0
"""Largest time difference from a recording's start at which frames can belong to it."""

ENVELOPE_S = 10.0
"""Window in which the promptest frame gives the offset between the autopilot's clock and the computer's."""

ColumnsOf = Callable[[MAVLink_message], tuple[float, ...] | None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Telemetry:
    """Reports in order of arrival; the first column is the companion computer's time, s since 1970."""

    positions: FloatArray
    """Time, latitude and longitude in degrees, altitude in m, velocity north and east in m/s, heading in rad
    or NaN."""
    airspeeds: FloatArray
    """Time, true airspeed as reported in m/s."""
    banks: FloatArray
    """Time, roll angle in rad."""
    gps_times: FloatArray
    """Time, satellite time in s since 1970."""


def read_telemetry(path: Path, *, system_id: int, start_s: float) -> Telemetry:
    """Read one vehicle's telemetry from a log begun at `start_s`, s since 1970.

    Frames of other vehicles and of the companion are left out.

    Raises:
        InputError: the log cannot be read, or is too large.
    """
    rows = {kind: array("d") for kind in READERS}
    parser = MAVLink(None)
    for stamped in read_tlog(path):
        frame = stamped.frame
        reader = READERS.get(frame.message_id)
        if reader is None or frame.system_id != system_id or frame.component_id != AUTOPILOT:
            continue
        if abs(stamped.time_s - start_s) > LONGEST_FLIGHT_S:
            continue
        try:
            columns = reader(parser.decode(bytearray(frame.content)))
        except MAVError:
            continue
        if columns is not None:
            rows[frame.message_id].extend((stamped.time_s, *columns))
    positions = as_rows(rows[mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT], 8)
    times = by_boot_clock(positions[:, 0], positions[:, 1])
    return Telemetry(
        positions=np.column_stack([times, positions[:, 2:]]),
        airspeeds=as_rows(rows[mavlink.MAVLINK_MSG_ID_VFR_HUD], 2),
        banks=as_rows(rows[mavlink.MAVLINK_MSG_ID_ATTITUDE], 2),
        gps_times=as_rows(rows[mavlink.MAVLINK_MSG_ID_SYSTEM_TIME], 2),
    )


AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1


def _position(message: MAVLink_message) -> tuple[float, ...] | None:
    report = position_report(message)
    if report is None or (report.latitude_deg == 0.0 and report.longitude_deg == 0.0):
        return None
    heading = float("nan") if message.hdg == UNKNOWN_HEADING else report.heading
    return (
        report.boot_time_s,
        report.latitude_deg,
        report.longitude_deg,
        report.altitude_amsl,
        report.velocity_north,
        report.velocity_east,
        float("nan") if heading is None else heading,
    )


def _airspeed(message: MAVLink_message) -> tuple[float, ...] | None:
    report = airspeed_report(message)
    return None if report is None else (report.airspeed,)


def _bank(message: MAVLink_message) -> tuple[float, ...] | None:
    return (message.roll,) if abs(message.roll) <= np.pi else None


def _gps_time(message: MAVLink_message) -> tuple[float, ...] | None:
    return (message.time_unix_usec * 1e-6,) if message.time_unix_usec else None


READERS: dict[int, ColumnsOf] = {
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: _position,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: _airspeed,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: _bank,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: _gps_time,
}
"""Functions that read messages, by message id."""


def as_rows(values: Sequence[float], columns: int) -> FloatArray:
    """Reshape values that were appended row by row."""
    return np.array(values, dtype=np.float64).reshape(-1, columns)


def by_boot_clock(arrivals_s: FloatArray, boot_s: FloatArray) -> FloatArray:
    """Return when reports were made: boot times, offset by the promptest report of each ten seconds.

    Frames wait for the serial line, up to tenths of a second. A clock that goes back belongs to a restarted
    autopilot, and gets a new offset. `arrivals_s` has to ascend.
    """
    made = arrivals_s.copy()
    starts = np.flatnonzero(np.diff(boot_s) < 0.0) + 1
    for part in np.split(np.arange(arrivals_s.size), starts):
        if part.size < 2:
            continue
        late = arrivals_s[part] - boot_s[part]
        window = ((boot_s[part] - boot_s[part][0]) // ENVELOPE_S).astype(np.int64)
        edges = np.flatnonzero(np.diff(window, prepend=-1))
        least = np.minimum.reduceat(late, edges)
        middles = boot_s[part][edges] + 0.5 * ENVELOPE_S
        made[part] = boot_s[part] + np.interp(boot_s[part], middles, least)
    return made


GREATEST_SIZE = 1024**3
"""Largest log in bytes: an hour of PX4 at its usual rates is 500 MB."""

DAMAGE = (ArithmeticError, LookupError, ValueError, struct.error)
"""Exceptions that foreign or damaged bytes raise."""

REMEDY = "give the log of one flight, as the autopilot wrote it"

FINEST_STEP_S = 0.01
"""Shortest interval between kept rows of a kind."""

MOST_ROWS = 4_000_000
"""Largest number of rows kept of a log: ten hours at a hundred per second, which bounds the memory."""

ERA_S = 1024 * 604_800.0
"""Period of a receiver's ten-bit week number."""

ERA_BEGIN_UNIX_S = 1_483_228_800.0
"""Start of 2017, which is before all logs read here."""


class LogRows:
    """Rows of numbers by kind, thinned and limited in number."""

    def __init__(self, finest_step_s: float = FINEST_STEP_S) -> None:
        """Begin without rows; `finest_step_s` is the shortest interval between rows of a kind."""
        self._finest_step_s = finest_step_s
        self._values: dict[str, MutableSequence[float]] = {}
        self._newest: dict[str, float] = {}
        self._left = MOST_ROWS
        self._is_cut = False

    def add(self, kind: str, time_s: float, *values: float) -> None:
        """Keep a row unless it is too close in time to the last of its kind."""
        if abs(time_s - self._newest.get(kind, -np.inf)) >= self._finest_step_s:
            if not self._left:
                self._is_cut = True
                return
            self._left -= 1
            self._newest[kind] = time_s
            self._values.setdefault(kind, array("d")).extend((time_s, *values))

    def notes(self, path: Path) -> tuple[str, ...]:
        """Return remarks for the reader on a file's rows."""
        if not self._is_cut:
            return ()
        return (
            f"only the first {MOST_ROWS} rows of {path.name} are read: what came later is left out",
        )

    def table(self, kind: str, columns: int, needed: int | None = None) -> FloatArray:
        """Return a kind's rows by time; the first `needed` columns must be finite, all if None."""
        return in_order(as_rows(self._values.get(kind, array("d")), columns), needed)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AutopilotLog:
    """Contents of one autopilot log."""

    path: Path
    autopilot: str
    """Autopilot that wrote the log, such as ArduPlane."""
    system_id: int
    telemetry: Telemetry
    """Estimates of the autopilot; times count from its start."""
    setpoints: FloatArray
    """Rows of time in s, commanded course over ground in rad and commanded airspeed in m/s."""
    ground: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    """Rows of autopilot time and of the offset to the time of the computer that wrote the log, s."""
    notes: tuple[str, ...] = ()
    """Further remarks for the reader."""


@contextmanager
def log_file(path: Path, kind: str) -> Iterator[BinaryIO]:
    """Open a log of some kind; every fault becomes an error of one line.

    Raises:
        InputError: the file cannot be read, is too large, or is of another kind.
    """
    try:
        with open_regular(path) as stream:
            size = stream.seek(0, os.SEEK_END)
            if size > GREATEST_SIZE:
                raise InputError(
                    f"{path}: has {size / 1e6:.0f} MB, more than the {GREATEST_SIZE / 1e6:.0f} MB "
                    f"that are read; {REMEDY}"
                )
            stream.seek(0)
            yield stream
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}; {REMEDY}") from error
    except DAMAGE as error:
        raise InputError(f"{path}: is no {kind}, or a damaged one; {REMEDY}") from error


def told(path: Path, system_id: float | None, positions: FloatArray) -> int:
    """Return the system id of a log, which must also hold positions.

    Raises:
        InputError: the system id or positions are missing.
    """
    if system_id is None or not len(positions):
        missing = "system id" if system_id is None else "position"
        raise InputError(
            f"{path}: tells no {missing}; give the log of a flight, from its beginning"
        )
    return int(system_id)


def in_this_era(unix_s: FloatArray) -> FloatArray:
    """Correct satellite times, s since 1970, for receivers in the wrong era of week numbers."""
    era: FloatArray = ERA_BEGIN_UNIX_S + np.mod(unix_s - ERA_BEGIN_UNIX_S, ERA_S)
    return era


def at_times(moments: FloatArray, rows: FloatArray) -> FloatArray:
    """Interpolate the second column at other times; NaN outside the rows."""
    if len(rows) < 2:
        return np.full(moments.shape, np.nan)
    values: FloatArray = np.interp(moments, rows[:, 0], rows[:, 1], left=np.nan, right=np.nan)
    return values


def newest(moments: FloatArray, rows: FloatArray) -> FloatArray:
    """Return the second column of the newest row at each moment; NaN before the first."""
    if not len(rows):
        return np.full(moments.shape, np.nan)
    found = np.searchsorted(rows[:, 0], moments, side="right") - 1
    values: FloatArray = np.where(found >= 0, rows[np.maximum(found, 0), 1], np.nan)
    return values


def unwrapped(rows: FloatArray) -> FloatArray:
    """Return rows of time and angle with the angle unwrapped."""
    whole = rows.copy()
    whole[:, 1] = np.unwrap(rows[:, 1])
    return whole


def in_order(rows: FloatArray, needed: int | None = None) -> FloatArray:
    """Return rows by time; the first `needed` columns must be finite, all if None."""
    known = rows[np.all(np.isfinite(rows[:, :needed]), axis=1)]
    return known[np.argsort(known[:, 0], kind="stable")]
