"""Collect the true states and companion snapshots of a rehearsal, and make a flight record of them."""

import asyncio
import json
import math
from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np
import pymap3d

import sitl_stub
from vfguide.companion.role import Snapshot
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.formation.arrangement import Point
from vfguide.guidance.path import Path
from vfguide.mission.flight_limits import fences_of
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Mission
from vfguide.mission.place import frame_of
from vfguide.mission.vehicle import Vehicle
from vfguide.record.events import FlightEvent, merged_events
from vfguide.record.flight import (
    FlightMode,
    FlightRecord,
    Outline,
    OutlineKind,
    RecordAcceptance,
    RecordOrigin,
)
from vfguide.record.guidance_log import (
    GuidanceStep,
    GuidanceTrack,
    age_series,
    lead_series,
    slot_series,
)
from vfguide.record.response import VehicleResponse
from vfguide.record.vehicle import LEAD_SERIES, SLOT_SERIES, FlightLimits, VehicleRecord
from vfguide.state import Setpoint

TRUTHS = (
    "altitude_amsl_m",
    "course_rad",
    "ground_speed_m_s",
    "heading_rad",
    "airspeed_m_s",
    "bank_rad",
    "wind_north_m_s",
    "wind_east_m_s",
)
"""Fields of the emulator's true state that a vehicle record takes unchanged."""

POSITION = ("latitude_deg", "longitude_deg")
"""Fields of the true state that become north and east."""

DOINGS = ("mode", "course", "speed", "limited", "lyapunov", "path")
"""Values from the companion's snapshot, as numbers."""

LEADS = ("term", "north", "east", "course", "altitude")
"""Values of the leader motion by which a vehicle leads, recorded where the mission names deputies."""

MODES = tuple(Mode)

UNSEEN = Snapshot(mode=Mode.WAITING, setpoint=None, lyapunov=math.nan)
"""Snapshot in the place of a companion that is absent or not observed."""

truth_row = attrgetter(*POSITION, *TRUTHS)

DRAWN_POINTS = 361


class VehicleRecorder:
    """Recorder of one aircraft's true states and its companion's snapshots.

    It keeps plain numbers: the garbage collector would scan objects of a whole flight again and again.
    """

    def __init__(self, mission: Mission, name: str) -> None:
        self._mission = mission
        self._name = name
        leads = name == mission.leader.vehicle
        self._slot = Point(0.0, 0.0) if leads else mission.followers_by_name[name].slot.point
        self._truths = array("d")
        self._doings = array("d")
        self._leads = array("d") if mission.deputies else None
        self._slots = array("d")
        self._path_names = tuple(mission.paths_by_name)
        self._response: VehicleResponse | None = None

    def sample(self, truth: sitl_stub.Truth, snapshot: Snapshot) -> None:
        """Add a sample."""
        self._truths.extend(truth_row(truth))
        self._doings.extend(doings_row(snapshot, self._path_names))
        self._response = snapshot.response or self._response
        self._slots.extend(slot_row(snapshot, self._slot))
        if self._leads is not None:
            self._leads.extend(lead_row(snapshot, self._mission.origin.altitude_amsl_m))

    def record(self) -> VehicleRecord:
        """Return the record of the samples so far."""
        truths = columns(self._truths, (*POSITION, *TRUTHS))
        north, east = local_positions(self._mission, *(truths.pop(field) for field in POSITION))
        led = None if self._leads is None else columns(self._leads, LEADS).values()
        leads = {} if led is None else dict(zip(LEAD_SERIES, led, strict=True))
        return vehicle_record(
            self._mission,
            self._name,
            columns(self._doings, DOINGS),
            response=self._response,
            north_m=north,
            east_m=east,
            **truths,
            **self._slot_series(),
            **leads,
        )

    def _slot_series(self) -> dict[str, FloatArray]:
        """Return the slot series, or none where the vehicle kept the mission's slot throughout."""
        slots = columns(self._slots, SLOT_SERIES)
        mission = (self._slot.forward, self._slot.right, self._slot.up)
        fixed = all(
            np.all(slots[name] == value) for name, value in zip(SLOT_SERIES, mission, strict=True)
        )
        return {} if fixed else slots


def vehicle_record(
    mission: Mission,
    name: str,
    doings: Mapping[str, FloatArray],
    *,
    response: VehicleResponse | None,
    **series: FloatArray,
) -> VehicleRecord:
    """Make the record of a vehicle from its mission, the response used last and its series.

    The keys of `doings` are `DOINGS`, those of `series` are fields of `VehicleRecord`.
    """
    vehicle, follower = mission.vehicles[name], mission.followers_by_name.get(name)
    slot = Point(0.0, 0.0) if follower is None else follower.slot.point
    speeds = doings["speed"]
    unsent = np.full_like(speeds, math.nan)
    by_airspeed = vehicle.plant == "heading-hold"
    beside, along = unsent, unsent
    if follower is None:
        beside, along = beside_paths(
            mission, series["north_m"], series["east_m"], series["course_rad"], doings["path"]
        )
    return VehicleRecord(
        name=name,
        role="leader" if follower is None else "follower",
        system_id=vehicle.system_id,
        slot_forward_m=slot.forward,
        slot_right_m=slot.right,
        slot_up_m=slot.up,
        limits=limits_of(vehicle),
        response=response,
        declared=declared_by(vehicle),
        path_cross_track_error_m=beside,
        path_course_rad=along,
        course_setpoint_rad=doings["course"],
        airspeed_setpoint_m_s=speeds if by_airspeed else unsent,
        ground_speed_setpoint_m_s=unsent if by_airspeed else speeds,
        mode=doings["mode"].astype(np.int64),
        limited=doings["limited"].astype(np.bool_),
        lyapunov=doings["lyapunov"],
        # None where the first path was flown throughout.
        path_number=doings["path"].copy() if doings["path"].any() else None,
        **series,
    )


def limits_of(vehicle: Vehicle) -> FlightLimits:
    """Return a vehicle's flight limits from the mission."""
    lowest, highest = vehicle.airspeed_range_m_s
    return FlightLimits(
        least_airspeed_m_s=lowest,
        greatest_airspeed_m_s=highest,
        greatest_bank_deg=vehicle.max_bank_deg,
    )


def declared_by(vehicle: Vehicle) -> VehicleResponse:
    """Return the vehicle response that the mission declares; None for values that it leaves out."""
    course, speed = (name in vehicle.model_fields_set for name in ("alpha_1_s", "beta_1_s"))
    return VehicleResponse(
        alpha_1_s=vehicle.alpha_1_s if course else None,
        course_dead_time_s=vehicle.course_dead_time_s if course else None,
        course_lag_s=vehicle.course_lag_s if course else None,
        beta_1_s=vehicle.beta_1_s if speed else None,
        speed_dead_time_s=vehicle.speed_dead_time_s if speed else None,
        speed_lag_s=vehicle.speed_lag_s if speed else None,
        slips=None if vehicle.slips == "auto" else vehicle.slips,
        max_bank_deg=vehicle.max_bank_deg,
    )


def slot_row(snapshot: Snapshot, fixed: Point) -> tuple[float, float, float]:
    """Return (forward, right, up) of the flown slot, m; NaN for a vehicle that left the formation."""
    if snapshot.left:
        return math.nan, math.nan, math.nan
    slot = snapshot.slot or fixed
    return slot.forward, slot.right, slot.up


def flight_record(
    mission: Mission,
    times: Sequence[float],
    vehicles: Sequence[VehicleRecord],
    *,
    wall_s: float,
    mode: FlightMode = "lockstep",
    events: Iterable[FlightEvent] = (),
) -> FlightRecord:
    """Make the record of a flight from the records of its vehicles, leader first, and companion events."""
    path_north, path_east = drawn_path(mission, vehicles[0])
    plant = mission.rehearsal.emulator.of(mission.leader.vehicle).plant
    return FlightRecord(
        time_s=np.array(times, dtype=np.float64),
        vehicles=tuple(vehicles),
        mode_names=tuple(mode.value for mode in MODES),
        path_north_m=path_north,
        path_east_m=path_east,
        outlines=drawn_outlines(mission, vehicles[0]),
        mission=mission.name,
        controller=mission.controller.type,
        plant=plant or mission.leader_vehicle.plant,
        wind=mission.wind.type,
        mode=mode,
        rate_hz=mission.rehearsal.rate_hz,
        seed=mission.rehearsal.seed,
        duration_s=times[-1],
        wall_s=wall_s,
        acceptance=RecordAcceptance(**mission.acceptance.model_dump()),
        origin=RecordOrigin(**mission.origin.model_dump()),
        events=merged_events(event for event in events if 0.0 <= event.time_s <= times[-1]),
    )


def beside_paths(
    mission: Mission, north: FloatArray, east: FloatArray, course: FloatArray, numbers: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a leader's cross-track error, m, and the course of its path, rad.

    The leader's north and east are in m, its course is in rad. `numbers` are indices of the followed path;
    where they are NaN, so are the results.
    """
    error, tangent = np.full_like(north, math.nan), np.full_like(north, math.nan)
    for number, shape in enumerate(mission.paths_by_name.values()):
        flown = numbers == number
        if flown.any():
            nearest = path_of(shape).nearest(north[flown], east[flown], course[flown])
            error[flown], tangent[flown] = nearest.cross_track_error, nearest.course
    return error, tangent


def doings_row(snapshot: Snapshot, path_names: Sequence[str]) -> tuple[float, ...]:
    """Return the values of a snapshot in the order of `DOINGS`; NaN where there is no setpoint."""
    setpoint = snapshot.setpoint
    course, speed, limited = (
        (math.nan, math.nan, False)
        if setpoint is None
        else (setpoint.course, setpoint.speed, bool(setpoint.limited))
    )
    return (
        MODES.index(snapshot.mode),
        course,
        speed,
        limited,
        snapshot.lyapunov,
        path_number(snapshot.path, path_names),
    )


def path_number(path: str | None, names: Sequence[str]) -> float:
    """Return the index of a path among those of the mission; NaN for None and for unknown paths."""
    return float(names.index(path)) if path in names else math.nan


def lead_row(snapshot: Snapshot, ground_amsl_m: float) -> tuple[float, ...]:
    """Return a companion's `LEADS`, NaN where it did not lead, by the altitude of the mission's origin, m."""
    lead = snapshot.lead
    if lead is None:
        return (math.nan,) * len(LEADS)
    motion = lead.motion
    altitude = ground_amsl_m + float(motion.height)
    return lead.term, motion.north, motion.east, motion.course, altitude


def columns(rows: Sequence[float], names: Sequence[str]) -> dict[str, FloatArray]:
    """Return the columns, by name, of a table that is stored row after row."""
    values = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    return {name: values[:, number].copy() for number, name in enumerate(names)}


def local_positions(
    mission: Mission, latitude_deg: FloatArray, longitude_deg: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of positions, m, in the companions' local frame."""
    origin = mission.origin
    north, east, _ = pymap3d.geodetic2ned(
        latitude_deg,
        longitude_deg,
        origin.altitude_amsl_m,
        origin.latitude_deg,
        origin.longitude_deg,
        origin.altitude_amsl_m,
    )
    return np.asarray(north, dtype=np.float64), np.asarray(east, dtype=np.float64)


def drawn_path(mission: Mission, leader: VehicleRecord) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of points along the mission's main path, m."""
    return drawn_points(path_of(mission.path), leader)


def drawn_outlines(mission: Mission, leader: VehicleRecord) -> tuple[Outline, ...]:
    """Return outlines of the paths other than the main one, of all fences, and of the rally points."""
    lines: list[tuple[OutlineKind, tuple[FloatArray, FloatArray]]] = [
        ("path", drawn_points(path_of(shape), leader)) for shape in mission.paths.values()
    ]
    lines += [("fence", edge) for edge in fence_edges(mission)]
    rally = rally_points(mission)
    lines += [("rally", rally)] if rally[0].size else []
    return tuple(Outline(kind=kind, north_m=north, east_m=east) for kind, (north, east) in lines)


def fence_edges(mission: Mission) -> list[tuple[FloatArray, FloatArray]]:
    """Return (north, east) of points along the edge of each area of all fences, m."""
    fences = fences_of(mission)
    frame = frame_of(mission.model_dump()) if fences else None
    return [area.edge(frame) for fence in fences for area in fence.areas]


def rally_points(mission: Mission) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of the rally points of all paths, m."""
    points = [point for shape in mission.paths_by_name.values() for point in shape.rally_points]
    frame = frame_of(mission.model_dump()) if points else None
    places = np.array([point.local(frame) for point in points]).reshape(-1, 2)
    return places[:, 0], places[:, 1]


def drawn_points(path: Path, leader: VehicleRecord) -> tuple[FloatArray, FloatArray]:
    """Return (north, east) of points once round a path, or as far along as the leader came, m."""
    count = DRAWN_POINTS
    if math.isfinite(path.length):
        places = path.at(path.outline(count))
        return places.north, places.east
    progress = path.nearest(leader.north_m, leader.east_m, leader.course_rad).progress
    places = path.at(np.linspace(min(0.0, float(progress.min())), float(progress.max()), count))
    return places.north, places.east


NUMBERS = frozenset(sitl_stub.Truth.__struct_fields__) - {"mode", "armed"}

AFTERWARDS_S = 60.0
"""Time after the end of the flight from which true states are dropped, s."""


class TruthCollector(asyncio.DatagramProtocol):
    """Collector of the true states of all vehicles of a mission, by sample time."""

    def __init__(self, mission: Mission) -> None:
        self._mission = mission
        flying = (mission.leader.vehicle, *mission.followers_by_name)
        self._names = {mission.vehicles[name].system_id: name for name in flying}
        self._rate_hz = mission.rehearsal.rate_hz
        self.truths: dict[str, dict[int, sitl_stub.Truth]] = defaultdict(dict)
        """True states by vehicle and sample number."""

    def datagram_received(self, data: bytes, _address: object) -> None:
        """Take one true state of one vehicle as a JSON object; ignore anything else."""
        decoded = decode_truth(data)
        if decoded is not None and decoded[0] in self._names:
            system_id, truth = decoded
            if truth.time_s > self._mission.rehearsal.duration_s + AFTERWARDS_S:
                return
            self.truths[self._names[system_id]][round(truth.time_s * self._rate_hz)] = truth

    @property
    def time_s(self) -> float:
        """Newest time up to which every vehicle has been heard, s; negative before the first."""
        if len(self.truths) < len(self._names):
            return -1.0
        return min(max(samples) for samples in self.truths.values()) / self._rate_hz

    def last_seen_s(self) -> dict[str, float]:
        """Return the time of each vehicle's newest state, s; negative before the first."""
        return {
            name: max(self.truths[name]) / self._rate_hz if name in self.truths else -1.0
            for name in self._names.values()
        }

    def common_samples(self) -> list[int]:
        """Return the numbers of the samples that are known of every vehicle, in order."""
        if len(self.truths) < len(self._names):
            return []
        return sorted(set.intersection(*(set(samples) for samples in self.truths.values())))

    def record(
        self,
        *,
        wall_s: float,
        tracks: Mapping[str, GuidanceTrack] | None = None,
        only_at_s: float | None = None,
        events: Iterable[FlightEvent] = (),
        responses: Mapping[str, VehicleResponse | None] | None = None,
    ) -> FlightRecord:
        """Return the record of the flight so far, with companions' known tracks and responses by vehicle.

        Tracks and events are in flight time, `wall_s` is real time. With `only_at_s`, s, the record has only
        the newest sample that is not later, for a display.

        Raises:
            VfguideError: there is no sample of all vehicles.
        """
        last_s = self._mission.rehearsal.duration_s
        last = round((last_s if only_at_s is None else min(only_at_s, last_s)) * self._rate_hz)
        samples = [one for one in self.common_samples() if one <= last]
        if only_at_s is not None:
            samples = samples[-1:]
        if not samples:
            raise VfguideError("nothing was seen of the flight")
        times = [sample / self._rate_hz for sample in samples]
        vehicles = []
        for name in (self._mission.leader.vehicle, *self._mission.followers_by_name):
            recorder = VehicleRecorder(self._mission, name)
            track = (tracks or {}).get(name)
            for sample, time_s in zip(samples, times, strict=True):
                # The guidance step that answers this sample's report comes a little later.
                step = track.at(time_s + 0.5 / self._rate_hz) if track is not None else None
                recorder.sample(self.truths[name][sample], snapshot_of(step))
            record = replace(recorder.record(), response=(responses or {}).get(name))
            if track is not None:
                record = replace(record, **self._series(name, track, np.array(times)))
            vehicles.append(record)
        return flight_record(
            self._mission, times, vehicles, wall_s=wall_s, mode="live", events=events
        )

    def _series(self, name: str, track: GuidanceTrack, times: FloatArray) -> dict[str, Any]:
        """Return the known series of commanded slots, leader state ages and leader motion of a vehicle."""
        mission, follower = self._mission, self._mission.followers_by_name.get(name)
        found: dict[str, Any] = {}
        if follower is not None:
            slot = follower.slot
            found |= slot_series(track, times, (slot.forward_m, slot.right_m, slot.up_m))
            found |= age_series(track, times)
        if mission.deputies:
            found |= lead_series(track, times, mission.origin.altitude_amsl_m)
        return found


def snapshot_of(step: GuidanceStep | None) -> Snapshot:
    """Return a logged guidance step as a companion snapshot."""
    if step is None or step.mode not in {mode.value for mode in MODES}:
        return UNSEEN
    setpoint = None
    if math.isfinite(step.course_rad):
        setpoint = Setpoint(course=step.course_rad, speed=step.speed_m_s, turn_limited=step.limited)
    return Snapshot(
        mode=Mode(step.mode), setpoint=setpoint, lyapunov=step.lyapunov_m2, path=step.path
    )


def decode_truth(data: bytes) -> tuple[int, sitl_stub.Truth] | None:
    """Decode (system ID, true state) from a datagram; None where it is invalid."""
    try:
        content = json.loads(data)
        numbers: dict[str, Any] = {name: float(content[name]) for name in NUMBERS}
        mode, armed = str(content["mode"]), bool(content["armed"])
        system_id = int(content["system_id"])
    # Deep nesting exhausts the parser's recursion, and a huge integer overflows a float.
    except (ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    if not all(math.isfinite(number) for number in numbers.values()) or numbers["time_s"] < 0.0:
        return None
    return system_id, sitl_stub.Truth(**numbers, mode=mode, armed=armed)
