"""PX4's OFFBOARD mode: a stream of velocity setpoints, of which a fixed wing flies the course."""

import math
from collections.abc import Callable, Mapping

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import (
    CUSTOM_MODE_FLAG,
    DO_CHANGE_SPEED,
    DO_SET_MODE,
    Command,
    Handlers,
    NonFiniteError,
    Result,
    finite,
    height_target,
    is_flyable_airspeed,
)
from sitl_stub.flight import Flight
from sitl_stub.modes import AUTO_LOITER, OFFBOARD, PX4_MODES, px4_custom_mode
from sitl_stub.targets import HeightTarget, SpeedTarget, TurnTarget

STREAM_FRESH_US = 500_000
"""A setpoint this recent lets OFFBOARD be entered: the stream must run at 2 Hz or faster."""

STREAM_LOST_US = 1_000_000
"""COM_OF_LOSS_T: OFFBOARD is left when the last setpoint is older than this."""

LOCAL_NED_FRAME = 1
"""MAV_FRAME_LOCAL_NED."""

IGNORE_X, IGNORE_Y, IGNORE_Z = 1, 2, 4
IGNORE_VX, IGNORE_VY = 8, 16
IGNORE_ACCELERATION = 64 | 128 | 256
"""POSITION_TARGET_TYPEMASK: a set bit means that the field is not to be used."""

AIRSPEED, GROUND_SPEED = 0.0, 1.0
"""SPEED_TYPE."""

Setpoint = tuple[TurnTarget | None, HeightTarget | None]
"""What a setpoint message asks for; None leaves a loop alone."""


class Px4:
    """PX4 for a fixed wing."""

    firmware = 12  # MAV_AUTOPILOT_PX4
    capabilities = 2 | 8 | 128 | 8192  # PARAM_FLOAT, COMMAND_INT, local setpoints, MAVLINK2
    estimates_wind = False
    initial_mode = AUTO_LOITER

    def __init__(self) -> None:
        self.commands: Handlers = {
            DO_SET_MODE: self._set_mode,
            DO_CHANGE_SPEED: change_speed,
        }
        self.setpoints: Mapping[str, Callable[[Flight, MAVLink_message], str | None]] = {
            "SET_POSITION_TARGET_LOCAL_NED": self._local_setpoint,
            "SET_POSITION_TARGET_GLOBAL_INT": self._global_setpoint,
        }
        self.deadline_us: int | None = None
        self._latest: Setpoint = (None, None)
        self._latest_us: int | None = None

    def request_mode(self, flight: Flight, custom_mode: int) -> Result:
        """Enter a mode; OFFBOARD only while setpoints are already arriving."""
        mode = PX4_MODES.get(custom_mode)
        if mode is None:
            return Result.DENIED
        if mode is flight.mode:
            return Result.ACCEPTED
        self.deadline_us = None
        if mode is OFFBOARD:
            if self._latest_us is None or flight.time_us - self._latest_us > STREAM_FRESH_US:
                return Result.TEMPORARILY_REJECTED
            flight.enter(mode)
            self._fly(flight)
        else:
            flight.enter(mode)
        return Result.ACCEPTED

    def watch(self, flight: Flight) -> None:
        """Leave OFFBOARD for a loiter when the stream has stopped."""
        if self.deadline_us is not None and flight.time_us >= self.deadline_us:
            self.deadline_us = None
            flight.texts.append("Offboard control lost")
            flight.enter(AUTO_LOITER)

    def parameters(self, flight: Flight) -> dict[str, float]:
        """Limits as flown."""
        plant = flight.plant
        return {
            "COM_OF_LOSS_T": STREAM_LOST_US * 1e-6,
            "FW_AIRSPD_MAX": plant.airspeed_max_m_s,
            "FW_AIRSPD_MIN": plant.airspeed_min_m_s,
            "FW_R_LIM": math.degrees(plant.max_bank_rad),
        }

    def _set_mode(self, flight: Flight, command: Command) -> Result:
        """176: param2 main mode, param3 sub mode."""
        flags, main, sub = command.used(1, 2, 3)
        in_bytes = all(0.0 <= part <= 255.0 and part == int(part) for part in (main, sub))
        if not int(flags) & CUSTOM_MODE_FLAG or not in_bytes:
            return Result.DENIED
        return self.request_mode(flight, px4_custom_mode(int(main), int(sub)))

    def _local_setpoint(self, flight: Flight, message: MAVLink_message) -> str | None:
        """SET_POSITION_TARGET_LOCAL_NED: z is down from home."""
        if message.coordinate_frame != LOCAL_NED_FRAME:
            return "unsupported setpoint"
        return self._take(
            flight,
            message,
            lambda: HeightTarget(flight.home.altitude_amsl_m - finite(message.z)[0]),
        )

    def _global_setpoint(self, flight: Flight, message: MAVLink_message) -> str | None:
        """SET_POSITION_TARGET_GLOBAL_INT: alt is up, in the frame's own meaning."""
        return self._take(
            flight,
            message,
            lambda: height_target(flight, message.coordinate_frame, finite(message.alt)[0]),
        )

    def _take(
        self,
        flight: Flight,
        message: MAVLink_message,
        height_of: Callable[[], HeightTarget | None],
    ) -> str | None:
        """Take a setpoint into the stream; returns why not, or None."""
        mask = message.type_mask
        if not is_velocity_only(mask):
            return "unsupported setpoint"
        try:
            turn = course_of(*finite(message.vx, message.vy))
            height = None if mask & IGNORE_Z else height_of()
        except NonFiniteError:
            return "non-finite field"
        if height is None and not mask & IGNORE_Z:
            return "unsupported setpoint"
        self._latest = (turn or self._latest[0], height)
        self._latest_us = flight.time_us
        if flight.mode is OFFBOARD:
            self._fly(flight)
        return None

    def _fly(self, flight: Flight) -> None:
        turn, height = self._latest
        if turn is not None:
            flight.hold_turn(turn)
        if height is not None:
            flight.hold_height(height)
        if self._latest_us is not None:
            self.deadline_us = self._latest_us + STREAM_LOST_US + 1


def is_velocity_only(type_mask: int) -> bool:
    """Whether horizontal velocity is used and neither position nor acceleration is.

    Height may be used or not; yaw means nothing to a fixed wing.
    """
    ignored = IGNORE_X | IGNORE_Y | IGNORE_ACCELERATION
    return type_mask & ignored == ignored and not type_mask & (IGNORE_VX | IGNORE_VY)


def course_of(north_m_s: float, east_m_s: float) -> TurnTarget | None:
    """The course of a velocity vector; its length is ignored. None for the zero vector."""
    if north_m_s == 0.0 and east_m_s == 0.0:
        return None
    return TurnTarget("course", math.atan2(east_m_s, north_m_s))


def change_speed(flight: Flight, command: Command) -> Result:
    """178: param1 type, param2 m/s. A ground speed needs the article's ideal plant."""
    kind, speed_m_s = command.used(1, 2)
    if kind == AIRSPEED and is_flyable_airspeed(flight, speed_m_s):
        flight.hold_speed(SpeedTarget("airspeed", speed_m_s))
        return Result.ACCEPTED
    if kind == GROUND_SPEED and flight.plant.kind == "course-hold" and speed_m_s > 0.0:
        flight.hold_speed(SpeedTarget("ground-speed", speed_m_s))
        return Result.ACCEPTED
    return Result.DENIED
