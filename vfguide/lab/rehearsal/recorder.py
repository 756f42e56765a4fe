"""Collects what happens on a rehearsal, or what its emulators tell of it, and makes a flight record of it."""

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
"""What a vehicle's record takes as it is from the emulator's true state."""

POSITION = ("latitude_deg", "longitude_deg")
"""What it turns into north and east."""

DOINGS = ("mode", "course", "speed", "limited", "lyapunov", "path")
"""What it takes from the companion's snapshot, as numbers."""

LEADS = ("term", "north", "east", "course", "altitude")
"""What it takes of the leader by which a vehicle leads, where the mission names deputies."""

MODES = tuple(Mode)

UNSEEN = Snapshot(mode=Mode.WAITING, setpoint=None, lyapunov=math.nan)
"""What is known of a companion that is not there, or not seen."""

truth_row = attrgetter(*POSITION, *TRUTHS)

DRAWN_POINTS = 361
"""Points of a drawn path."""


class VehicleRecorder:
    """True states of one aircraft and its companion's doings, sample by sample.

    Kept as plain numbers: a flight's objects would be looked through for garbage again and again.
    """

    def __init__(self, mission: Mission, name: str) -> None:
        """Record the vehicle of this name."""
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
        """Note where the aircraft is and what its companion did."""
        self._truths.extend(truth_row(truth))
        self._doings.extend(doings_row(snapshot, self._path_names))
        self._response = snapshot.response or self._response
        self._slots.extend(slot_row(snapshot, self._slot))
        if self._leads is not None:
            self._leads.extend(lead_row(snapshot, self._mission.origin.altitude_amsl_m))

    def record(self) -> VehicleRecord:
        """The samples so far."""
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
        """The slots over time, where another than the mission's was flown in."""
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
    """What is recorded of a vehicle, with what its mission says of it.

    Args:
        mission: the mission.
        name: of the vehicle.
        doings: of its companion, as `DOINGS` names them.
        response: by what it was flown last, if that is known.
        series: where it was and what else is told of it, as a `VehicleRecord` names them.
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
        # Nothing where it was the first path all the time.
        path_number=doings["path"].copy() if doings["path"].any() else None,
        **series,
    )


def limits_of(vehicle: Vehicle) -> FlightLimits:
    """What the mission allows a vehicle."""
    lowest, highest = vehicle.airspeed_range_m_s
    return FlightLimits(
        least_airspeed_m_s=lowest,
        greatest_airspeed_m_s=highest,
        greatest_bank_deg=vehicle.max_bank_deg,
    )


def declared_by(vehicle: Vehicle) -> VehicleResponse:
    """Return what the mission declares of how a vehicle answers."""
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
    """(forward, right, up) of the slot that is flown in, m: the one that was ordered, or the mission's.

    NaN of a vehicle that has left the formation.
    """
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
    """The record of a whole flight, from those of its vehicles, leader first, and what companions said."""
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
    """(cross-track error in m, course of the path in rad) of a leader, on the path that it follows each time.

    Args:
        mission: with all its paths.
        north: of the leader, m.
        east: of the leader, m.
        course: of the leader, rad.
        numbers: of the paths among those of the mission, the first 0; NaN where it follows none, nor is
            there an error then.
    """
    error, tangent = np.full_like(north, math.nan), np.full_like(north, math.nan)
    for number, shape in enumerate(mission.paths_by_name.values()):
        flown = numbers == number
        if flown.any():
            nearest = path_of(shape).nearest(north[flown], east[flown], course[flown])
            error[flown], tangent[flown] = nearest.cross_track_error, nearest.course
    return error, tangent


def doings_row(snapshot: Snapshot, path_names: Sequence[str]) -> tuple[float, ...]:
    """What a companion did last, in the order of `DOINGS`; NaN where it has sent no setpoint."""
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
    """The number of a path among those of the mission; NaN where none is followed, or one that it has not."""
    return float(names.index(path)) if path in names else math.nan


def lead_row(snapshot: Snapshot, ground_amsl_m: float) -> tuple[float, ...]:
    """By what a companion led, in the order of `LEADS`; NaN where it did not.

    Args:
        snapshot: of the companion.
        ground_amsl_m: altitude of the mission's origin, m.
    """
    lead = snapshot.lead
    if lead is None:
        return (math.nan,) * len(LEADS)
    motion = lead.motion
    altitude = ground_amsl_m + float(motion.height)
    return lead.term, motion.north, motion.east, motion.course, altitude


def columns(rows: Sequence[float], names: Sequence[str]) -> dict[str, FloatArray]:
    """The columns of rows that were written one behind the other, by name."""
    values = np.array(rows, dtype=np.float64).reshape(-1, len(names))
    return {name: values[:, number].copy() for number, name in enumerate(names)}


def local_positions(
    mission: Mission, latitude_deg: FloatArray, longitude_deg: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(north, east) of true positions, m, by the frame that companions use but all at once."""
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
    """Points along the path: round it once, or along one without end to where the leader ended."""
    return drawn_points(path_of(mission.path), leader)


def drawn_outlines(mission: Mission, leader: VehicleRecord) -> tuple[Outline, ...]:
    """The other paths, as far as `drawn_path` draws the first, the edges of all fences, and rally points."""
    lines: list[tuple[OutlineKind, tuple[FloatArray, FloatArray]]] = [
        ("path", drawn_points(path_of(shape), leader)) for shape in mission.paths.values()
    ]
    lines += [("fence", edge) for edge in fence_edges(mission)]
    rally = rally_points(mission)
    lines += [("rally", rally)] if rally[0].size else []
    return tuple(Outline(kind=kind, north_m=north, east_m=east) for kind, (north, east) in lines)


def fence_edges(mission: Mission) -> list[tuple[FloatArray, FloatArray]]:
    """(north, east) of points along the edge of each area of all fences, m."""
    fences = fences_of(mission)
    frame = frame_of(mission.model_dump()) if fences else None
    return [area.edge(frame) for fence in fences for area in fence.areas]


def rally_points(mission: Mission) -> tuple[FloatArray, FloatArray]:
    """(north, east) of the rally points of all paths, m."""
    points = [point for shape in mission.paths_by_name.values() for point in shape.rally_points]
    frame = frame_of(mission.model_dump()) if points else None
    places = np.array([point.local(frame) for point in points]).reshape(-1, 2)
    return places[:, 0], places[:, 1]


def drawn_points(path: Path, leader: VehicleRecord) -> tuple[FloatArray, FloatArray]:
    """(north, east) of points along a path, m."""
    count = DRAWN_POINTS
    if math.isfinite(path.length):
        places = path.at(path.outline(count))
        return places.north, places.east
    progress = path.nearest(leader.north_m, leader.east_m, leader.course_rad).progress
    places = path.at(np.linspace(min(0.0, float(progress.min())), float(progress.max()), count))
    return places.north, places.east


NUMBERS = frozenset(sitl_stub.Truth.__struct_fields__) - {"mode", "armed"}
"""Fields of a true state that are numbers."""

AFTERWARDS_S = 60.0
"""After the end of the flight nobody's true state is of interest."""


class TruthCollector(asyncio.DatagramProtocol):
    """Collects the true states of every vehicle at each sample time."""

    def __init__(self, mission: Mission) -> None:
        """Listen for the vehicles of a mission."""
        self._mission = mission
        flying = (mission.leader.vehicle, *mission.followers_by_name)
        self._names = {mission.vehicles[name].system_id: name for name in flying}
        self._rate_hz = mission.rehearsal.rate_hz
        self.truths: dict[str, dict[int, sitl_stub.Truth]] = defaultdict(dict)
        """By vehicle and number of the sample."""

    def datagram_received(self, data: bytes, _address: object) -> None:
        """One JSON object of one vehicle at one time; anything else is nobody's true state."""
        decoded = decode_truth(data)
        if decoded is not None and decoded[0] in self._names:
            system_id, truth = decoded
            if truth.time_s > self._mission.rehearsal.duration_s + AFTERWARDS_S:
                return
            self.truths[self._names[system_id]][round(truth.time_s * self._rate_hz)] = truth

    @property
    def time_s(self) -> float:
        """The newest time of which every vehicle's state is known; negative before the first."""
        if len(self.truths) < len(self._names):
            return -1.0
        return min(max(samples) for samples in self.truths.values()) / self._rate_hz

    def last_seen_s(self) -> dict[str, float]:
        """The newest time of which each vehicle's state is known; negative before the first."""
        return {
            name: max(self.truths[name]) / self._rate_hz if name in self.truths else -1.0
            for name in self._names.values()
        }

    def common_samples(self) -> list[int]:
        """Numbers of the samples that are known of every vehicle, in order."""
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
        """What has been seen so far.

        Args:
            wall_s: how long the flight took, s of real time.
            tracks: what companions did, by vehicle, at times of the flight; as far as it is known.
            only_at_s: the newest sample alone that is not after this time, s, for a display.
            events: what companions said, at times of the flight.
            responses: by what companions flew, by vehicle; as far as it is known.

        Raises:
            VfguideError: nothing has.
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
                # The answer to the report of this sample comes a little later.
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
        """The slots that a vehicle flew in, where they were ordered, what it heard and what it led by."""
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
    """What a companion had last done, as in a rehearsal in virtual time."""
    if step is None or step.mode not in {mode.value for mode in MODES}:
        return UNSEEN
    setpoint = None
    if math.isfinite(step.course_rad):
        setpoint = Setpoint(course=step.course_rad, speed=step.speed_m_s, turn_limited=step.limited)
    return Snapshot(
        mode=Mode(step.mode), setpoint=setpoint, lyapunov=step.lyapunov_m2, path=step.path
    )


def decode_truth(data: bytes) -> tuple[int, sitl_stub.Truth] | None:
    """System and true state of a datagram; None if it is none."""
    try:
        content = json.loads(data)
        numbers: dict[str, Any] = {name: float(content[name]) for name in NUMBERS}
        mode, armed = str(content["mode"]), bool(content["armed"])
        system_id = int(content["system_id"])
    # Deep nesting exhausts the parser, and a huge integer is no float.
    except (ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    if not all(math.isfinite(number) for number in numbers.values()) or numbers["time_s"] < 0.0:
        return None
    return system_id, sitl_stub.Truth(**numbers, mode=mode, armed=armed)
