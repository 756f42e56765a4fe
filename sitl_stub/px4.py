"""PX4 for a fixed wing: its modes, parameters and fail-safes; setpoints are read in `px4_setpoints`."""

from dataclasses import replace
from typing import TYPE_CHECKING

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.arming import Arming
from sitl_stub.commands import (
    CUSTOM_MODE_FLAG,
    DO_CHANGE_SPEED,
    DO_REPOSITION,
    DO_SET_MODE,
    NAV_LOITER_UNLIM,
    NAV_RETURN_TO_LAUNCH,
    NAV_TAKEOFF,
    Command,
    Handlers,
    Result,
    finite,
    height_target,
    is_flyable_airspeed,
    place,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import LEAST_AIRSPEED_M_S, Flight
from sitl_stub.modes import (
    AUTO_LOITER,
    AUTO_RTL,
    AUTO_TAKEOFF,
    OFFBOARD,
    PX4_MODES,
    px4_custom_mode,
)
from sitl_stub.px4_parameters import px4_parameters
from sitl_stub.px4_setpoints import Setpoint, setpoint_of
from sitl_stub.targets import SpeedTarget
from sitl_stub.telemetry_ids import (
    ALTITUDE,
    BATTERY_STATUS,
    EKF_STATUS_REPORT,
    EXTENDED_SYS_STATE,
    GPS_RAW_INT,
    HOME_POSITION,
    LOCAL_POSITION_NED,
    SYSTEM_TIME,
    UNREQUESTED,
    WIND,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

STREAM_FRESH_US = 500_000
"""A setpoint this recent lets OFFBOARD be entered: the stream must run at 2 Hz or faster."""

LOSS_ACTION_RETURN = 3
"""COM_OBL_RC_ACT of returning home; every other ends in a loiter here."""

AIRSPEED, GROUND_SPEED = 0.0, 1.0
"""SPEED_TYPE."""

AIRSPEED_LIMITS = frozenset({"FW_AIRSPD_MIN", "FW_AIRSPD_MAX"})


class Px4:
    """PX4 for a fixed wing."""

    firmware = 12  # MAV_AUTOPILOT_PX4
    version = 0x010F_00FF
    # MISSION_INT, COMMAND_INT, PARAM_ENCODE_BYTEWISE, local setpoints, MAVLINK2
    capabilities = 4 | 8 | 16 | 128 | 8192
    unsent = frozenset({WIND, EKF_STATUS_REPORT})
    unrequested = UNREQUESTED | {
        ALTITUDE,
        BATTERY_STATUS,
        EXTENDED_SYS_STATE,
        GPS_RAW_INT,
        HOME_POSITION,
        LOCAL_POSITION_NED,
        SYSTEM_TIME,
    }
    modes = tuple(PX4_MODES.values())
    initial_mode = AUTO_LOITER
    ground_mode = AUTO_LOITER

    def __init__(self, config: AutopilotConfig) -> None:
        self.parameters = px4_parameters(config)
        self.arming = Arming(self._arming_fault, refused=Result.TEMPORARILY_REJECTED)
        self.commands: Handlers = {
            DO_SET_MODE: self._set_mode,
            DO_CHANGE_SPEED: change_speed,
            NAV_TAKEOFF: self._take_off,
            NAV_LOITER_UNLIM: self._loiter,
            NAV_RETURN_TO_LAUNCH: self._return,
            DO_REPOSITION: self._reposition,
        }
        self.setpoints: Mapping[str, Callable[[Flight, MAVLink_message], str | None]] = {
            "SET_POSITION_TARGET_LOCAL_NED": self._take,
            "SET_POSITION_TARGET_GLOBAL_INT": self._take,
        }
        self.deadline_us: int | None = None
        self._latest: Setpoint = (None, None)
        self._latest_us: int | None = None

    def begin(self, flight: Flight) -> None:
        """Give the flight the distances of the parameters, at its start."""
        parameters = self.parameters
        flight.navigation = replace(
            flight.navigation,
            take_off_height_m=parameters["MIS_TAKEOFF_ALT"],
            loiter_radius_m=parameters["NAV_LOITER_RAD"],
            return_height_m=parameters["RTL_RETURN_ALT"],
        )

    def changed(self, flight: Flight, name: str) -> None:
        """Let a parameter that was set take effect."""
        parameters = self.parameters
        self.begin(flight)
        if name in AIRSPEED_LIMITS:
            slowest_m_s, fastest_m_s = parameters["FW_AIRSPD_MIN"], parameters["FW_AIRSPD_MAX"]
            if LEAST_AIRSPEED_M_S <= slowest_m_s <= fastest_m_s:
                flight.set_airspeed_range(slowest_m_s, fastest_m_s)
        elif name == "FW_AIRSPD_TRIM":
            flight.cruise_airspeed_m_s = max(1.0, parameters[name])
        elif name == "FW_R_LIM":
            flight.set_max_bank_deg(parameters[name])

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

    def hear(self, flight: Flight, heartbeat: MAVLink_message) -> None:
        """Nothing: a lost data link is borne, as NAV_DLL_ACT = 0 says."""

    def watch(self, flight: Flight) -> None:
        """Leave OFFBOARD when the stream has stopped; leave the take-off when it is over."""
        if self.deadline_us is not None and flight.time_us >= self.deadline_us:
            self.deadline_us = None
            flight.texts.append("Offboard control lost")
            returns = self.parameters["COM_OBL_RC_ACT"] == LOSS_ACTION_RETURN
            flight.enter(AUTO_RTL if returns else AUTO_LOITER)
        if flight.mode is AUTO_TAKEOFF and flight.phase == "flying":
            orbit = flight.present_orbit
            flight.texts.append("Takeoff complete")
            flight.enter(AUTO_LOITER)
            if orbit is not None:
                flight.orbit(orbit)

    @property
    def _stream_lost_us(self) -> int:
        """How old the last setpoint may become."""
        return max(0, round(self.parameters["COM_OF_LOSS_T"] * 1e6))

    def _arming_fault(self, _flight: Flight) -> str | None:
        slowest, fastest = self.parameters["FW_AIRSPD_MIN"], self.parameters["FW_AIRSPD_MAX"]
        if not 0.0 < slowest < fastest:
            return "Invalid airspeed limits"
        return None

    def _set_mode(self, flight: Flight, command: Command) -> Result:
        """176: param2 main mode, param3 sub mode."""
        flags, main, sub = command.used(1, 2, 3)
        in_bytes = all(0.0 <= part <= 255.0 and part == int(part) for part in (main, sub))
        if not int(flags) & CUSTOM_MODE_FLAG or not in_bytes:
            return Result.DENIED
        return self.request_mode(flight, px4_custom_mode(int(main), int(sub)))

    def _take_off(self, flight: Flight, _command: Command) -> Result:
        """22: the take-off mode; it rolls as soon as it is armed. Height is MIS_TAKEOFF_ALT."""
        return self.request_mode(flight, AUTO_TAKEOFF.custom_mode)

    def _loiter(self, flight: Flight, _command: Command) -> Result:
        return self.request_mode(flight, AUTO_LOITER.custom_mode)

    def _return(self, flight: Flight, _command: Command) -> Result:
        return self.request_mode(flight, AUTO_RTL.custom_mode)

    def _reposition(self, flight: Flight, command: Command) -> Result:
        """192: loiter around a place."""
        where = place(command)
        height = height_target(flight, command.frame, *finite(command.z))
        if where is None or height is None:
            return Result.DENIED
        self.request_mode(flight, AUTO_LOITER.custom_mode)
        flight.orbit(flight.orbit_at(*where))
        flight.hold_height(height)
        return Result.ACCEPTED

    def _take(self, flight: Flight, message: MAVLink_message) -> str | None:
        """Take a setpoint into the stream; returns why not, or None."""
        setpoint = setpoint_of(flight, message)
        if isinstance(setpoint, str):
            return setpoint
        turn, height = setpoint
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
            self.deadline_us = self._latest_us + self._stream_lost_us + 1


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
