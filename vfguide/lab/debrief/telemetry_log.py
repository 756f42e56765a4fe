"""Telemetry logs of ground stations and companions, on each aircraft's own clock.

The clock of the computer that writes a log may be set meanwhile; a small computer's begins in 1970. Each
autopilot reports its time since boot and the satellite time, and these clocks do not jump.
"""

import math
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVError, MAVLink, MAVLink_message

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError
from vfguide.lab.debrief.autopilot_log import (
    AUTOPILOT,
    READERS,
    REMEDY,
    AutopilotLog,
    LogRows,
    Telemetry,
    by_boot_clock,
    in_order,
    in_this_era,
)
from vfguide.mavlink.codec import COMPANION_COMPONENT
from vfguide.mission.model import Mission
from vfguide.record.tlog import read_tlog

COMMANDS = frozenset({mavlink.MAVLINK_MSG_ID_COMMAND_INT, mavlink.MAVLINK_MSG_ID_COMMAND_LONG})
SPEED_COMMANDS = frozenset({mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, mavlink.MAV_CMD_DO_CHANGE_SPEED})
SPEED_TYPE_AIRSPEED = 0

POSITION, SETPOINTS = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT, "setpoints"
WANTED: Mapping[int, Collection[int]] = {AUTOPILOT: READERS, COMPANION_COMPONENT: COMMANDS}
"""Message ids to read, by component id."""

LEAST_LEAP_S, MOST_BACK_S = 1.0, 0.5
"""Steps of the computer's clock, forward and back, beyond which it has paused or been set."""

RESTART_S = 2.0
"""Step back of an autopilot's clock that means a restart; frames overtake each other by less."""

LONGEST_WAIT_S = 1.0
"""Largest time after the last frame with a boot time at which a frame without one is placed."""

LONGEST_PAUSE_S = 86_400.0


class SteadyClock:
    """The computer's clock without its jumps, which the autopilots' clocks tell apart from pauses."""

    def __init__(self) -> None:
        self.shift_s = 0.0
        """Present correction to add to the computer's clock, s."""
        self._shown_s: float | None = None
        self._before_s = 0.0
        self._unsure = False
        self._newest: dict[int, tuple[float, float]] = {}

    def at(self, shown_s: float, system_id: int, boot_s: float | None) -> float:
        """Return the corrected time of a frame, s, from the computer's clock and the sender's boot time."""
        step = 0.0 if self._shown_s is None else shown_s - self._shown_s
        if not -MOST_BACK_S <= step <= LEAST_LEAP_S:
            if not self._unsure:
                self._before_s = self.shift_s
            self._unsure = True
            self.shift_s -= step
        self._shown_s = shown_s
        earlier = self._newest.get(system_id)
        if self._unsure and boot_s is not None and earlier is not None:
            passed = boot_s - earlier[0]
            if 0.0 < passed < LONGEST_PAUSE_S:
                found = earlier[1] + passed - shown_s
                # A pause leaves the correction as it was; frames are late by some tenths of a second.
                paused = abs(found - self._before_s) < LEAST_LEAP_S
                self.shift_s = self._before_s if paused else found
                self._unsure = False
        time_s = shown_s + self.shift_s
        if boot_s is not None:
            self._newest[system_id] = boot_s, time_s
        return time_s


class VehicleFrames:
    """Contents of one vehicle's frames, each with the vehicle's time and the computer's."""

    def __init__(self) -> None:
        # Frames held back by a slow link arrive together.
        self._rows = LogRows(finest_step_s=0.0)
        self._base_s = 0.0
        self._own_s: float | None = None
        self._came_s = 0.0
        self._course = self._airspeed = math.nan

    def add(self, came_s: float, message: MAVLink_message) -> None:
        """Take a frame that arrived at this time of the computer's clock."""
        own_s = self._own_time(came_s, boot_time_s(message))
        kind = message.get_msgId()
        reader = READERS.get(kind)
        columns = self._setpoint(message) if reader is None else reader(message)
        if columns is not None:
            # The first column of a position is the autopilot's time, which is known already.
            columns = columns[1:] if kind == POSITION else columns
            self._rows.add(SETPOINTS if reader is None else str(kind), own_s, came_s, *columns)

    def _own_time(self, came_s: float, boot_s: float | None) -> float:
        if boot_s is None:
            waited_s = min(max(came_s - self._came_s, 0.0), LONGEST_WAIT_S)
            return came_s if self._own_s is None else self._own_s + waited_s
        own_s = boot_s + self._base_s
        if self._own_s is not None and own_s < self._own_s - RESTART_S:
            self._base_s += self._own_s - own_s + max(came_s - self._came_s, 0.0)
            own_s = boot_s + self._base_s
        self._own_s, self._came_s = own_s, came_s
        return own_s

    def _setpoint(self, message: MAVLink_message) -> tuple[float, float] | None:
        """Return course in rad and airspeed in m/s, once both have been commanded."""
        if message.command == mavlink.MAV_CMD_GUIDED_CHANGE_HEADING:
            self._course = math.remainder(math.radians(message.param2), math.tau)
        elif message.command in SPEED_COMMANDS and message.param1 == SPEED_TYPE_AIRSPEED:
            self._airspeed = message.param2
        else:
            return None
        known = math.isfinite(self._course) and math.isfinite(self._airspeed)
        return (self._course, self._airspeed) if known else None

    def log(self, path: Path, system_id: int, shift_s: float) -> AutopilotLog | None:
        """Return the log on the vehicle's own time; None without a position.

        `shift_s` corrects the computer's clock as at the end, when the clock is most likely right.
        """
        positions = self._rows.table(str(POSITION), 8, needed=7)
        if not len(positions):
            return None
        own, came = np.ptp(positions[:, 0]), np.ptp(positions[:, 1])
        # An autopilot whose clock stands still has no time of its own.
        column = 0 if own > 0.5 * came else 1

        def timed(kind: int | str, columns: int) -> FloatArray:
            rows = self._rows.table(str(kind), columns, needed=2)
            return in_order(np.delete(rows, 1 - column, axis=1), needed=2)

        when, arrivals = positions[:, column], positions[:, 1] - shift_s
        made = by_boot_clock(arrivals, when) if column == 0 else arrivals
        times = timed(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 3)
        times[:, 1] = in_this_era(times[:, 1])
        return AutopilotLog(
            path=path,
            autopilot="telemetry",
            system_id=system_id,
            telemetry=Telemetry(
                positions=timed(POSITION, 8),
                airspeeds=timed(mavlink.MAVLINK_MSG_ID_VFR_HUD, 3),
                banks=timed(mavlink.MAVLINK_MSG_ID_ATTITUDE, 3),
                gps_times=times,
            ),
            setpoints=timed(SETPOINTS, 4),
            ground=in_order(np.column_stack([when, made - when])),
            notes=self._rows.notes(path),
        )


def boot_time_s(message: MAVLink_message) -> float | None:
    """Return the sender's time since boot, s; None if the frame does not hold it."""
    boot_ms = getattr(message, "time_boot_ms", None)
    return None if boot_ms is None else 1e-3 * boot_ms


def read_telemetry_log(path: Path, mission: Mission) -> list[AutopilotLog]:
    """Read a ground station's or companion's telemetry log, one result per vehicle with positions.

    Setpoints are courses and airspeeds sent by a companion, in a log of its connection.

    Raises:
        InputError: the log cannot be read, or holds no position of any vehicle.
    """
    vehicles = {one.system_id: VehicleFrames() for one in mission.vehicles.values()}
    clock, parser = SteadyClock(), MAVLink(None)
    empty = True
    for stamped in read_tlog(path):
        empty, frame = False, stamped.frame
        vehicle = vehicles.get(frame.system_id)
        wanted = WANTED.get(frame.component_id, ())
        if vehicle is None or frame.message_id not in wanted:
            continue
        try:
            message = parser.decode(bytearray(frame.content))
        except MAVError:
            continue
        vehicle.add(clock.at(stamped.time_s, frame.system_id, boot_time_s(message)), message)
    if empty:
        raise InputError(f"{path}: is no telemetry log, or an empty one; {REMEDY}")
    logs = [one.log(path, system_id, clock.shift_s) for system_id, one in vehicles.items()]
    found = [log for log in logs if log is not None]
    if not found:
        raise InputError(
            f"{path}: tells no position of any vehicle of the mission {mission.name!r}; "
            "their system ids have to be the mission's"
        )
    return found
