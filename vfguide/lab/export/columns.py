"""A flight in columns with units in their names, processed in parts."""

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pymap3d

from vfguide.elementwise import FloatArray, wrap_course
from vfguide.errors import InputError
from vfguide.frames import EARTH_RADIUS
from vfguide.lab.report.figures import slot_error
from vfguide.record.flight import FlightRecord, RecordOrigin, VehicleRecord
from vfguide.record.vehicle import SERIES

VIRTUAL_BEGIN_S = 1_767_225_600.0
"""Time 0 of a flight in virtual time, s since 1970: 1 January 2026, as in its telemetry logs."""

LATEST_S = 4_102_444_800.0
"""Start of 2100; no valid flight ends later."""

PART = 20_000
"""Number of samples processed at a time."""

FINEST_STEP_S = 0.2
"""Longest interval between pictures of a flight, except for longer steps of the record."""

UNITS = {
    "latitude_deg": "degrees, WGS 84",
    "longitude_deg": "degrees, WGS 84",
    "altitude_amsl_m": "m above mean sea level",
    "north_m": "m north of the mission's origin",
    "east_m": "m east of the mission's origin",
    "course_deg": "degrees clockwise from north",
    "ground_speed_m_s": "m/s",
    "heading_deg": "degrees clockwise from north",
    "airspeed_m_s": "m/s",
    "bank_deg": "degrees, right wing down positive",
    "wind_north_m_s": "m/s, toward north",
    "wind_east_m_s": "m/s, toward east",
    "course_setpoint_deg": "degrees clockwise from north",
    "airspeed_setpoint_m_s": "m/s",
    "ground_speed_setpoint_m_s": "m/s",
    "slot_ahead_m": "m, along the leader's course",
    "slot_right_m": "m, right of the leader's course",
    "slot_distance_m": "m",
    "lyapunov_m2": "m²",
    "leader_age_s": "s, of the leader's state that a follower flew by",
}
"""Units of all numeric columns."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """Consecutive samples of one vehicle."""

    vehicle: VehicleRecord
    """The vehicle; its arrays hold the whole flight."""
    first: int
    """Index of the first sample in the whole flight."""
    time_s: FloatArray
    numbers: dict[str, FloatArray]
    """Columns of `UNITS`; NaN where unknown."""
    modes: list[str]
    """Names of the supervisor's modes."""
    limited: list[bool]
    """Whether a limit cut the setpoint."""


def begin_of(record: FlightRecord) -> float:
    """Return time 0 of a flight, s since 1970.

    Raises:
        InputError: the record holds impossible times.
    """
    begin = VIRTUAL_BEGIN_S if record.begin_unix_s is None else record.begin_unix_s
    first, last = float(record.time_s[0]), float(record.time_s[-1])
    if not (begin >= 0.0 and first >= 0.0 and begin + last <= LATEST_S):
        raise InputError(
            f"the record tells times from {begin + first:g} to {begin + last:g} s since 1970: "
            "it is damaged; give another flight"
        )
    return begin


def moment(unix_s: float) -> str:
    """Format a time by ISO 8601, to the millisecond."""
    text = datetime.fromtimestamp(unix_s, UTC).isoformat(timespec="milliseconds")
    return text.replace("+00:00", "Z")


def origin_of(record: FlightRecord) -> RecordOrigin:
    """Return the geodetic origin of a flight.

    Raises:
        InputError: the record does not hold it.
    """
    if record.origin is None:
        raise InputError(
            "the record does not say where on the earth it was flown: an earlier version wrote it; "
            "name its mission with --mission, or fly it again"
        )
    return record.origin


def parts_of(record: FlightRecord) -> Iterator[Part]:
    """Yield the whole flight in parts: for each span of time all vehicles, leader first.

    Raises:
        InputError: the record does not hold its geodetic origin.
    """
    origin = origin_of(record)
    errors = {one.name: slot_error(record.reference, one) for one in record.followers}
    for begin in range(0, record.time_s.size, PART):
        some = slice(begin, begin + PART)
        for vehicle in record.vehicles:
            latitude, longitude = geodetic(origin, vehicle.north_m[some], vehicle.east_m[some])
            error = errors.get(vehicle.name)
            unknown, ages = np.full_like(latitude, np.nan), vehicle.leader_age_s
            found = {
                **{name: getattr(vehicle, name)[some] for name in SERIES if name in UNITS},
                **{
                    f"{name}_deg": bearing(getattr(vehicle, f"{name}_rad")[some])
                    for name in ("course", "heading", "course_setpoint")
                },
                "latitude_deg": latitude,
                "longitude_deg": longitude,
                "bank_deg": np.degrees(vehicle.bank_rad[some]),
                "slot_ahead_m": error.along_track_m[some] if error else unknown,
                "slot_right_m": error.cross_track_m[some] if error else unknown,
                "slot_distance_m": error.distance_m[some] if error else unknown,
                "lyapunov_m2": vehicle.lyapunov[some],
                "leader_age_s": unknown if ages is None else ages[some],
            }
            yield Part(
                vehicle=vehicle,
                first=begin,
                time_s=record.time_s[some],
                numbers={name: found[name] for name in UNITS},
                modes=[mode_name(record, number) for number in vehicle.mode[some].tolist()],
                limited=vehicle.limited[some].tolist(),
            )


def finest_stride(record: FlightRecord) -> int:
    """Return the largest stride whose samples are at most `FINEST_STEP_S` apart, but at least 1."""
    step_s = record.duration_s / max(record.time_s.size - 1, 1)
    return max(1, math.floor(FINEST_STEP_S / step_s + 1e-6)) if step_s > 0.0 else 1


def mode_name(record: FlightRecord, number: int) -> str:
    """Return a mode's name, or its number if the record does not name it."""
    known = 0 <= number < len(record.mode_names)
    return record.mode_names[number] if known else str(number)


def bearing(angles_rad: FloatArray) -> FloatArray:
    """Convert angles to degrees clockwise from north, 0 to 360."""
    return np.degrees(wrap_course(angles_rad))


def geodetic(
    origin: RecordOrigin, north_m: FloatArray, east_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (latitude, longitude) of local places, degrees: `LocalFrame.to_geodetic` for arrays."""
    drop = (north_m * north_m + east_m * east_m) / (2.0 * EARTH_RADIUS)
    latitude, longitude, _ = pymap3d.ned2geodetic(
        north_m, east_m, drop, origin.latitude_deg, origin.longitude_deg, origin.altitude_amsl_m
    )
    return np.asarray(latitude, dtype=np.float64), np.asarray(longitude, dtype=np.float64)


# Tables with a row per vehicle and sample, as CSV and Parquet with the same columns, for spreadsheets,
# MATLAB, pandas, Polars and DuckDB.

FORMULA_STARTS = ("=", "+", "-", "@", "\t", "\r")


def write_csv(record: FlightRecord, path: Path) -> None:
    """Write a flight as CSV, with units in the column names and unknown values empty.

    Raises:
        OSError: the file cannot be written.
        InputError: the record does not hold its geodetic origin.
    """
    begin = begin_of(record)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("time_s", "time_utc", "vehicle", *UNITS, "mode", "limited"))
        for part in parts_of(record):
            name = harmless(part.vehicle.name)
            columns = [values.tolist() for values in part.numbers.values()]
            for time_s, mode, limited, *numbers in zip(
                part.time_s.tolist(), part.modes, part.limited, *columns, strict=True
            ):
                writer.writerow(
                    (
                        f"{time_s:.3f}",
                        moment(begin + time_s),
                        name,
                        *(plain(number) for number in numbers),
                        harmless(mode),
                        int(limited),
                    )
                )


def plain(number: float) -> str:
    """Format a number with ten significant digits, 1 cm of longitude; empty if unknown."""
    return f"{number:.10g}" if math.isfinite(number) else ""


def harmless(text: str) -> str:
    """Quote a name that a spreadsheet would take for a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


def write_parquet(record: FlightRecord, path: Path) -> None:
    """Write a flight as Parquet, with units in the columns' metadata and unknown values null.

    Raises:
        OSError: the file cannot be written.
        InputError: the record does not hold its geodetic origin.
    """
    import pyarrow as pa
    from pyarrow import parquet

    begin = begin_of(record)
    text = pa.dictionary(pa.int32(), pa.string())
    schema = pa.schema(
        [
            pa.field("time_s", pa.float64(), metadata={"unit": "s of the flight"}),
            pa.field("time_utc", pa.timestamp("us", tz="UTC")),
            pa.field("vehicle", text),
            *(
                pa.field(name, pa.float64(), metadata={"unit": unit})
                for name, unit in UNITS.items()
            ),
            pa.field("mode", text),
            pa.field("limited", pa.bool_()),
        ],
        metadata={"mission": record.mission},
    )
    with parquet.ParquetWriter(path, schema, compression="zstd") as writer:
        for part in parts_of(record):
            names = pa.array([part.vehicle.name] * part.time_s.size).dictionary_encode()
            moments = ((begin + part.time_s) * 1e6).round().astype("int64")
            columns = [
                pa.array(part.time_s),
                pa.array(moments, pa.int64()).cast(pa.timestamp("us", tz="UTC")),
                names,
                *(pa.array(values, from_pandas=True) for values in part.numbers.values()),
                pa.array(part.modes, pa.string()).dictionary_encode(),
                pa.array(part.limited, pa.bool_()),
            ]
            writer.write_table(pa.Table.from_arrays(columns, schema=schema))
