"""The recordings of one flight: which belong together, and by which clock.

Three clocks can join what several computers have written down. The formation's own clock is the best: by it
the companions flew, and the link measured it to some milliseconds. Satellite time, where every autopilot
passed it on, comes next. The computers' times of day are the last resort: without a network they may be
apart by any time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vfguide.errors import InputError
from vfguide.lab.debrief.telemetry import Telemetry, read_telemetry
from vfguide.mission import load_mission
from vfguide.mission.model import Mission
from vfguide.record.events import SUFFIX as EVENTS_SUFFIX
from vfguide.record.events import FlightEvent, read_events
from vfguide.record.guidance_log import GuidanceTrack, read_guidance
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

TOGETHER_S = 60.0
"""s between the end of one recording and the start of the next of the same flight."""

FORMATION_CLOCK = "the formation's clock, which the link measured to some milliseconds"
SATELLITE_TIME = "satellite time, as the autopilots passed it on, good to some tenths of a second"
TIME_OF_DAY = (
    "each computer's own time of day, which nothing compared: distances between vehicles are off by "
    "their speed times the difference of those clocks"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RecordingContents:
    """One recording, read."""

    directory: Path
    """Where it is."""
    start: RecordingStart
    """Who began it, and when."""
    telemetry: Telemetry
    """What its autopilot reported."""
    guidance: GuidanceTrack
    """What its companion did, by the companion's own clock, s."""
    events: tuple[FlightEvent, ...] = ()
    """What its companion said, in s of its own clock."""
    response: VehicleResponse | None = None
    """By what its companion flew it last; None where that is not recorded."""

    @property
    def span_s(self) -> tuple[float, float]:
        """From its start to its last report, s since 1970 by its computer."""
        times = self.telemetry.positions[:, 0]
        return self.start.unix_s, float(times.max()) if times.size else self.start.unix_s

    def formation_offset_s(self, leader: str) -> float:
        """What to add to the companion's clock for the leader's, s; NaN where that was never known."""
        if self.start.vehicle == leader:
            return 0.0
        offsets = [step.formation_time_s - step.time_s for step in self.guidance.steps]
        known = np.array([one for one in offsets if np.isfinite(one)])
        return float(np.median(known)) if known.size else float("nan")

    def satellite_offset_s(self) -> float:
        """What to add to the computer's time of day for satellite time, s; NaN where that was never told."""
        times = self.telemetry.gps_times
        return float(np.median(times[:, 1] - times[:, 0])) if len(times) else float("nan")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FlightRecordings:
    """The recordings of one flight, on one clock."""

    mission: Mission
    """The mission as it was flown."""
    recordings: tuple[RecordingContents, ...]
    """In the order of their starts."""
    shifts_s: tuple[float, ...]
    """What to add to s since 1970 of each recording for the common clock."""
    clock: str
    """Which clock that is, in words."""
    notes: tuple[str, ...]
    """What else a reader has to know."""


def collect(directories: Sequence[Path]) -> FlightRecordings:
    """Read the recordings in some directories, and choose their clock.

    Args:
        directories: recordings, or directories that hold them; of the latter the newest flight counts.

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
    """Everything in one directory.

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
    """A leader without a companion, as the follower heard it that heard most of it; none where nobody did.

    Its telemetry is in what its followers recorded, late by what it took to arrive.
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
    # Whatever is known of the clock is the follower's.
    return [best] if len(best.telemetry.positions) else []


def newest_flight(recordings: Sequence[RecordingContents]) -> list[RecordingContents]:
    """Those that overlap the newest, or one that overlaps it, and so on; in order."""
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
    """(what to add to each recording's times, which clock that gives)."""
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
