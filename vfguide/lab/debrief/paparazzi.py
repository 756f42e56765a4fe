"""Reader of Paparazzi's logs as its log plotter exports them: `.csv`, a column for each message field.

The export names no aircraft: the file's name does. Columns are chosen by the user, in any order. Values are
those of the messages (Paparazzi, messages.xml, GPS): centimetres, tenths of degrees, milliseconds.
"""

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

import numpy as np

from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import (
    AutopilotLog,
    LogRows,
    Telemetry,
    at_times,
    in_this_era,
    log_file,
    told,
    unwrapped,
)
from vfguide.lab.debrief.dataflash import GPS_EPOCH_UNIX_S, LEAP_S, WEEK_S
from vfguide.mission.model import Mission

SEPARATORS = ("\t", ";", ",")
LONGEST_LINE = 16_384
"""Maximum length of a line, bytes: some thousand columns."""

LONGEST_WAIT_S = 1.0
"""Greatest time by which a row is taken to follow the newest satellite time, s."""

NAMES = {
    "time": ("time",),
    "latitude": ("gps_lat(deg)",),
    "longitude": ("gps_long(deg)", "gps_lon(deg)"),
    "east": ("gps:utm_east",),
    "north": ("gps:utm_north",),
    "zone": ("gps:utm_zone",),
    "altitude": ("gps:alt", "gps_lla:alt"),
    "course": ("gps:course", "gps_lla:course"),
    "speed": ("gps:speed", "gps_lla:speed"),
    "week": ("gps:week", "gps_lla:week"),
    "itow": ("gps:itow", "gps_lla:itow"),
    "bank": ("attitude:phi",),
    "heading": ("attitude:psi",),
    "airspeed": ("airspeed:airspeed",),
}
"""Possible column names of each value that is read."""

Values = Mapping[str, float]


def read_paparazzi(path: Path, mission: Mission) -> AutopilotLog:
    """Read an export.

    Raises:
        InputError: the file is no export, names no vehicle of the mission, or has no position.
    """
    system_id = vehicle_of(path, mission)
    rows = LogRows()
    with log_file(path, "export of Paparazzi's") as stream:
        has_itow = read_rows(stream, rows, place_of(northern=mission.origin.latitude_deg >= 0.0))
    positions = rows.table("positions", 6)
    told(path, system_id, positions)
    heading = unwrapped(rows.table("heading", 2))
    times = rows.table("times", 2)
    times[:, 1] = in_this_era(times[:, 1])
    return AutopilotLog(
        path=path,
        autopilot="Paparazzi",
        system_id=system_id,
        telemetry=Telemetry(
            positions=np.column_stack([positions, at_times(positions[:, 0], heading)]),
            airspeeds=rows.table("airspeed", 2),
            banks=rows.table("bank", 2),
            gps_times=times if has_itow else times[:0],
        ),
        setpoints=np.empty((0, 3)),
        notes=rows.notes(path),
    )


def vehicle_of(path: Path, mission: Mission) -> int:
    """Return the system ID of the vehicle that a file is named after: `lead.csv` or `lead_2026.csv`.

    Raises:
        InputError: the file is named after no vehicle, or several.
    """
    parts = {path.stem, *re.split(r"[^A-Za-z0-9]+", path.stem)}
    found = [one.system_id for name, one in mission.vehicles.items() if name in parts]
    if len(found) != 1:
        names = ", ".join(f"{name}.csv" for name in list(mission.vehicles)[:3])
        raise InputError(
            f"{path}: does not say which aircraft it is of; name the file after the vehicle, such as {names}"
        )
    return found[0]


def read_rows(
    stream: BinaryIO, rows: LogRows, place: Callable[[Values], tuple[float, float] | None]
) -> bool:
    """Read an export into rows, and return whether it has satellite time.

    Raises:
        ValueError: time or altitude is missing.
    """
    head = stream.readline(LONGEST_LINE).decode("utf-8-sig")
    separator = max(SEPARATORS, key=head.count)
    columns = [one.strip().strip('"').lower() for one in head.split(separator)]
    where = {
        name: columns.index(found)
        for name, names in NAMES.items()
        if (found := next((one for one in names if one in columns), None)) is not None
    }
    if not {"time", "altitude"} <= where.keys():
        raise ValueError("no time or altitude")
    newest: tuple[object, float, float] | None = None
    while line := stream.readline(LONGEST_LINE):
        cells = line.decode("ascii", "replace").split(separator)
        one = {name: number(cells[at]) for name, at in where.items() if at < len(cells)}
        seen = one.get("time", math.nan)
        fix = tuple(one.get(name, 0.0) for name in ("week", "itow")) if "itow" in where else seen
        if not math.isfinite(seen):
            continue
        if newest is None or fix != newest[0]:
            # Rows repeat the last message: only a new satellite time is that of its row.
            satellite_s = satellite_time(one)
            time_s = satellite_s if math.isfinite(satellite_s) else seen
            newest = fix, time_s, seen
            add_position(rows, time_s, one, place)
            rows.add("times", time_s, satellite_s)
        _, fixed_s, fixed_seen = newest
        time_s = fixed_s + min(max(seen - fixed_seen, 0.0), LONGEST_WAIT_S)
        for name in ("bank", "heading", "airspeed"):
            if name in one:
                rows.add(name, time_s, one[name])
    return "itow" in where


def add_position(
    rows: LogRows, time_s: float, one: Values, place: Callable[[Values], tuple[float, float] | None]
) -> None:
    """Add a position with its ground velocity, where it is known."""
    if (found := place(one)) is not None:
        speed = 0.01 * one.get("speed", math.nan)
        course = math.radians(0.1 * one.get("course", math.nan))
        velocity = (speed * math.cos(course), speed * math.sin(course))
        rows.add("positions", time_s, *found, 1e-3 * one.get("altitude", math.nan), *velocity)


def satellite_time(one: Values) -> float:
    """Return satellite time, s since 1970; without a week, in GPS week 0, which `in_this_era` corrects."""
    itow = 1e-3 * one.get("itow", math.nan)
    return GPS_EPOCH_UNIX_S + WEEK_S * one.get("week", 0.0) + itow - LEAP_S


def place_of(*, northern: bool) -> Callable[[Values], tuple[float, float] | None]:
    """Return a function from a row to latitude and longitude, degrees; UTM lacks the hemisphere."""

    def place(one: Values) -> tuple[float, float] | None:
        latitude, longitude = one.get("latitude", math.nan), one.get("longitude", math.nan)
        if not (abs(latitude) <= 90.0 and abs(longitude) <= 180.0):
            east, north, zone = (one.get(name, math.nan) for name in ("east", "north", "zone"))
            if not (1.0 <= zone <= 60.0 and abs(0.01 * east - 500e3) < 1e6 and 0.0 <= north < 1e9):
                return None
            latitude, longitude = from_utm(0.01 * east, 0.01 * north, int(zone), northern=northern)
        return (latitude, longitude) if latitude or longitude else None

    return place


def number(cell: str) -> float:
    """Return a cell's number; NaN where it is none or impossibly large."""
    try:
        value = float(cell)
    except ValueError:
        return math.nan
    return value if abs(value) < 1e12 else math.nan


def from_utm(east_m: float, north_m: float, zone: int, *, northern: bool) -> tuple[float, float]:
    """Return (latitude, longitude), degrees, on WGS84 of a position in a UTM zone.

    Series of Krüger (1912), to the fourth power of the third flattening: accurate to less than a millimetre.
    """
    n = 1.0 / (2.0 * 298.257223563 - 1.0)
    radius = 6_378_137.0 / (1.0 + n) * (1.0 + n**2 / 4.0 + n**4 / 64.0) * 0.9996
    xi = (north_m - (0.0 if northern else 1e7)) / radius
    eta = (east_m - 500e3) / radius
    beta = (
        n / 2.0 - 2.0 / 3.0 * n**2 + 37.0 / 96.0 * n**3 - n**4 / 360.0,
        n**2 / 48.0 + n**3 / 15.0 - 437.0 / 1440.0 * n**4,
        17.0 / 480.0 * n**3 - 37.0 / 840.0 * n**4,
        4397.0 / 161_280.0 * n**4,
    )
    delta = (
        2.0 * n - 2.0 / 3.0 * n**2 - 2.0 * n**3 + 116.0 / 45.0 * n**4,
        7.0 / 3.0 * n**2 - 8.0 / 5.0 * n**3 - 227.0 / 45.0 * n**4,
        56.0 / 15.0 * n**3 - 136.0 / 35.0 * n**4,
        4279.0 / 630.0 * n**4,
    )
    powers = [(2.0 * j, b) for j, b in enumerate(beta, start=1)]
    xi_0 = xi - sum(b * math.sin(j * xi) * math.cosh(j * eta) for j, b in powers)
    eta_0 = eta - sum(b * math.cos(j * xi) * math.sinh(j * eta) for j, b in powers)
    chi = math.asin(math.sin(xi_0) / math.cosh(eta_0))
    latitude = chi + sum(d * math.sin(2.0 * j * chi) for j, d in enumerate(delta, start=1))
    longitude = math.atan2(math.sinh(eta_0), math.cos(xi_0))
    return math.degrees(latitude), 6.0 * zone - 183.0 + math.degrees(longitude)
