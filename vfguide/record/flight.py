"""Record of a flight: the true states of every vehicle and the setpoints sent to it.

Frame: local, metres north and east of the mission's origin; angles in radians clockwise from north; wind is
the velocity vector of the air. All arrays of a record have one entry per sample of its `time_s`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import msgspec
import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.record.archive import (
    REMEDY,
    AnyArray,
    Figure,
    IntegerArray,
    described,
    joined,
    read_archive,
    sound_array,
    write_archive,
)
from vfguide.record.events import FlightEvent, checked_events
from vfguide.record.latency import Latency
from vfguide.record.vehicle import Role, VehicleRecord

__all__ = [
    "FlightMode",
    "FlightRecord",
    "IntegerArray",
    "Outline",
    "RecordAcceptance",
    "RecordOrigin",
    "Role",
    "VehicleRecord",
]

FlightMode = Literal["lockstep", "live", "recorded"]

FORMAT = "vfguide-flight-record"
"""Format name in each file."""

VERSION = 2
"""Version of the file layout; a reader refuses any other."""

MOST_OUTLINES = 1000
"""Maximum number of outlines in a record: more than a mission can name."""

OutlineKind = Literal["fence", "path", "rally"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordAcceptance:
    """Acceptance limits of the flight; None for limits that do not apply."""

    mean_error_m: float | None = None
    """Maximum mean formation error in the window, m."""
    max_error_m: float | None = None
    """Maximum formation error in the window, m."""
    mean_error_3d_m: float | None = None
    """Maximum mean formation error in space, heights included, in the window, m."""
    settle_10m_s: float | None = None
    """Time from which every follower has to be within 10 m of its slot, s."""
    settle_1m_s: float | None = None
    """Time from which every follower has to be within 1 m of its slot, s."""
    min_separation_m: float = 0.0
    """Minimum distance between any two vehicles at any time, m."""

    @property
    def asks_for_slots(self) -> bool:
        """Whether any limit concerns how followers keep their slots."""
        limits = (self.mean_error_m, self.max_error_m, self.mean_error_3d_m)
        return any(one is not None for one in (*limits, self.settle_10m_s, self.settle_1m_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordOrigin:
    """Origin of a flight's local frame."""

    latitude_deg: float
    """Latitude, degrees, north positive."""
    longitude_deg: float
    """Longitude, degrees, east positive."""
    altitude_amsl_m: float
    """Altitude above mean sea level, m."""

    def __post_init__(self) -> None:
        on_earth = abs(self.latitude_deg) <= 90.0 and abs(self.longitude_deg) <= 180.0
        if not (on_earth and abs(self.altitude_amsl_m) <= 100e3):
            raise ValueError("the origin is nowhere on the earth")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """A line on the ground for drawing, or some points.

    Raises:
        ValueError: the numbers of norths and easts differ.
    """

    kind: OutlineKind
    """`fence`: edge of an inclusion or exclusion area; `path`: a path other than the mission's first;
    `rally`: rally points, not a line."""
    north_m: FloatArray
    """M points from beginning to end, m; the last point of a closed line equals the first."""
    east_m: FloatArray
    """M points, m."""

    def __post_init__(self) -> None:
        if self.north_m.ndim != 1 or self.north_m.shape != self.east_m.shape:
            raise ValueError("a drawn line has not as many norths as easts")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightRecord:
    """Record of a whole flight.

    Raises:
        ValueError: the arrays do not fit together, or the first vehicle is not the only leader.
    """

    time_s: FloatArray
    """N sample times from the beginning of the flight, ascending, s."""
    vehicles: tuple[VehicleRecord, ...]
    """The leader, then its followers."""
    mode_names: tuple[str, ...]
    """Names of the supervisor's modes, by number."""
    path_north_m: FloatArray
    """M points along the planned path for drawing, m."""
    path_east_m: FloatArray
    """M points along the planned path for drawing, m."""
    mission: str
    controller: str
    """Name of the law that followers flew by."""
    plant: str
    """Name of the plant, such as `course-hold`, `heading-hold` or `bank`."""
    wind: str
    """Type of the wind, such as `calm` or `article`."""
    mode: FlightMode
    """`lockstep` in virtual time, `live` over real sockets, `recorded` by companions on a real flight.
    Recorded positions are estimates, and NaN where nothing was recorded."""
    rate_hz: Figure
    """Position reports per second, 1/s."""
    seed: int
    """Seed of all random processes of the flight."""
    duration_s: Figure
    """Flown duration, s."""
    wall_s: float | None
    """Wall-clock duration, s; None in loaded records, since files omit it so that equal flights have equal
    files."""
    acceptance: RecordAcceptance
    """Acceptance limits of the flight."""
    interrupted: bool = False
    """Whether the flight was stopped before its end."""
    latency: Latency | None = None
    """Latencies of the programs in a live flight."""
    notes: tuple[str, ...] = ()
    """Notes about the source of the figures, a sentence each."""
    origin: RecordOrigin | None = None
    """Origin of the local frame; None in records of earlier versions."""
    begin_unix_s: Figure | None = None
    """Time 0 of the flight, s since 1970; None for a flight in virtual time."""
    outlines: tuple[Outline, ...] = ()
    """Fence edges and other paths for drawing; empty in records of earlier versions."""
    events: tuple[FlightEvent, ...] = ()
    """Events of the companions in order; empty in records of earlier versions, and from autopilots' logs."""

    def __post_init__(self) -> None:
        if not self.vehicles or [v.role for v in self.vehicles].count("leader") != 1:
            raise ValueError("a flight has exactly one leader")
        if self.leader.role != "leader":
            raise ValueError("the leader comes first")
        if len({vehicle.name for vehicle in self.vehicles}) != len(self.vehicles):
            raise ValueError("two vehicles have the same name")
        if self.time_s.ndim != 1 or not bool(np.all(np.diff(self.time_s) >= 0.0)):
            raise ValueError("times are not ascending")
        if self.path_north_m.ndim != 1 or self.path_north_m.shape != self.path_east_m.shape:
            raise ValueError("the drawn path has not as many norths as easts")
        for vehicle in self.vehicles:
            for name in series_of(vehicle):
                shape = getattr(vehicle, name).shape
                if shape != self.time_s.shape:
                    wanted = self.time_s.shape
                    raise ValueError(f"{vehicle.name}: {name} has shape {shape}, not {wanted}")

    @property
    def leader(self) -> VehicleRecord:
        """Vehicle that leads by the mission."""
        return self.vehicles[0]

    @property
    def followers(self) -> tuple[VehicleRecord, ...]:
        """All vehicles but the leader, in the order of the mission file."""
        return self.vehicles[1:]

    @property
    def reference(self) -> VehicleRecord:
        """Reference of the slots: the leader, or its extrapolation by a deputy."""
        return slot_reference(self.time_s, self.vehicles)

    def save(self, path: Path) -> None:
        """Write the record to one `.npz` file atomically.

        Raises:
            InputError: the place cannot be written to.
        """
        arrays: dict[str, AnyArray] = {}
        parts = described(self, arrays, without=("vehicles", "outlines", "wall_s"))
        vehicles = [
            described(vehicle, arrays, f"vehicle_{number}_")
            for number, vehicle in enumerate(self.vehicles)
        ]
        outlines = [
            described(outline, arrays, f"outline_{number}_")["kind"]
            for number, outline in enumerate(self.outlines)
        ]
        lists = {"vehicles": vehicles, "outlines": outlines}
        write_archive(path, {"format": FORMAT, "version": VERSION, **parts, **lists}, arrays)

    @classmethod
    def load(cls, path: Path) -> "FlightRecord":
        """Read a record.

        Raises:
            InputError: the file is missing, damaged, or no record; one line.
        """
        description, arrays = read_archive(path)
        if description.get("format") != FORMAT:
            raise InputError(f"{path}: is no flight record: its format is not {FORMAT}; {REMEDY}")
        if description.get("version") != VERSION:
            version = description.get("version")
            raise InputError(
                f"{path}: is a flight record of version {version!r:.20}, this program reads "
                f"{VERSION}; {REMEDY}"
            )
        try:
            return _compose(description, arrays)
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as error:
            reason = " ".join(str(error).split())[:200]
            raise InputError(f"{path}: is a damaged flight record: {reason}; {REMEDY}") from error


def series_of(vehicle: VehicleRecord) -> tuple[str, ...]:
    """Return the names of all arrays in a vehicle's record."""
    names = (field.name for field in fields(vehicle))
    return tuple(name for name in names if isinstance(getattr(vehicle, name), np.ndarray))


def _compose(description: dict[str, Any], arrays: dict[str, AnyArray]) -> FlightRecord:
    """Compose a record from its parts; LookupError, TypeError or ValueError if one is missing or invalid."""
    kinds = description.get("outlines", [])
    if not isinstance(kinds, list) or len(kinds) > MOST_OUTLINES:
        raise ValueError("its drawn lines are no list, or too many")
    content = joined(FlightRecord, description, arrays) | {
        "vehicles": [
            joined(VehicleRecord, entry, arrays, f"vehicle_{number}_")
            for number, entry in enumerate(description["vehicles"])
        ],
        "outlines": [
            joined(Outline, {"kind": kind}, arrays, f"outline_{number}_")
            for number, kind in enumerate(kinds)
        ],
        "wall_s": None,
    }
    record = msgspec.convert(content, FlightRecord, dec_hook=sound_array)
    return replace(record, events=checked_events(record.events))


LONGEST_GAP_S = 6.0
"""Maximum gap that is bridged between the last state of a leader and the first of its deputy, s."""


def slot_reference(time_s: FloatArray, vehicles: Sequence[VehicleRecord]) -> VehicleRecord:
    """Return the leader, with position, height and course of whoever led in the highest term at each time.

    After a leader is lost and before its deputy leads, every follower extrapolates the leader by itself. A
    cubic between both, by their positions and velocities, replaces this gap. The motion of the leader's
    aircraft without its companion is no reference. The leader has to be the first of the vehicles.
    """
    leader = vehicles[0]
    if leader.lead_term is None:
        return leader
    terms = np.array([_series(one, "lead_term") for one in vehicles])
    led = np.isfinite(terms).any(axis=0)
    if not led.any():
        return leader
    row = np.where(np.isfinite(terms), terms, -1.0).argmax(axis=0)
    # In term 0 the leader itself leads; its own record is more accurate.
    own = ~led | (np.where(led, terms[row, np.arange(time_s.size)], 0.0) == 0.0)
    found = {
        to: np.where(
            own,
            getattr(leader, to),
            np.array([_series(one, of) for one in vehicles])[row, np.arange(time_s.size)],
        )
        for to, of in (
            ("north_m", "lead_north_m"),
            ("east_m", "lead_east_m"),
            ("course_rad", "lead_course_rad"),
            ("altitude_amsl_m", "lead_altitude_amsl_m"),
        )
    }
    # A deputy extrapolates the leader along its path.
    found["path_course_rad"] = np.where(own, leader.path_course_rad, found["course_rad"])
    found["path_cross_track_error_m"] = np.where(own, leader.path_cross_track_error_m, 0.0)
    for first, last in _gaps(led):
        if time_s[last] - time_s[first] <= LONGEST_GAP_S:
            _bridge(time_s, found, first, last)
    return replace(leader, **found)


def _series(vehicle: VehicleRecord, name: str) -> FloatArray:
    values: FloatArray | None = getattr(vehicle, name)
    return np.full_like(vehicle.north_m, np.nan) if values is None else values


def _gaps(led: np.ndarray) -> list[tuple[int, int]]:
    """Return (last sample before, first sample after) of each gap between samples with a leader."""
    samples = np.flatnonzero(led)
    ends = np.flatnonzero(np.diff(samples) > 1)
    return [(int(samples[one]), int(samples[one + 1])) for one in ends]


def _bridge(time_s: FloatArray, found: dict[str, FloatArray], first: int, last: int) -> None:
    """Fill the samples between two: a cubic in position with the end velocities, linear in course."""
    span = time_s[last] - time_s[first]
    share = (time_s[first + 1 : last] - time_s[first]) / span
    before, after = max(first - 1, 0), min(last + 1, time_s.size - 1)
    for name in ("north_m", "east_m", "altitude_amsl_m"):
        values = found[name]
        begin, end = values[first], values[last]
        slopes = [
            span * (values[b] - values[a]) / max(time_s[b] - time_s[a], 1e-9)
            for a, b in ((before, first), (last, after))
        ]
        values[first + 1 : last] = (
            (1.0 + 2.0 * share) * (1.0 - share) ** 2 * begin
            + share * (1.0 - share) ** 2 * slopes[0]
            + share**2 * (3.0 - 2.0 * share) * end
            + share**2 * (share - 1.0) * slopes[1]
        )
    course = found["course_rad"]
    turn = np.remainder(course[last] - course[first] + np.pi, 2.0 * np.pi) - np.pi
    course[first + 1 : last] = course[first] + share * turn
