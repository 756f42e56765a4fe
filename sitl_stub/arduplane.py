"""ArduPlane's modes, parameters, fail-safe and GUIDED commands.

Parameters have the names and types of 4.7, as far as they matter from outside. GUIDED holds course, airspeed
and altitude until the next command.
"""

import math
from collections.abc import Mapping
from typing import ClassVar

from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import (
    Arming,
    Command,
    Handler,
    Result,
    SystemStatus,
    finite,
    height_target,
    is_flyable_airspeed,
    place,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import AutopilotMode, EmulatedFlight, by_number
from sitl_stub.loops import GRAVITY_M_S2, SpeedTarget, TurnTarget
from sitl_stub.parameters import Parameter, Parameters, int8, int16, int32, real, whole_if_possible
from sitl_stub.personality import Personality, personality

GUIDED = AutopilotMode("GUIDED", 15, "commanded")
LOITER = AutopilotMode("LOITER", 12, "loiter")
MANUAL = AutopilotMode("MANUAL", 0)
RTL = AutopilotMode("RTL", 11, "home")
TAKEOFF = AutopilotMode("TAKEOFF", 13, "take-off")

ARDUPLANE_MODES = by_number(
    [
        MANUAL,
        AutopilotMode("CIRCLE", 1, "circle"),
        AutopilotMode("STABILIZE", 2),
        AutopilotMode("TRAINING", 3),
        AutopilotMode("ACRO", 4),
        AutopilotMode("FBWA", 5),
        AutopilotMode("FBWB", 6),
        AutopilotMode("CRUISE", 7),
        AutopilotMode("AUTOTUNE", 8),
        AutopilotMode("AUTO", 10),
        RTL,
        LOITER,
        TAKEOFF,
        GUIDED,
    ]
)
"""ArduPlane's modes for a fixed wing, by number."""

OLD_NAMES: Mapping[str, tuple[str, float]] = {
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", 1.0),
    "AIRSPEED_MAX": ("ARSPD_FBW_MAX", 1.0),
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", 100.0),
    "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", 100.0),
    "PTCH_LIM_MAX_DEG": ("LIM_PITCH_MAX", 100.0),
    "PTCH_LIM_MIN_DEG": ("LIM_PITCH_MIN", 100.0),
    "RTL_ALTITUDE": ("ALT_HOLD_RTL", 100.0),
    "MAV_GCS_SYSID": ("SYSID_MYGCS", 1.0),
    "MAV_SYSID": ("SYSID_THISMAV", 1.0),
}
"""Old name of a parameter and the number of old units in a present one.

The last two were renamed in 4.7, the others in 4.5.
"""

SETTLED_LOOP_RATE_HZ = 200
"""Reported SCHED_LOOP_RATE of an emulator without a loop rate, whose telemetry is always on time."""

MIN_LATERAL_ACCELERATION_M_S2 = 0.05
"""Stands in for a lateral acceleration limit of zero: the aircraft hardly turns."""

COURSE, HEADING, CANCEL = 0.0, 1.0, 2.0
"""Values of GUIDED_CHANGE_HEADING's param1."""

AIRSPEED, GROUND_SPEED = 0.0, 1.0
"""Values of SPEED_TYPE."""

NO_CHANGE, DEFAULT_SPEED = -1.0, -2.0
"""DO_CHANGE_SPEED's special values of a speed."""

LEAST_AIRSPEED_MIN, LEAST_ROLL_LIMIT_DEG = 5, 3
"""Smallest AIRSPEED_MIN (m/s) and ROLL_LIMIT_DEG with which ArduPlane arms."""

CHANGE_MODE = 1
"""MAV_DO_REPOSITION_FLAGS: enter GUIDED first."""

AUTO, FBWA = 10, 5

LONG_ACTIONS: Mapping[float, int] = {1.0: RTL.custom_mode, 2.0: FBWA, 4.0: AUTO}
"""Mode by FS_LONG_ACTN: home, gliding, the mission; 0 continues in GUIDED and AUTO."""


def arduplane_parameters(config: AutopilotConfig) -> Parameters:
    """Return the parameters at the start."""
    parameters = described(config)
    if config.old_parameter_names:
        parameters = [renamed(one) for one in parameters]
    return Parameters(parameters, "cast")


def renamed(parameter: Parameter) -> Parameter:
    """Return the parameter with its old name and unit, if it had others."""
    name, factor = OLD_NAMES.get(parameter.name, (parameter.name, 1.0))
    if name == parameter.name:
        return parameter
    return whole_if_possible(name, factor * parameter.default)


def described(config: AutopilotConfig) -> list[Parameter]:
    """Return all parameters by their present names."""
    plant = config.plant
    return [
        whole_if_possible("AIRSPEED_MIN", plant.airspeed_min_m_s),
        whole_if_possible("AIRSPEED_MAX", plant.airspeed_max_m_s),
        real("AIRSPEED_CRUISE", config.airspeed_m_s),
        real("AIRSPEED_STALL", 0.0),
        real("GUIDED_P", guided_p(config)),
        real("GUIDED_I", 0.0),
        real("GUIDED_D", 0.0),
        real("ROLL_LIMIT_DEG", math.degrees(plant.max_bank_rad)),
        real("PTCH_LIM_MAX_DEG", 20.0),
        real("PTCH_LIM_MIN_DEG", -25.0),
        real("RLL2SRV_TCONST", plant.roll_time_s),
        real("NAVL1_PERIOD", 17.0),
        real("NAVL1_DAMPING", 0.75),
        real("TECS_CLMB_MAX", plant.climb_rate_max_m_s),
        real("TECS_SINK_MAX", plant.sink_rate_max_m_s),
        real("TECS_TIME_CONST", 5.0),
        real("TECS_SPDWEIGHT", 1.0),
        int16("SCHED_LOOP_RATE", round(config.loop_rate_hz or SETTLED_LOOP_RATE_HZ)),
        int8("FS_GCS_ENABL", 0),
        int8("FS_SHORT_ACTN", 0),
        real("FS_SHORT_TIMEOUT", 1.5),
        int8("FS_LONG_ACTN", 0),
        real("FS_LONG_TIMEOUT", 5.0),
        int8("THR_FAILSAFE", 1),
        int16("MAV_GCS_SYSID", 255),
        int16("MAV_SYSID", config.system_id),
        int8("ARMING_REQUIRE", 1),
        int32("ARMING_SKIPCHK", 0),
        int8("ARSPD_TYPE", 1),
        int8("ARSPD_USE", 1),
        real("ARSPD_RATIO", 2.0),
        real("TKOFF_ALT", 50.0),
        real("TKOFF_DIST", 200.0),
        int16("WP_LOITER_RAD", 80),
        int16("WP_RADIUS", 90),
        real("RTL_ALTITUDE", 100.0),
        int16("RTL_RADIUS", 0),
        int8("FENCE_ENABLE", 0),
        int8("FENCE_TOTAL", 0),
        int16("MIS_TOTAL", 0),
        int8("RALLY_TOTAL", 0),
        int8("INITIAL_MODE", 0),
        *(int8(f"FLTMODE{number}", mode) for number, mode in enumerate((11, 11, 5, 5, 0, 0), 1)),
        int8("AHRS_EKF_TYPE", 3),
        int8("EK3_ENABLE", 1),
        int8("BATT_MONITOR", 0),
        int8("COMPASS_USE", 1),
        int8("GPS1_TYPE", 1),
        int16("FORMAT_VERSION", 13),
        int16("STAT_BOOTCNT", 1),
        int8("TRIM_THROTTLE", 45),
        int8("THR_MAX", 100),
    ]


def guided_p(config: AutopilotConfig) -> float:
    """Return GUIDED_P of the bank plant, or for others the bank per course error that yields their alpha."""
    plant = config.plant
    if plant.banks:
        return plant.guided_p_cdeg_rad
    middle_speed_m_s = 0.5 * (plant.airspeed_min_m_s + plant.airspeed_max_m_s)
    return round(100.0 * math.degrees(plant.alpha_1_s * middle_speed_m_s / GRAVITY_M_S2))


def _only_guided(handler: Handler) -> Handler:
    """Wrap a handler so that it fails outside GUIDED."""

    def guarded(flight: EmulatedFlight, command: Command) -> Result:
        return handler(flight, command) if flight.mode is GUIDED else Result.FAILED

    return guarded


def change_heading(flight: EmulatedFlight, command: Command) -> Result:
    """Handle 43002: param1 course, heading or cancel; param2 in [0, 360) deg; param3 lateral m/s^2."""
    (kind,) = command.used(1)
    if kind == CANCEL:
        flight.circle()
        return Result.ACCEPTED
    angle_deg, acceleration_m_s2 = command.used(2, 3)
    if kind not in {COURSE, HEADING} or not 0.0 <= angle_deg < 360.0:
        return Result.DENIED
    limit = max(acceleration_m_s2, MIN_LATERAL_ACCELERATION_M_S2)
    hold = TurnTarget("course" if kind == COURSE else "heading", math.radians(angle_deg), limit)
    flight.hold_turn(hold)
    return Result.ACCEPTED


def change_altitude(flight: EmulatedFlight, command: Command) -> Result:
    """Handle 43001: `z` in a global frame, param3 climb rate (0: the plant's own)."""
    (climb_rate_m_s,) = command.used(3)
    (z,) = finite(command.z)
    target = height_target(flight, command.frame, z, climb_rate_m_s or math.inf)
    if target is None or climb_rate_m_s < 0.0:
        return Result.DENIED
    flight.hold_height(target)
    return Result.ACCEPTED


def change_any_altitude(flight: EmulatedFlight, command: Command) -> Result:
    """Handle 186: param1 metres, param2 frame; accepted in any mode, with effect in LOITER and GUIDED."""
    altitude_m, frame = command.used(1, 2)
    target = height_target(flight, int(frame), altitude_m)
    if target is None:
        return Result.DENIED
    if flight.mode in {LOITER, GUIDED}:
        flight.hold_height(target)
    return Result.ACCEPTED


@personality("ardupilot")
class EmulatedArduPlane(Personality):
    """ArduPlane 4.7, as measured on the real autopilot."""

    firmware = 3  # MAV_AUTOPILOT_ARDUPILOTMEGA
    version = 0x0407_0000
    unsent = frozenset({mavlink.MAVLINK_MSG_ID_ALTITUDE, mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS})
    announces_modes = True
    answers_data_streams = True
    modes = tuple(ARDUPLANE_MODES.values())
    initial_mode = LOITER
    ground_mode = MANUAL
    mission_mode = ARDUPLANE_MODES[AUTO]
    deadline_us: int | None = None
    distances: ClassVar[Mapping[str, str]] = {
        "take_off_height_m": "TKOFF_ALT",
        "take_off_distance_m": "TKOFF_DIST",
        "loiter_radius_m": "WP_LOITER_RAD",
        "return_height_m": "RTL_ALTITUDE",
    }
    limits = ("AIRSPEED_MIN", "AIRSPEED_MAX", "AIRSPEED_CRUISE", "ROLL_LIMIT_DEG")

    def __init__(self, config: AutopilotConfig) -> None:
        super().__init__(config)
        self.parameters = arduplane_parameters(config)
        self.arming = Arming(self._arming_fault, refused=Result.FAILED)
        self._failed_safe = False
        self._guided_speed_used = False
        self.commands = {
            **self.commands,
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self.mode_command(LOITER.custom_mode),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self.mode_command(RTL.custom_mode),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: change_any_altitude,
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: _only_guided(change_heading),
            mavlink.MAV_CMD_GUIDED_CHANGE_SPEED: _only_guided(self._guided_change_speed),
            mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE: _only_guided(change_altitude),
        }
        self._old_names = config.old_parameter_names

    def changed(self, flight: EmulatedFlight, name: str) -> None:
        """Let a changed parameter take effect; SCHED_LOOP_RATE needs a reboot, as on the real autopilot."""
        today = (one for one, (old, _) in OLD_NAMES.items() if self._old_names and old == name)
        super().changed(flight, next(today, name))
        if name == "GUIDED_P" and self.parameters[name] > 0.0:
            flight.plant = replace(flight.plant, guided_p_cdeg_rad=self.parameters[name])
        elif name == "FS_GCS_ENABL" and not self.parameters[name]:
            self.deadline_us = None

    def request_mode(self, flight: EmulatedFlight, custom_mode: int) -> Result:
        """Enter a mode; GUIDED forgets its commands on entry, but not when it is requested again."""
        before, result = flight.mode, super().request_mode(flight, custom_mode)
        self._guided_speed_used &= flight.mode is before
        return result

    def hear(self, flight: EmulatedFlight, heartbeat: MAVLink_message) -> None:
        """Restart the fail-safe's timeout, if it is enabled, at a heartbeat of the ground station."""
        if heartbeat.get_srcSystem() == self.value("MAV_GCS_SYSID"):
            if self._failed_safe:
                flight.texts.append("GCS failsafe cleared")
                self._failed_safe = False
            self.deadline_us = None
            if self.value("FS_GCS_ENABL"):
                timeout_us = round(max(1.0, self.value("FS_LONG_TIMEOUT")) * 1e6)
                self.deadline_us = flight.time_us + timeout_us

    def system_status(self, flight: EmulatedFlight) -> SystemStatus:
        """Return CRITICAL during the fail-safe, STANDBY on the ground, ACTIVE in the air, armed or not."""
        if self._failed_safe:
            return SystemStatus.CRITICAL
        return SystemStatus.STANDBY if flight.on_ground else SystemStatus.ACTIVE

    def watch(self, flight: EmulatedFlight) -> None:
        """Trigger the fail-safe at the timeout; until then, the last command is held."""
        if self.deadline_us is not None and flight.time_us >= self.deadline_us:
            self.deadline_us = None
            self._failed_safe = True
            flight.texts.append("GCS failsafe")
            if not flight.on_ground:
                self._act_on_loss(flight)

    def _act_on_loss(self, flight: EmulatedFlight) -> None:
        """Enter the mode that FS_LONG_ACTN selects; without one, return home from all but GUIDED and AUTO."""
        action = self.value("FS_LONG_ACTN")
        if flight.mode in {GUIDED, ARDUPLANE_MODES[AUTO]}:
            wanted = LONG_ACTIONS.get(action)
        elif flight.mode is RTL:
            wanted = None
        else:
            wanted = LONG_ACTIONS.get(action, RTL.custom_mode)
        if wanted is not None:
            self.request_mode(flight, wanted)

    def value(self, name: str) -> float:
        """Return a parameter by its present name, in its present unit."""
        old, factor = OLD_NAMES.get(name, (name, 1.0)) if self._old_names else (name, 1.0)
        return self.parameters[old] / factor

    def _arming_fault(self, _flight: EmulatedFlight) -> str | None:
        slowest = self.value("AIRSPEED_MIN")
        if self.parameters["ARMING_SKIPCHK"] == -1:
            return None
        if slowest < LEAST_AIRSPEED_MIN:
            return f"AIRSPEED_MIN too low ({slowest:.0f} < {LEAST_AIRSPEED_MIN})"
        limit_deg = self.value("ROLL_LIMIT_DEG")
        if limit_deg < LEAST_ROLL_LIMIT_DEG:
            return f"ROLL_LIMIT_DEG too small ({limit_deg:.1f})"
        return None

    def _reposition(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 192: loiter around a place in GUIDED, forgetting any commanded course."""
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

    def _guided_change_speed(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 43000: param1 type, param2 m/s, param3 acceleration (0: the plant's own)."""
        kind, speed_m_s, acceleration_m_s2 = command.used(1, 2, 3)
        if acceleration_m_s2 < 0.0:
            return Result.DENIED
        limit = acceleration_m_s2 or math.inf
        if kind == AIRSPEED:
            if not is_flyable_airspeed(flight, speed_m_s):
                return Result.FAILED
            target = SpeedTarget("airspeed", speed_m_s, limit)
        elif kind == GROUND_SPEED and flight.plant.kind == "course-hold":
            # ArduPlane denies this; only the article's ideal ground speed hold takes it.
            if speed_m_s <= 0.0:
                return Result.FAILED
            target = SpeedTarget("ground-speed", speed_m_s, limit)
        else:
            return Result.DENIED
        self._guided_speed_used = True
        flight.hold_speed(target)
        return Result.ACCEPTED

    def _change_speed(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 178: accept it, without effect once 43000 was used in this visit to GUIDED.

        A ground speed would only set a floor, which is not modelled: accepted without effect.
        """
        kind, speed_m_s = command.used(1, 2)
        if self._guided_speed_used:
            flight.texts.append("DO_CHANGE_SPEED ignored: guided speed in use")
            return Result.ACCEPTED
        if kind not in {AIRSPEED, GROUND_SPEED}:
            return Result.DENIED
        if kind == GROUND_SPEED or speed_m_s == NO_CHANGE:
            return Result.ACCEPTED
        if speed_m_s == DEFAULT_SPEED:
            flight.cruise()
            return Result.ACCEPTED
        if not is_flyable_airspeed(flight, speed_m_s):
            return Result.FAILED
        flight.hold_speed(SpeedTarget("airspeed", speed_m_s))
        return Result.ACCEPTED
