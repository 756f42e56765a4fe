"""Make a flight record of the autopilots' own logs alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import REMEDY, AutopilotLog
from vfguide.lab.debrief.flight import FlightRecordings, RecordingContents, flight_of
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import GuidanceStep, GuidanceTrack
from vfguide.record.recording import RecordingStart

SATELLITE_TIME = "satellite time, as each autopilot wrote it into its log"
ONE_CLOCK = "the one autopilot's clock"
GROUND_CLOCK = (
    "the clock of the computer that wrote the telemetry logs; on several computers distances are off by "
    "the vehicles' speed times the difference of their clocks"
)

NO_ORDERS = "slots and path are the mission's own: an autopilot's log tells of no orders"
"""Note for readers, since slots may have been commanded otherwise in flight."""

WINDOW_S = 20.0
"""Window over which satellite time is compared with a log's clock, s. That clock drifts by up to some
50 millionths: one comparison for an hour would be off by 0.1 s at its ends, 2 m at 20 m/s."""

LEAST_TIMES = 10
"""Least number of satellite times for a comparison; the last window may have fewer."""

TRUSTED_S = 0.5
"""Greatest credible deviation from a flight's median, s; receivers with wrong leap seconds exceed it."""

ASKED_S = 2.0
"""Time for which a setpoint holds without a new one, s."""

LOGGED_MODES = {Mode.WAITING.value: "not guided", Mode.TRACKING.value: "guided"}
"""Names of the modes that a log shows: whether setpoints came."""

ENDINGS = (".bin", ".ulg", ".tlog", ".csv")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LoggedFlight:
    """Flight read from logs."""

    record: FlightRecord
    """Record in even time steps, which has setpoints up to a step late."""
    setpoints: Mapping[str, FloatArray]
    """By vehicle, rows of exact time (s on the record's clock), course (rad) and airspeed (m/s)."""


def read_log(path: Path, mission: Mission) -> list[AutopilotLog]:
    """Read the logs of the mission's vehicles from one file; a telemetry log may hold several.

    Raises:
        InputError: the file cannot be read, is no log, or is of no vehicle of the mission.
    """
    ending = path.suffix.lower()
    if path.is_dir():
        raise InputError(f"{path}: is a directory; name the logs in it, one for each vehicle")
    if ending == ".tlog":
        from vfguide.lab.debrief.telemetry_log import read_telemetry_log

        return read_telemetry_log(path, mission)
    if ending == ".csv":
        from vfguide.lab.debrief.paparazzi import read_paparazzi

        return [read_paparazzi(path, mission)]
    if ending == ".bin":
        from vfguide.lab.debrief.dataflash import read_dataflash

        log = read_dataflash(path)
    elif ending == ".ulg":
        from vfguide.lab.debrief.ulog import read_ulog

        log = read_ulog(path)
    else:
        raise InputError(f"{path}: ends in none of {', '.join(ENDINGS)}; {REMEDY}")
    if log.system_id not in {vehicle.system_id for vehicle in mission.vehicles.values()}:
        raise InputError(
            f"{path}: is of system {log.system_id}, which no vehicle of the mission {mission.name!r} has"
        )
    return [log]


def logged_flight(mission: Mission, logs: Sequence[AutopilotLog]) -> LoggedFlight:
    """Make a flight of logs.

    Raises:
        InputError: two are of one vehicle, their clocks cannot be compared, or the leader's is missing.
    """
    names = {vehicle.system_id: name for name, vehicle in mission.vehicles.items()}
    by_system: dict[int, AutopilotLog] = {}
    for log in logs:
        earlier = by_system.setdefault(log.system_id, log)
        if earlier is not log:
            raise InputError(
                f"{log.path}: is of {names[log.system_id]!r}, as {earlier.path} is; "
                "give one log for each vehicle"
            )
    leader = mission.leader
    if mission.leader_vehicle.system_id not in by_system:
        told = ", ".join(f"{log.path} is of {names[log.system_id]!r}" for log in by_system.values())
        raise InputError(f"{told}; give the log of the leader {leader.vehicle!r}, too")
    aligned, clock = on_one_clock(logs)
    found = FlightRecordings(
        mission=mission,
        recordings=tuple(as_recorded(log, names[log.system_id], mission) for log in aligned),
        shifts_s=(0.0,) * len(aligned),
        clock=clock,
        notes=(NO_ORDERS, *dict.fromkeys(note for log in logs for note in log.notes)),
    )
    record = flight_of(found)
    began = record.begin_unix_s or 0.0
    return LoggedFlight(
        record=replace(
            record,
            mode_names=tuple(LOGGED_MODES.get(name, name) for name in record.mode_names),
            begin_unix_s=None if clock == ONE_CLOCK else record.begin_unix_s,
        ),
        setpoints={
            names[log.system_id]: log.setpoints - np.array([began, 0.0, 0.0]) for log in aligned
        },
    )


def on_one_clock(logs: Sequence[AutopilotLog]) -> tuple[list[AutopilotLog], str]:
    """Return (the logs with their times on one clock, description of that clock).

    Raises:
        InputError: one of several logs has no satellite time.
    """
    silent = [log for log in logs if not len(log.telemetry.gps_times)]
    if not silent:
        offsets = [satellite_offsets(log.telemetry.gps_times) for log in logs]
        return [*map(moved, logs, offsets)], SATELLITE_TIME
    if all(log.autopilot == "telemetry" for log in logs):
        return [moved(log, log.ground) for log in logs], GROUND_CLOCK
    if len(logs) == 1:
        return [*logs], ONE_CLOCK
    raise InputError(
        f"{silent[0].path}: tells no satellite time, so that it cannot be laid beside the others; "
        "give it alone, or the companions' recordings of the flight"
    )


def moved(log: AutopilotLog, found: FloatArray) -> AutopilotLog:
    """Return a log on another clock; rows of `found` are a time on its own clock and the offset there, s."""

    def on_the_other(rows: FloatArray) -> FloatArray:
        times = rows[:, :1]
        return np.hstack([times + np.interp(times, found[:, 0], found[:, 1]), rows[:, 1:]])

    telemetry = log.telemetry
    return replace(
        log,
        telemetry=replace(
            telemetry,
            positions=on_the_other(telemetry.positions),
            airspeeds=on_the_other(telemetry.airspeeds),
            banks=on_the_other(telemetry.banks),
            gps_times=on_the_other(telemetry.gps_times),
        ),
        setpoints=on_the_other(log.setpoints),
    )


def satellite_offsets(times: FloatArray) -> FloatArray:
    """Return rows of a time on a log's clock and the offset there to satellite time, s.

    A report waits up to one loop of the autopilot before it is logged; the mean of the middle half is equally
    late on all aircraft. Rows of `times`, at least one, are log time and satellite time, s.
    """
    ahead = times[:, 1] - times[:, 0]
    known = np.abs(ahead - np.median(ahead)) <= TRUSTED_S
    own, ahead = times[known, 0], ahead[known]
    windows = np.split(np.arange(own.size), np.flatnonzero(np.diff(own // WINDOW_S)) + 1)
    full = [one for one in windows if one.size >= LEAST_TIMES] or [np.arange(own.size)]
    return np.array([(float(np.mean(own[one])), middle_mean(ahead[one])) for one in full])


def middle_mean(values: FloatArray) -> float:
    """Return the mean of the middle half of values."""
    quarter = values.size // 4
    return float(np.mean(np.sort(values)[quarter : values.size - quarter]))


def as_recorded(log: AutopilotLog, vehicle: str, mission: Mission) -> RecordingContents:
    """Return a log as a companion's recording, with its setpoints as guidance steps."""
    return RecordingContents(
        directory=log.path.parent,
        start=RecordingStart(
            vehicle=vehicle,
            mission=mission.name,
            system_id=log.system_id,
            unix_s=0.0,
            clock_s=0.0,
            computer="",
            program="",
        ),
        telemetry=log.telemetry,
        guidance=GuidanceTrack(steps_of(log)),
    )


def steps_of(log: AutopilotLog) -> list[GuidanceStep]:
    """Return the guidance steps of a log: guided from each setpoint on for up to `ASKED_S`."""
    steps: list[GuidanceStep] = []
    for time_s, course, airspeed in log.setpoints.tolist():
        if steps and time_s - steps[-1].time_s > ASKED_S:
            steps.append(step(steps[-1].time_s + ASKED_S, Mode.WAITING, np.nan, np.nan))
        steps.append(step(time_s, Mode.TRACKING, course, airspeed))
    if steps:
        steps.append(step(steps[-1].time_s + ASKED_S, Mode.WAITING, np.nan, np.nan))
    return steps


def step(time_s: float, mode: Mode, course: float, airspeed: float) -> GuidanceStep:
    """Return a guidance step with these values."""
    return GuidanceStep(
        time_s=time_s,
        mode=mode.value,
        course_rad=course,
        speed_m_s=airspeed,
        limited=False,
        lyapunov_m2=np.nan,
    )
