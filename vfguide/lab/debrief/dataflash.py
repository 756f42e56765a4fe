"""ArduPilot's own logs, `.BIN`, read by pymavlink's DFReader."""

import math
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pymavlink.DFReader import DFReader_binary

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
from vfguide.lab.debrief.telemetry import Telemetry, as_rows

GPS_EPOCH_UNIX_S = 315_964_800.0
WEEK_S = 604_800.0

LEAP_S = 18.0
"""s by which GPS time is ahead of UTC; the same for all aircraft, so that it moves none against another."""

FIX_3D = 3
SYSTEM_ID_NAMES = {"MAV_SYSID", "SYSID_THISMAV"}

MOST_ROWS = 20_000_000
"""Rows of all kinds; ten hours have fewer."""


def _position(one: Any) -> tuple[float, ...] | None:  # noqa: ANN401
    # Before the estimator has an origin, it says where the vehicle was left last.
    return (one.Lat, one.Lng, one.Alt) if math.isfinite(one.RelOriginAlt) else None


def _velocity(one: Any) -> tuple[float, ...] | None:  # noqa: ANN401
    return (one.VN, one.VE) if one.C == 0 else None


def _satellite_time(one: Any) -> tuple[float, ...] | None:  # noqa: ANN401
    if one.I != 0 or one.Status < FIX_3D or one.GWk <= 0:
        return None
    return (GPS_EPOCH_UNIX_S + WEEK_S * one.GWk + 1e-3 * one.GMS - LEAP_S,)


READERS: dict[str, tuple[int, Callable[[Any], tuple[float, ...] | None]]] = {
    "POS": (4, _position),
    "XKF1": (3, _velocity),
    "NKF1": (3, _velocity),
    "ATT": (3, lambda one: (math.radians(one.Roll), math.radians(one.Yaw))),
    "CTUN": (3, lambda one: (one.As * one.E2T, one.E2T)),
    "GPS": (2, _satellite_time),
    "OFG": (3, lambda one: (one.Hdg, one.Arsp)),
}
"""What is read: how many columns with the time, and which."""


def read_dataflash(path: Path) -> AutopilotLog:
    """One log.

    Raises:
        InputError: it is damaged, something else, or tells no position or no system id.
    """
    rows = {kind: array("d") for kind in READERS}
    system_id = None
    # DFReader raises errors of no class of their own.
    with foreign_file(path, "ArduPilot log", Exception), opened(path) as log:
        left = MOST_ROWS
        while left and (one := log.recv_match(type=[*READERS, "PARM"])) is not None:
            left -= 1
            kind = one.get_type()
            if kind == "PARM":
                if one.Name in SYSTEM_ID_NAMES:
                    system_id = int(one.Value)
                continue
            columns = READERS[kind][1](one)
            if columns is not None:
                rows[kind].extend((1e-6 * one.TimeUS, *map(float, columns)))
    table = {kind: in_order(as_rows(rows[kind], count)) for kind, (count, _) in READERS.items()}
    if system_id is None or not len(table["POS"]):
        missing = "system id" if system_id is None else "position"
        raise InputError(
            f"{path}: tells no {missing}; give the log of a flight, from its beginning"
        )
    return AutopilotLog(
        path=path,
        autopilot="ArduPilot",
        system_id=system_id,
        telemetry=telemetry_of(table),
        setpoints=setpoints_of(table),
    )


@contextmanager
def opened(path: Path) -> Iterator[DFReader_binary]:
    """A reader whose file is closed at the end, also where it fails while it is being made."""
    log = DFReader_binary.__new__(DFReader_binary)
    try:
        log.__init__(str(path))
        yield log
    finally:
        # What it has mapped is still looked at by an error that is on its way, and goes with it.
        if hasattr(log, "filehandle"):
            log.filehandle.close()


def telemetry_of(table: dict[str, FloatArray]) -> Telemetry:
    """What the autopilot knew of itself."""
    positions, attitude = table["POS"], table["ATT"]
    velocity = table["XKF1"] if len(table["XKF1"]) else table["NKF1"]
    when = positions[:, 0]
    return Telemetry(
        positions=np.column_stack(
            [
                positions,
                at_times(when, velocity[:, :2]),
                at_times(when, velocity[:, [0, 2]]),
                at_times(when, unwrapped(attitude[:, [0, 2]])),
            ]
        ),
        airspeeds=table["CTUN"][:, :2],
        banks=attitude[:, :2],
        gps_times=table["GPS"],
    )


def setpoints_of(table: dict[str, FloatArray]) -> FloatArray:
    """Courses and true airspeeds that were asked for; ArduPilot holds equivalent ones."""
    asked = table["OFG"].copy()
    factor = newest(asked[:, 0], table["CTUN"][:, [0, 2]])
    asked[:, 2] *= np.where(np.isfinite(factor), factor, 1.0)
    return asked
