"""What an autopilot said of itself, from a telemetry log: arrays of numbers, whatever else the file holds."""

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVError, MAVLink, MAVLink_message

from vfguide.elementwise import FloatArray
from vfguide.mavlink.codec import (
    UNKNOWN_HEADING,
    airspeed_report,
    position_report,
)
from vfguide.record.tlog import read_tlog

LONGEST_FLIGHT_S = 86_400.0
"""s around a recording's start in which frames can belong to it."""

ENVELOPE_S = 10.0
"""s over which the promptest frame tells how the autopilot's clock and the computer's are apart."""

ColumnsOf = Callable[[MAVLink_message], tuple[float, ...] | None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Telemetry:
    """Rows in the order in which they came, first the time, s since 1970 by the companion's computer."""

    positions: FloatArray
    """Time, latitude and longitude in degrees, altitude in m, velocity north and east in m/s, heading in rad
    or NaN."""
    airspeeds: FloatArray
    """Time, true airspeed as reported, m/s."""
    banks: FloatArray
    """Time, roll angle, rad."""
    gps_times: FloatArray
    """Time, s since 1970 by satellite navigation."""


def read_telemetry(path: Path, *, system_id: int, start_s: float) -> Telemetry:
    """The telemetry of one vehicle.

    Args:
        path: of the log.
        system_id: of the vehicle; frames of others, the companion's own among them, are left out.
        start_s: when the log was begun, s since 1970.

    Raises:
        InputError: it cannot be read, or is too large.
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
"""What is read of a log."""


def as_rows(values: Sequence[float], columns: int) -> FloatArray:
    """Rows that were written one behind the other."""
    return np.array(values, dtype=np.float64).reshape(-1, columns)


def by_boot_clock(arrivals_s: FloatArray, boot_s: FloatArray) -> FloatArray:
    """When reports were made, by the autopilot's clock, which the promptest of ten seconds ties to ours.

    Frames are late by how long they waited for the wire, up to tenths of a second. A clock that goes back
    belongs to an autopilot that was started anew, and is tied anew.

    Args:
        arrivals_s: N times at which reports came, s, ascending.
        boot_s: the autopilot's time in each, s.
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
