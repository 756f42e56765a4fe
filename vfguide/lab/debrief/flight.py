"""Make a flight record of recordings. Positions are the autopilots' own estimates, since there is no truth.

Three clocks can join the recordings of several computers. The formation's clock is the best: the companions
flew by it, and the link measured it to some milliseconds. Satellite time comes next, where every autopilot
passed it on. The computers' times of day are the last resort: without a network they may differ by any time.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np

from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import Telemetry, read_telemetry
from vfguide.lab.rehearsal.recorder import (
    DOINGS,
    MODES,
    drawn_outlines,
    drawn_path,
    local_positions,
    path_number,
)
from vfguide.lab.rehearsal.recorder import vehicle_record as recorded_vehicle
from vfguide.mission import load_mission
from vfguide.mission.model import Mission
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.events import FlightEvent, merged_events, read_events
from vfguide.record.flight import FlightRecord, RecordAcceptance, RecordOrigin
from vfguide.record.guidance_log import (
    GuidanceStep,
    GuidanceTrack,
    age_series,
    lead_series,
    read_guidance,
    sampled,
    slot_series,
)
from vfguide.record.latency import recorded_latency
from vfguide.record.recording import (
    MISSION_NAME,
    RecordingStart,
    files_of,
    find_recordings,
    is_recording,
    part_of,
    read_start,
)
from vfguide.record.response import SUFFIX as RESPONSE_SUFFIX
from vfguide.record.response import VehicleResponse, read_response
from vfguide.record.vehicle import VehicleRecord

TOGETHER_S = 60.0
"""Longest gap between two recordings of the same flight, s."""

FORMATION_CLOCK = "the formation's clock, which the link measured to some milliseconds"
SATELLITE_TIME = "satellite time, as the autopilots passed it on, good to some tenths of a second"
TIME_OF_DAY = (
    "each computer's own time of day, which nothing compared: distances between vehicles are off by "
    "their speed times the difference of those clocks"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordingContents:
    """Contents of one recording."""

    directory: Path
    start: RecordingStart
    telemetry: Telemetry
    guidance: GuidanceTrack
    """Steps of the companion, by its own clock, s."""
    events: tuple[FlightEvent, ...] = ()
    """Events of the companion, by its own clock, s."""
    response: VehicleResponse | None = None
    """Vehicle response that the companion used last; None where not recorded."""

    @property
    def span_s(self) -> tuple[float, float]:
        """Start and last report, s since 1970 by the computer's clock."""
        times = self.telemetry.positions[:, 0]
        return self.start.unix_s, float(times.max()) if times.size else self.start.unix_s

    def formation_offset_s(self, leader: str) -> float:
        """Return the offset from the companion's clock to the leader's, s; NaN where it was never known."""
        if self.start.vehicle == leader:
            return 0.0
        offsets = [step.formation_time_s - step.time_s for step in self.guidance.steps]
        known = np.array([one for one in offsets if np.isfinite(one)])
        return float(np.median(known)) if known.size else float("nan")

    def satellite_offset_s(self) -> float:
        """Return the offset from the time of day to satellite time, s; NaN where it was never reported."""
        times = self.telemetry.gps_times
        return float(np.median(times[:, 1] - times[:, 0])) if len(times) else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightRecordings:
    """Recordings of one flight, with shifts to a common clock."""

    mission: Mission
    recordings: tuple[RecordingContents, ...]
    """Recordings in order of their starts; that of a leader without a companion comes last."""
    shifts_s: tuple[float, ...]
    """Offset of each recording's s since 1970 to the common clock."""
    clock: str
    """Description of the common clock."""
    notes: tuple[str, ...]


def collect(directories: Sequence[Path]) -> FlightRecordings:
    """Read the recordings in some directories and choose their common clock.

    Args:
        directories: recordings, or directories that hold recordings: only the newest flight is read then.

    Raises:
        InputError: there are none, one is damaged, or they are of several missions.
    """
    found = find_recordings(directories)
    if not found:
        raise InputError(f"{directories[0]}: holds no recording of a companion")
    read = sorted((read_recording(one) for one in found), key=lambda one: one.start.unix_s)
    notes = []
    if not all(is_recording(directory) for directory in directories):
        chosen = newest_flight(read)
        if len(chosen) < len(read):
            count = len(read) - len(chosen)
            notes.append(
                f"{count} recordings of earlier flights are left out; name their directories to see them"
            )
        read = chosen
    missions = [load_mission(one.directory / MISSION_NAME) for one in read]
    for one, mission in zip(read, missions, strict=True):
        if mission != missions[0]:
            raise InputError(
                f"{one.directory}: flew another mission than {read[0].directory}; "
                "give the recordings of one flight"
            )
        if one.start.vehicle not in mission.vehicles:
            raise InputError(f"{one.directory}: {one.start.vehicle!r} is not in its mission")
    read += heard_leader(read, missions[0])
    shifts, clock = common_clock(read, missions[0].timekeeper)
    return FlightRecordings(
        mission=missions[0],
        recordings=tuple(read),
        shifts_s=shifts,
        clock=clock,
        notes=tuple(notes),
    )


def read_recording(directory: Path) -> RecordingContents:
    """Read one recording.

    Raises:
        InputError: it cannot be read.
    """
    start = read_start(directory)
    tlog, guidance = files_of(directory, start.vehicle)
    return RecordingContents(
        directory=directory,
        start=start,
        telemetry=read_telemetry(tlog, system_id=start.system_id, start_s=start.unix_s),
        guidance=read_guidance(guidance),
        events=tuple(read_events(start.vehicle, part_of(directory, start.vehicle, EVENTS_SUFFIX))),
        response=read_response(part_of(directory, start.vehicle, RESPONSE_SUFFIX)),
    )


def heard_leader(
    recordings: Sequence[RecordingContents], mission: Mission
) -> list[RecordingContents]:
    """Return a leader without a companion, from the follower's recording that holds most of its positions.

    The times of positions are corrected by the least delay of the leader's telemetry.
    """
    if mission.leader.follows != "mavlink":
        return []
    name, system_id = mission.leader.vehicle, mission.leader_vehicle.system_id
    found = []
    for one in recordings:
        tlog, _ = files_of(one.directory, one.start.vehicle)
        heard = read_telemetry(tlog, system_id=system_id, start_s=one.start.unix_s)
        heard.positions[:, 0] -= mission.leader.least_delay_s or 0.0
        start = replace(one.start, vehicle=name, system_id=system_id)
        found.append(replace(one, start=start, telemetry=heard, events=(), response=None))
    best = max(found, key=lambda one: len(one.telemetry.positions))
    # The guidance steps stay the follower's: they give the clock offset.
    return [best] if len(best.telemetry.positions) else []


def newest_flight(recordings: Sequence[RecordingContents]) -> list[RecordingContents]:
    """Return the newest chain of recordings that overlap or lie within `TOGETHER_S`, by start."""
    chosen: list[RecordingContents] = []
    begin = float("inf")
    for one in sorted(recordings, key=lambda one: one.span_s[1], reverse=True):
        first, last = one.span_s
        if chosen and last < begin - TOGETHER_S:
            break
        chosen.append(one)
        begin = min(begin, first)
    return sorted(chosen, key=lambda one: one.start.unix_s)


def common_clock(
    recordings: Sequence[RecordingContents], leader: str
) -> tuple[tuple[float, ...], str]:
    """Return (offsets of the recordings' times to the best common clock in s, description of that clock)."""
    leading = [one.start for one in recordings if one.start.vehicle == leader]
    one_run = len({start.computer for start in leading}) == 1
    offsets = [one.formation_offset_s(leader) for one in recordings]
    if leading and one_run and np.all(np.isfinite(offsets)):
        zero = leading[0].to_unix(0.0)
        shifts = [
            zero + offset - one.start.to_unix(0.0)
            for one, offset in zip(recordings, offsets, strict=True)
        ]
        return tuple(shifts), FORMATION_CLOCK
    satellite = [one.satellite_offset_s() for one in recordings]
    if np.all(np.isfinite(satellite)):
        return tuple(satellite), SATELLITE_TIME
    return (0.0,) * len(recordings), TIME_OF_DAY


MARGIN_S = 5.0
"""Part of the flight before the first steered moment and after the last, s."""

LONGEST_S = 86_400.0
MOST_SAMPLES = 200_000

NAMES = {mode.value: number for number, mode in enumerate(MODES)}
STEERED = {mode.value for mode in Mode if mode.steers}

ESTIMATES = (
    "Positions are the autopilots' own estimates, not the truth: their errors show in no figure."
)


def flight_of(found: FlightRecordings) -> FlightRecord:
    """Make the flight record.

    Raises:
        InputError: the leader has no recorded position, or the recordings are too far apart in time.
    """
    mission = found.mission
    names = [mission.leader.vehicle, *mission.followers_by_name]
    parts: dict[str, list[tuple[RecordingContents, float]]] = {name: [] for name in names}
    for one, shift in zip(found.recordings, found.shifts_s, strict=True):
        parts.setdefault(one.start.vehicle, []).append((one, shift))
    flown = [name for name in names if any(len(one.telemetry.positions) for one, _ in parts[name])]
    if mission.leader.vehicle not in flown:
        for one, _ in parts[mission.leader.vehicle]:
            raise InputError(f"{without_position(one)}; the leader's is needed")
        where = ", ".join(str(one.directory) for one in found.recordings[:3])
        raise InputError(
            f"{where}: no position of the leader {mission.leader.vehicle!r} is recorded; "
            "give its recording, too"
        )
    begin, end = span_of(parts)
    if not 0.0 < end - begin <= LONGEST_S:
        raise InputError(
            f"{found.recordings[0].directory}: the recordings are {end - begin:.0f} s apart; "
            "give those of one flight"
        )
    rate = min(mission.rehearsal.rate_hz, MOST_SAMPLES / (end - begin))
    time_s = np.arange(0.0, end - begin, 1.0 / rate)
    vehicles = [vehicle_record(mission, name, parts[name], begin + time_s) for name in flown]
    leader = only_known(vehicles[0])
    path_north, path_east = drawn_path(mission, leader)
    return FlightRecord(
        time_s=time_s,
        vehicles=tuple(vehicles),
        mode_names=tuple(mode.value for mode in MODES),
        path_north_m=path_north,
        path_east_m=path_east,
        outlines=drawn_outlines(mission, leader),
        mission=mission.name,
        controller=mission.controller.type,
        plant=mission.leader_vehicle.plant,
        wind="as met",
        mode="recorded",
        rate_hz=rate,
        seed=0,
        duration_s=float(time_s[-1]),
        wall_s=None,
        acceptance=RecordAcceptance(**mission.acceptance.model_dump()),
        origin=RecordOrigin(**mission.origin.model_dump()),
        begin_unix_s=begin,
        latency=recorded_latency(
            {one.name: one.leader_age_s for one in vehicles if one.leader_age_s is not None}
        ),
        events=events_of(found, begin, float(time_s[-1])),
        notes=notes_of(found, [name for name in names if not parts[name]]),
    )


def events_of(found: FlightRecordings, begin_s: float, lasts_s: float) -> tuple[FlightEvent, ...]:
    """Return the companions' events during the flight, in s from its beginning."""
    events = [
        msgspec.structs.replace(event, time_s=one.start.to_unix(event.time_s) + shift - begin_s)
        for one, shift in zip(found.recordings, found.shifts_s, strict=True)
        for event in one.events
    ]
    return merged_events(event for event in events if 0.0 <= event.time_s <= lasts_s)


def notes_of(found: FlightRecordings, missing: list[str]) -> tuple[str, ...]:
    """Return notes on the origin of the record's figures."""
    notes = [ESTIMATES, f"The recordings are joined by {found.clock}."]
    if missing:
        notes.append(f"Not recorded: {', '.join(missing)}.")
    notes += [
        f"{without_position(one)}." for one in found.recordings if not len(one.telemetry.positions)
    ]
    notes.append("Moments of which a vehicle's recording says nothing are in no figure.")
    return (*notes, *(f"{note[0].upper()}{note[1:]}." for note in found.notes))


def without_position(one: RecordingContents) -> str:
    """Return the fault of a recording without any position of its vehicle, as a phrase."""
    tlog, _ = files_of(one.directory, one.start.vehicle)
    return (
        f"{tlog}: no position of system {one.start.system_id} is in it: "
        "its autopilot was not heard, or the file is damaged or another system's"
    )


def span_of(parts: dict[str, list[tuple[RecordingContents, float]]]) -> tuple[float, float]:
    """Return begin and end of the flight on the common clock, s: all steered moments, or else all reports."""
    steered, reported = [], []
    for recordings in parts.values():
        for one, shift in recordings:
            if len(times := one.telemetry.positions[:, 0] + shift):
                reported += [float(times.min()), float(times.max())]
            steered += [
                one.start.to_unix(step.time_s) + shift
                for step in one.guidance.steps
                if step.mode in STEERED
            ]
    if not steered:
        return min(reported), max(reported)
    return (
        max(min(steered) - MARGIN_S, min(reported)),
        min(max(steered) + MARGIN_S, max(reported)),
    )


def vehicle_record(
    mission: Mission, name: str, parts: list[tuple[RecordingContents, float]], moments: FloatArray
) -> VehicleRecord:
    """Make the record of one vehicle at the moments of the flight; NaN where it is not known."""
    positions, airspeeds, banks = (
        joined([(getattr(one.telemetry, name), shift) for one, shift in parts])
        for name in ("positions", "airspeeds", "banks")
    )
    when = positions[:, 0]
    north, east = local_positions(mission, positions[:, 1], positions[:, 2])
    velocity_north, velocity_east = (sampled(moments, when, positions[:, n]) for n in (4, 5))
    heading = sampled(moments, when, unwrapped(positions[:, 6]))
    airspeed = sampled(moments, airspeeds[:, 0], airspeeds[:, 1])
    follower = mission.followers_by_name.get(name)
    # A leader without a companion is known by a follower's recording, whose guidance is not the leader's.
    own = [] if follower is None and mission.leader.is_foreign else parts
    track = joined_track(own)
    more = lead_series(track, moments, mission.origin.altitude_amsl_m) if mission.deputies else {}
    if follower is not None:
        slot = follower.slot.point
        more |= slot_series(track, moments, (slot.forward, slot.right, slot.up))
        more |= age_series(track, moments)
    return recorded_vehicle(
        mission,
        name,
        doings_at(moments, track, tuple(mission.paths_by_name)),
        response=next((one.response for one, _ in reversed(parts) if one.response), None),
        north_m=sampled(moments, when, north),
        east_m=sampled(moments, when, east),
        altitude_amsl_m=sampled(moments, when, positions[:, 3]),
        course_rad=np.arctan2(velocity_east, velocity_north),
        ground_speed_m_s=np.hypot(velocity_north, velocity_east),
        heading_rad=heading,
        airspeed_m_s=airspeed,
        bank_rad=sampled(moments, banks[:, 0], banks[:, 1]),
        wind_north_m_s=velocity_north - airspeed * np.cos(heading),
        wind_east_m_s=velocity_east - airspeed * np.sin(heading),
        **more,
    )


def doings_at(
    moments: FloatArray, track: GuidanceTrack, path_names: Sequence[str]
) -> dict[str, FloatArray]:
    """Return the series of `DOINGS` at each moment, from the newest guidance step before it."""
    times = [-math.inf, *(step.time_s for step in track.steps)]
    nothing = (NAMES[Mode.WAITING.value], math.nan, math.nan, False, math.nan, 0.0)
    rows = [nothing, *(doings_row(step, path_names) for step in track.steps)]
    newest = np.searchsorted(times, moments, side="right") - 1
    return dict(zip(DOINGS, np.array(rows, dtype=np.float64)[newest].T, strict=True))


def joined_track(parts: list[tuple[RecordingContents, float]]) -> GuidanceTrack:
    """Return the guidance steps of all recordings of a vehicle, on the common clock."""
    steps = [
        msgspec.structs.replace(
            step,
            time_s=one.start.to_unix(step.time_s) + shift,
            lead_time_s=one.start.to_unix(step.lead_time_s) + shift,
        )
        for one, shift in parts
        for step in one.guidance.steps
    ]
    return GuidanceTrack(sorted(steps, key=lambda step: step.time_s))


def doings_row(step: GuidanceStep, path_names: Sequence[str]) -> tuple[float, ...]:
    """Return a step in the order of `DOINGS`; setpoints are NaN while the companion does not steer."""
    mode, path = NAMES.get(step.mode, NAMES[Mode.WAITING.value]), path_number(step.path, path_names)
    if step.mode not in STEERED:
        return mode, math.nan, math.nan, False, math.nan, path
    return mode, step.course_rad, step.speed_m_s, step.limited, step.lyapunov_m2, path


def unwrapped(angles: FloatArray) -> FloatArray:
    """Unwrap angles, rad, and leave NaN as they are."""
    known = np.isfinite(angles)
    whole = angles.copy()
    whole[known] = np.unwrap(angles[known])
    return whole


def joined(parts: list[tuple[FloatArray, float]]) -> FloatArray:
    """Join rows of several recordings, sorted by their times (column 0) on the common clock."""
    together = np.concatenate(
        [rows + shift * (np.arange(rows.shape[1]) == 0) for rows, shift in parts]
    )
    return together[np.argsort(together[:, 0], kind="stable")]


def only_known(leader: VehicleRecord) -> VehicleRecord:
    """Return the leader's record without its unknown positions, to draw the path.

    Raises:
        InputError: all positions are unknown.
    """
    known = np.isfinite(leader.north_m)
    if not bool(known.any()):
        raise InputError(
            f"no position of the leader {leader.name!r} is recorded while it was steered"
        )
    return replace(leader, north_m=leader.north_m[known], east_m=leader.east_m[known])
