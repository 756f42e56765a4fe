"""What happened on a flight: the true states of every vehicle and the setpoints it was sent.

Frame: local, metres north and east of the mission's origin; angles in radians clockwise from north; wind is
the vector the air moves toward. All arrays of a record have one entry for each sample of its `time_s`.
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
"""Says in each file what it is."""

VERSION = 2
"""Version of the file's layout; a reader refuses what is newer than itself."""

MOST_OUTLINES = 1000
"""In one record: more than a mission can name."""

OutlineKind = Literal["fence", "path", "rally"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordAcceptance:
    """What the flight had to reach. None: not asked for."""

    mean_error_m: float | None = None
    """Highest mean formation error in the window, m."""
    max_error_m: float | None = None
    """Highest formation error in the window, m."""
    mean_error_3d_m: float | None = None
    """Highest mean formation error in space in the window, m."""
    settle_10m_s: float | None = None
    """Time from which every follower has to be within 10 m of its slot, s."""
    settle_1m_s: float | None = None
    """Time from which every follower has to be within 1 m of its slot, s."""
    min_separation_m: float = 0.0
    """Least distance between any two vehicles at any time, m."""

    @property
    def asks_for_slots(self) -> bool:
        """Whether anything is asked of how followers keep their slots."""
        limits = (self.mean_error_m, self.max_error_m, self.mean_error_3d_m)
        return any(one is not None for one in (*limits, self.settle_10m_s, self.settle_1m_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordOrigin:
    """Where on the earth the local frame of a flight begins."""

    latitude_deg: float
    """North positive."""
    longitude_deg: float
    """East positive."""
    altitude_amsl_m: float
    """Above mean sea level."""

    def __post_init__(self) -> None:
        on_earth = abs(self.latitude_deg) <= 90.0 and abs(self.longitude_deg) <= 180.0
        if not (on_earth and abs(self.altitude_amsl_m) <= 100e3):
            raise ValueError("the origin is nowhere on the earth")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outline:
    """One line on the ground that a flight is drawn with, or some points.

    Raises:
        ValueError: it has not as many norths as easts.
    """

    kind: OutlineKind
    """`fence`: the edge of an area that has to be stayed in or out of; `path`: not the mission's first;
    `rally`: points to which an aircraft may go back, no line."""
    north_m: FloatArray
    """M points from its beginning to its end, m; of a closed line the last is the first."""
    east_m: FloatArray
    """M points, m."""

    def __post_init__(self) -> None:
        if self.north_m.ndim != 1 or self.north_m.shape != self.east_m.shape:
            raise ValueError("a drawn line has not as many norths as easts")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightRecord:
    """A whole flight.

    Raises:
        ValueError: the arrays do not fit together, or there is no leader first.
    """

    time_s: FloatArray
    """N sample times from the beginning of the flight, ascending."""
    vehicles: tuple[VehicleRecord, ...]
    """The leader, then its followers."""
    mode_names: tuple[str, ...]
    """Names of the supervisor's modes, by number."""
    path_north_m: FloatArray
    """M points along the planned path, for drawing."""
    path_east_m: FloatArray
    """M points along the planned path, for drawing."""
    mission: str
    """Name of the mission."""
    controller: str
    """Name of the law by which followers kept their slots."""
    plant: str
    """`course-hold`, `heading-hold` or `bank`."""
    wind: str
    """Type of the wind that blew, such as `calm` or `article`."""
    mode: FlightMode
    """`lockstep` in virtual time, `live` over real sockets, `recorded` by companions on a real flight: there
    positions are estimates, and NaN where nothing was recorded."""
    rate_hz: Figure
    """Position reports per second, 1/s."""
    seed: int
    """Seed of everything random in the flight."""
    duration_s: Figure
    """How long the flight lasted, as flown, s."""
    wall_s: float | None
    """How long that took, s. Not kept in the file, so that equal flights have equal files; then None."""
    acceptance: RecordAcceptance
    """What the flight had to reach."""
    interrupted: bool = False
    """Whether it was stopped before its end."""
    latency: Latency | None = None
    """How quick the programs were, of a live flight."""
    notes: tuple[str, ...] = ()
    """What a reader has to know of where the figures come from, a sentence each."""
    origin: RecordOrigin | None = None
    """Origin of the local frame; None in records of earlier versions."""
    begin_unix_s: Figure | None = None
    """Time 0 of the flight, s since 1970; None of a flight in virtual time."""
    outlines: tuple[Outline, ...] = ()
    """Edges of the fence and other paths, for drawing; none in records of earlier versions."""
    events: tuple[FlightEvent, ...] = ()
    """What companions had to say, in order; none in records of earlier versions, and of autopilots' logs."""

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
        """The leader."""
        return self.vehicles[0]

    @property
    def followers(self) -> tuple[VehicleRecord, ...]:
        """All but the leader, in the order of the mission file."""
        return self.vehicles[1:]

    @property
    def reference(self) -> VehicleRecord:
        """What the slots were fixed to: the leader, or the one that a deputy carried on in its place."""
        return slot_reference(self.time_s, self.vehicles)

    def save(self, path: Path) -> None:
        """Write the record to one `.npz` file, whole or not at all.

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
            InputError: the file is missing, damaged, or something else; one line.
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
    """Names of all arrays that a vehicle's record has."""
    names = (field.name for field in fields(vehicle))
    return tuple(name for name in names if isinstance(getattr(vehicle, name), np.ndarray))


def _compose(description: dict[str, Any], arrays: dict[str, AnyArray]) -> FlightRecord:
    """A record from its parts; LookupError, TypeError or ValueError where one is missing or misshapen."""
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
"""From the last state of a leader to the first of its deputy: a longer time without either is not bridged."""


def slot_reference(time_s: FloatArray, vehicles: Sequence[VehicleRecord]) -> VehicleRecord:
    """The leader, with place, height and course of whoever led in the highest term at each time.

    While none led, between a leader that was lost and its deputy, slots were fixed to what every follower
    carried on by itself: a cubic between both, by their places and velocities. What the leader's aircraft
    did meanwhile, with its companion dead, is nobody's slot.

    Args:
        time_s: of the samples, s.
        vehicles: the leader first.
    """
    leader = vehicles[0]
    if leader.lead_term is None:
        return leader
    terms = np.array([_series(one, "lead_term") for one in vehicles])
    led = np.isfinite(terms).any(axis=0)
    if not led.any():
        return leader
    row = np.where(np.isfinite(terms), terms, -1.0).argmax(axis=0)
    # In term 0 it is the leader itself, which is known better from its own record.
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
    # It is carried on along its path.
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
    """(last sample before, first sample after) each time in which none led, between two in which one did."""
    samples = np.flatnonzero(led)
    ends = np.flatnonzero(np.diff(samples) > 1)
    return [(int(samples[one]), int(samples[one + 1])) for one in ends]


def _bridge(time_s: FloatArray, found: dict[str, FloatArray], first: int, last: int) -> None:
    """Fill the samples between two with a cubic of the same places and velocities at its ends."""
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
