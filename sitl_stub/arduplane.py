"""ArduPlane: its modes, parameters and fail-safe; what it obeys in GUIDED is in `guided`."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.arduplane_parameters import OLD_NAMES, arduplane_parameters
from sitl_stub.arming import Arming
from sitl_stub.commands import (
    CUSTOM_MODE_FLAG,
    DO_REPOSITION,
    DO_SET_MODE,
    NAV_LOITER_UNLIM,
    NAV_RETURN_TO_LAUNCH,
    Command,
    Handlers,
    Result,
    SystemStatus,
    finite,
    height_target,
    place,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import LEAST_AIRSPEED_M_S, Flight
from sitl_stub.guided import Guided
from sitl_stub.modes import ARDUPLANE_MODES, GUIDED, LOITER, MANUAL, RTL
from sitl_stub.telemetry_ids import (
    ALTITUDE,
    ATTITUDE,
    ESTIMATOR_STATUS,
    GLOBAL_POSITION_INT,
    HEARTBEAT,
    ONCE_A_SECOND_US,
    SYS_STATUS,
    VFR_HUD,
)

LEAST_AIRSPEED_MIN, LEAST_ROLL_LIMIT_DEG = 5, 3
"""Below these ArduPlane does not arm."""

CHANGE_MODE = 1
"""MAV_DO_REPOSITION_FLAGS: enter GUIDED for it."""

AUTO, FBWA = 10, 5

LONG_ACTIONS: Mapping[float, int] = {1.0: RTL.custom_mode, 2.0: FBWA, 4.0: AUTO}
"""Modes by FS_LONG_ACTN: home, gliding, the mission; 0 goes on in GUIDED and AUTO."""


class ArduPlane:
    """ArduPlane, as measured on the real one (4.7)."""

    firmware = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA
    version = 0x0407_0000
    capabilities = 2 | 4 | 8 | 8192  # PARAM_FLOAT, MISSION_INT, COMMAND_INT, MAVLINK2
    unsent = frozenset({ALTITUDE, ESTIMATOR_STATUS})
    unrequested = dict.fromkeys(
        (HEARTBEAT, SYS_STATUS, ATTITUDE, VFR_HUD, GLOBAL_POSITION_INT), ONCE_A_SECOND_US
    )
    announces_modes = True
    refuses_unknown_parameters = False
    modes = tuple(ARDUPLANE_MODES.values())
    initial_mode = LOITER
    ground_mode = MANUAL

    def __init__(self, config: AutopilotConfig) -> None:
        self.parameters = arduplane_parameters(config)
        self.arming = Arming(self._arming_fault, refused=Result.FAILED)
        self.setpoints: Mapping[str, Callable[[Flight, MAVLink_message], str | None]] = {}
        self.deadline_us: int | None = None
        self._failed_safe = False
        self._guided = Guided()
        self.commands: Handlers = {
            DO_SET_MODE: self._set_mode,
            NAV_LOITER_UNLIM: self._mode_command(LOITER.custom_mode),
            NAV_RETURN_TO_LAUNCH: self._mode_command(RTL.custom_mode),
            DO_REPOSITION: self._reposition,
            **self._guided.commands,
        }
        self._old_names = config.old_parameter_names

    def begin(self, flight: Flight) -> None:
        """Give the flight the distances of the parameters, at its start."""
        flight.navigation = replace(
            flight.navigation,
            take_off_height_m=self._value("TKOFF_ALT"),
            take_off_distance_m=self._value("TKOFF_DIST"),
            loiter_radius_m=self._value("WP_LOITER_RAD"),
            return_height_m=self._value("RTL_ALTITUDE"),
        )

    def changed(self, flight: Flight, name: str) -> None:
        """Let a parameter that was set take effect; SCHED_LOOP_RATE wants a reboot, as on the real one."""
        self.begin(flight)
        if name in {self._named("AIRSPEED_MIN"), self._named("AIRSPEED_MAX")}:
            slowest_m_s, fastest_m_s = self._value("AIRSPEED_MIN"), self._value("AIRSPEED_MAX")
            if LEAST_AIRSPEED_M_S <= slowest_m_s <= fastest_m_s:
                flight.set_airspeed_range(slowest_m_s, fastest_m_s)
        elif name == self._named("AIRSPEED_CRUISE"):
            flight.cruise_airspeed_m_s = max(1.0, self._value("AIRSPEED_CRUISE"))
        elif name == self._named("ROLL_LIMIT_DEG"):
            flight.set_max_bank_deg(self._value("ROLL_LIMIT_DEG"))
        elif name == "GUIDED_P" and self.parameters[name] > 0.0:
            flight.plant = replace(flight.plant, guided_p_cdeg_rad=self.parameters[name])
        elif name == "FS_GCS_ENABL" and not self.parameters[name]:
            self.deadline_us = None

    def request_mode(self, flight: Flight, custom_mode: int) -> Result:
        """Enter a mode. GUIDED again changes nothing; GUIDED anew starts without commands."""
        mode = ARDUPLANE_MODES.get(custom_mode)
        if mode is None:
            return Result.DENIED
        if mode is not flight.mode:
            self._guided.forget()
            flight.enter(mode)
        return Result.ACCEPTED

    def hear(self, flight: Flight, heartbeat: MAVLink_message) -> None:
        """A heartbeat of the ground station holds the fail-safe off, if there is one."""
        if heartbeat.get_srcSystem() == self._value("MAV_GCS_SYSID"):
            if self._failed_safe:
                flight.texts.append("GCS failsafe cleared")
                self._failed_safe = False
            self.deadline_us = None
            if self._value("FS_GCS_ENABL"):
                timeout_us = round(max(1.0, self._value("FS_LONG_TIMEOUT")) * 1e6)
                self.deadline_us = flight.time_us + timeout_us

    def system_status(self, flight: Flight) -> SystemStatus:
        """Active in the air only, armed or not; critical while the ground station is lost."""
        if self._failed_safe:
            return SystemStatus.CRITICAL
        return SystemStatus.STANDBY if flight.on_ground else SystemStatus.ACTIVE

    def watch(self, flight: Flight) -> None:
        """What was commanded last is held for ever, unless the fail-safe is on and the ground is silent."""
        if self.deadline_us is not None and flight.time_us >= self.deadline_us:
            self.deadline_us = None
            self._failed_safe = True
            flight.texts.append("GCS failsafe")
            if not flight.on_ground:
                self._act_on_loss(flight)

    def _act_on_loss(self, flight: Flight) -> None:
        """What FS_LONG_ACTN says; where that is nothing, all but what flies by itself returns home."""
        action = self._value("FS_LONG_ACTN")
        if flight.mode in {GUIDED, ARDUPLANE_MODES[AUTO]}:
            wanted = LONG_ACTIONS.get(action)
        elif flight.mode is RTL:
            wanted = None
        else:
            wanted = LONG_ACTIONS.get(action, RTL.custom_mode)
        if wanted is not None:
            self.request_mode(flight, wanted)

    def _named(self, name: str) -> str:
        """Today's name, or the old one where that is used."""
        return OLD_NAMES[name][0] if self._old_names and name in OLD_NAMES else name

    def _value(self, name: str) -> float:
        """A parameter in today's unit."""
        factor = OLD_NAMES[name][1] if self._old_names and name in OLD_NAMES else 1.0
        return self.parameters[self._named(name)] / factor

    def _arming_fault(self, _flight: Flight) -> str | None:
        slowest = self._value("AIRSPEED_MIN")
        if self.parameters["ARMING_SKIPCHK"] == -1:
            return None
        if slowest < LEAST_AIRSPEED_MIN:
            return f"AIRSPEED_MIN too low ({slowest:.0f} < {LEAST_AIRSPEED_MIN})"
        limit_deg = self._value("ROLL_LIMIT_DEG")
        if limit_deg < LEAST_ROLL_LIMIT_DEG:
            return f"ROLL_LIMIT_DEG too small ({limit_deg:.1f})"
        return None

    def _set_mode(self, flight: Flight, command: Command) -> Result:
        flags, custom_mode = command.used(1, 2)
        if not int(flags) & CUSTOM_MODE_FLAG or custom_mode != int(custom_mode):
            return Result.DENIED
        return self.request_mode(flight, int(custom_mode))

    def _mode_command(self, custom_mode: int) -> Callable[[Flight, Command], Result]:
        def enter(flight: Flight, _command: Command) -> Result:
            return self.request_mode(flight, custom_mode)

        return enter

    def _reposition(self, flight: Flight, command: Command) -> Result:
        """192: loiter around a place, in GUIDED; a course that was commanded is forgotten."""
        if not command.is_int:
            return Result.COMMAND_INT_ONLY
        (flags,) = command.used(2)
        where = place(command)
        height = height_target(flight, command.frame, *finite(command.z))
        if where is None or height is None:
            return Result.DENIED
        if flight.mode is not GUIDED:
            if not int(flags) & CHANGE_MODE:
                return Result.FAILED
            self.request_mode(flight, GUIDED.custom_mode)
        flight.orbit(flight.orbit_at(*where))
        flight.hold_height(height)
        return Result.ACCEPTED
