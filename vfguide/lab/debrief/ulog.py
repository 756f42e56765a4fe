"""PX4's own logs, `.ulg`, read by pyulog."""

from pathlib import Path
from typing import Any

import numpy as np
from pyulog import ULog
from pyulog.exceptions import ULogException

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import (
    AutopilotLog,
    at_times,
    foreign_file,
    in_order,
    newest,
    unwrapped,
)
from vfguide.lab.debrief.telemetry import Telemetry
from vfguide.regular_file import open_regular

TOPICS = (
    "vehicle_global_position",
    "vehicle_local_position",
    "vehicle_attitude",
    "airspeed_validated",
    "vehicle_gps_position",
    "sensor_gps",
    "fixed_wing_lateral_setpoint",
    "fixed_wing_longitudinal_setpoint",
)
"""What is read; everything else is skipped."""

FINEST_STEP_S = 0.04
"""s between two positions that are kept: PX4 writes a hundred a second."""


def read_ulog(path: Path) -> AutopilotLog:
    """One log.

    Raises:
        InputError: it is damaged, something else, or tells no position or no system id.
    """
    with foreign_file(path, "PX4 log", ULogException), open_regular(path) as file:
        log = ULog(file, message_name_filter_list=list(TOPICS))
        system_id = log.initial_parameters.get("MAV_SYS_ID")
        position = table_of(log, "vehicle_global_position", "lat", "lon", "alt")
        velocity = table_of(log, "vehicle_local_position", "vx", "vy", "heading")
        attitude = table_of(log, "vehicle_attitude", "q[0]", "q[1]", "q[2]", "q[3]")
        airspeed = table_of(log, "airspeed_validated", "true_airspeed_m_s")
        equivalent = table_of(log, "airspeed_validated", "calibrated_airspeed_m_s")
        satellite = table_of(log, "vehicle_gps_position", "time_utc_usec")
        if not len(satellite):
            satellite = table_of(log, "sensor_gps", "time_utc_usec")
        course = table_of(log, "fixed_wing_lateral_setpoint", "course")
        speed = table_of(log, "fixed_wing_longitudinal_setpoint", "equivalent_airspeed")
    if system_id is None or not len(position):
        missing = "system id" if system_id is None else "position"
        raise InputError(
            f"{path}: tells no {missing}; give the log of a flight, from its beginning"
        )
    position = thinned(position)
    when = position[:, 0]
    satellite = satellite[satellite[:, 1] > 0.0]
    satellite[:, 1] *= 1e-6
    factor = at_times(course[:, 0], airspeed) / at_times(course[:, 0], equivalent)
    asked = newest(course[:, 0], speed) * np.where(np.isfinite(factor), factor, 1.0)
    return AutopilotLog(
        path=path,
        autopilot="PX4",
        system_id=int(system_id),
        telemetry=Telemetry(
            positions=np.column_stack(
                [
                    position,
                    at_times(when, velocity[:, :2]),
                    at_times(when, velocity[:, [0, 2]]),
                    at_times(when, unwrapped(velocity[:, [0, 3]])),
                ]
            ),
            airspeeds=airspeed,
            banks=np.column_stack([attitude[:, 0], roll_of(attitude[:, 1:])]),
            gps_times=satellite,
        ),
        setpoints=np.column_stack([course, asked]),
    )


def table_of(log: Any, topic: str, *names: str) -> FloatArray:  # noqa: ANN401
    """Time in s and some fields of a topic; no rows where the log has no such topic or field."""
    for data in log.data_list:
        if data.name == topic and data.multi_id == 0 and all(name in data.data for name in names):
            # A damaged number may be a signalling NaN, of which NumPy would warn.
            with np.errstate(invalid="ignore"):
                columns = [np.asarray(data.data[name], dtype=np.float64) for name in names]
            times = 1e-6 * np.asarray(data.data["timestamp"], dtype=np.float64)
            return in_order(np.column_stack([times, *columns]))
    return np.empty((0, 1 + len(names)))


def thinned(rows: FloatArray) -> FloatArray:
    """Rows with no more than one in each step of time."""
    steps = np.floor(rows[:, 0] / FINEST_STEP_S)
    return rows[np.flatnonzero(np.diff(steps, prepend=-1.0))]


def roll_of(quaternions: FloatArray) -> FloatArray:
    """Bank angle of attitudes (w, x, y, z), from the ground's frame to the body's, rad."""
    w, x, y, z = quaternions.T
    roll: FloatArray = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    return roll
