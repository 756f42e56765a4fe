"""PX4 for a fixed wing: its modes, commands, setpoints and fail-safes.

The behaviour is that of 1.18.0-beta1, as measured in software. Versions from 1.14 on differ in Guided Course
(1.18), in a velocity without a position in offboard, and in their number.
"""

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar, Literal

import msgspec
import pymap3d
from msgspec.structs import replace
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.commands import (
    AMSL_FRAMES,
    CUSTOM_MODE_FLAG,
    Arming,
    Command,
    NonFiniteError,
    Result,
    SystemStatus,
    finite,
    height_target,
    place,
)
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import AutopilotMode, EmulatedFlight, by_number
from sitl_stub.loops import AltitudeTarget, PlantParameters, SpeedTarget, TurnTarget
from sitl_stub.parameters import px4_parameters
from sitl_stub.personality import ONCE_A_SECOND_US, Personality, personality

# Effect of offboard setpoint messages on a fixed wing, by version of PX4.
#
# | fields in use | up to 1.14 | 1.15, 1.16 | 1.17, 1.18 |
# |---|---|---|---|
# | velocity alone | its course | present attitude | present course and height |
# | position, or position and acceleration | flies to it, at its height | the same | the same |
# | position and velocity | the velocity's course, at the autopilot's own airspeed | the same | the same |
#
# 1.18.0-beta1 was flown in software, the others are read in the source. Every setpoint resets the airspeed to
# the autopilot's own. The course to a position is updated with each message, not between them.

LOCAL_FRAMES = frozenset({1})
"""MAV_FRAME_LOCAL_NED."""

GLOBAL_FRAMES = frozenset({5, 6})
"""MAV_FRAME_GLOBAL_INT and GLOBAL_RELATIVE_ALT_INT; their equivalents 0 and 3 are refused."""

IGNORE_X, IGNORE_Y, IGNORE_Z = 1, 2, 4
IGNORE_VX, IGNORE_VY = 8, 16
IGNORE_ACCELERATION = 64 | 128 | 256
"""POSITION_TARGET_TYPEMASK: a set bit means that the field is ignored."""

STEERS_BY_VELOCITY = (1, 14)
"""Last version that steers by a velocity alone."""

KEEPS_COURSE = (1, 17)
"""First version that keeps course and height, instead of the attitude, without a setpoint to steer by."""

Steers = Literal["velocity", "position", "path"]


class Px4Setpoint(msgspec.Struct, frozen=True):
    """Decoded setpoint message."""

    steers: Steers
    """Fields that decide the course; `path` uses position and velocity."""

    turn: TurnTarget | None
    """Course, or None to keep the present one."""

    height: AltitudeTarget | None
    """None to keep the present height."""


def setpoint_of(flight: EmulatedFlight, message: MAVLink_message) -> Px4Setpoint | str:
    """Decode a setpoint message, or return why it is refused."""
    mask = message.type_mask
    steers = steered_by(mask)
    local = message.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    frames = LOCAL_FRAMES if local else GLOBAL_FRAMES
    if steers is None or message.coordinate_frame not in frames:
        return "unsupported setpoint"
    try:
        height = None if mask & IGNORE_Z else height_of(flight, message)
        if steers == "position":
            turn: TurnTarget | None = TurnTarget("course", bearing_rad(flight, message))
        else:
            turn = course_of(*finite(message.vx, message.vy))
    except NonFiniteError:
        return "non-finite field"
    return Px4Setpoint(steers, turn, height)


def steered_by(type_mask: int) -> Steers | None:
    """Return which fields decide the course under a type mask; None for an unsupported mask."""
    if type_mask & IGNORE_ACCELERATION != IGNORE_ACCELERATION:
        return None
    position = not type_mask & (IGNORE_X | IGNORE_Y)
    velocity = not type_mask & (IGNORE_VX | IGNORE_VY)
    if position:
        return "path" if velocity else "position"
    return "velocity" if velocity and type_mask & IGNORE_X and type_mask & IGNORE_Y else None


def height_of(flight: EmulatedFlight, message: MAVLink_message) -> AltitudeTarget | None:
    """Return the height in a setpoint: z is down from home, alt is up in the meaning of its frame.

    Raises:
        NonFiniteError: it is not finite.
    """
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        return AltitudeTarget(flight.home.altitude_amsl_m - finite(message.z)[0])
    return height_target(flight, message.coordinate_frame, finite(message.alt)[0])


def bearing_rad(flight: EmulatedFlight, message: MAVLink_message) -> float:
    """Return the course from the aircraft to the position in a setpoint.

    Raises:
        NonFiniteError: the position is not finite.
    """
    state, home = flight.state, flight.home
    if message.get_type() == "SET_POSITION_TARGET_LOCAL_NED":
        east_m, north_m, _ = pymap3d.geodetic2enu(
            state.latitude_rad,
            state.longitude_rad,
            home.altitude_amsl_m,
            home.latitude_rad,
            home.longitude_rad,
            home.altitude_amsl_m,
            deg=False,
        )
        x, y = finite(message.x, message.y)
        return math.atan2(y - east_m, x - north_m)
    east_m, north_m, _ = pymap3d.geodetic2enu(
        math.radians(message.lat_int * 1e-7),
        math.radians(message.lon_int * 1e-7),
        0.0,
        state.latitude_rad,
        state.longitude_rad,
        0.0,
        deg=False,
    )
    return math.atan2(east_m, north_m)


def course_of(north_m_s: float, east_m_s: float) -> TurnTarget | None:
    """Return the course of a velocity, whatever its magnitude; None for the zero vector."""
    if north_m_s == 0.0 and east_m_s == 0.0:
        return None
    return TurnTarget("course", math.atan2(east_m_s, north_m_s))


VERSIONS = ((1, 14), (1, 15), (1, 16), (1, 17), (1, 18))
"""Versions that are distinguished, oldest first."""


def px4_custom_mode(main: int, sub: int = 0) -> int:
    """Return PX4's custom_mode: main mode in the third byte, sub mode in the fourth."""
    return main << 16 | sub << 24


OFFBOARD = AutopilotMode("OFFBOARD", px4_custom_mode(6), "straight")
GUIDED_COURSE = AutopilotMode("AUTO.COURSE", px4_custom_mode(4, 19), "straight")
AUTO_LOITER = AutopilotMode("AUTO.LOITER", px4_custom_mode(4, 3), "loiter")
AUTO_TAKEOFF = AutopilotMode("AUTO.TAKEOFF", px4_custom_mode(4, 2), "take-off")
AUTO_MISSION = AutopilotMode("AUTO.MISSION", px4_custom_mode(4, 4))
AUTO_RTL = AutopilotMode("AUTO.RTL", px4_custom_mode(4, 5), "home")

PX4_MODES = by_number(
    [
        AutopilotMode("MANUAL", px4_custom_mode(1)),
        AutopilotMode("ALTCTL", px4_custom_mode(2)),
        AutopilotMode("POSCTL", px4_custom_mode(3)),
        AUTO_TAKEOFF,
        AUTO_LOITER,
        AUTO_MISSION,
        AUTO_RTL,
        AutopilotMode("AUTO.LAND", px4_custom_mode(4, 6)),
        AutopilotMode("ACRO", px4_custom_mode(5)),
        OFFBOARD,
        AutopilotMode("STABILIZED", px4_custom_mode(7)),
        GUIDED_COURSE,
    ]
)
"""PX4's modes for a fixed wing, by number; Guided Course came with 1.18."""

STREAM_FRESH_US = 500_000
"""Greatest age of the last setpoint when OFFBOARD is entered: the stream must run at 2 Hz or faster."""

NOTICED_US = 700_000
"""Time after COM_OF_LOSS_T until the mode changes; 1.7 s in all were measured after the last setpoint."""

STREAM_ACTION_LOITER = 5
"""COM_OBL_RC_ACT of holding; without a remote control, all other values return home here."""

LINK_NOTICED_US = 3_000_000
"""Time after COM_DL_LOSS_T until the mode changes; 13 s were measured after the last heartbeat."""

LINK_ACTIONS = {1: AUTO_LOITER, 2: AUTO_RTL}
"""Values of NAV_DLL_ACT that change the mode; all others do nothing here."""

HOLD_BIT = 2
"""COM_DLL_EXCEPT of holding, Guided Course and other navigation without a mission."""

GROUND_STATION = 6
"""MAV_TYPE_GCS; heartbeats of companions (18) do not count."""

COURSE_OVER_GROUND = 0.0
"""Value of HEADING_TYPE."""

AIRSPEED, GROUND_SPEED = 0.0, 1.0
"""Values of SPEED_TYPE."""

ONBOARD_LINK_US = {
    **dict.fromkeys(
        (
            mavlink.MAVLINK_MSG_ID_HEARTBEAT,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS,
            mavlink.MAVLINK_MSG_ID_ALTITUDE,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
            mavlink.MAVLINK_MSG_ID_GPS_RAW_INT,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME,
        ),
        ONCE_A_SECOND_US,
    ),
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 10_000,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 20_000,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 33_333,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: 100_000,
}
"""Messages sent without a request on the link for companions; the fast ones have their nominal rates."""

BETA, RELEASE = 0x80, 0xFF
"""Values of FIRMWARE_VERSION_TYPE."""

GUIDED_COURSE_SINCE = (1, 18)

COURSE_LOOP = frozenset({"NPFG_PERIOD", "NPFG_DAMPING"})
"""Parameters of alpha, which is 4 pi NPFG_DAMPING / NPFG_PERIOD."""

THROTTLES = ("FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX")
"""Throttles of level flight at the least, trim and greatest airspeed."""


@personality("px4")
class EmulatedPx4(Personality):
    """PX4 for a fixed wing."""

    versions = VERSIONS
    max_bank_deg = 50.0
    loops = PlantParameters(
        kind="npfg",
        alpha_1_s=4.0 * math.pi * 0.7 / 10.0,
        speed_response="px4-untrimmed",
        course_dead_time_s=0.06,
        roll_delay_s=0.2,
    )
    """PX4's defaults, fitted to 1.18.0-beta1: with the roll's 0.4 s, courses in steps of 10 to 60
    degrees are met to 4 % of a step."""

    firmware = 12  # MAV_AUTOPILOT_PX4
    capabilities = 59_647
    unsent = frozenset({mavlink.MAVLINK_MSG_ID_WIND, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT})
    unrequested = ONBOARD_LINK_US
    modes: Sequence[AutopilotMode] = tuple(PX4_MODES.values())
    initial_mode = AUTO_LOITER
    ground_mode = AUTO_LOITER
    mission_mode = AUTO_MISSION
    distances: ClassVar[Mapping[str, str]] = {
        "take_off_height_m": "MIS_TAKEOFF_ALT",
        "loiter_radius_m": "NAV_LOITER_RAD",
        "return_height_m": "RTL_RETURN_ALT",
    }
    limits = ("FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_AIRSPD_TRIM", "FW_R_LIM")

    def __init__(self, config: AutopilotConfig) -> None:
        super().__init__(config)
        number = config.autopilot_version or VERSIONS[-1]
        major, minor = self._number = number
        kind = BETA if number == VERSIONS[-1] else RELEASE
        self.version = major << 24 | minor << 16 | kind
        has_course = number >= GUIDED_COURSE_SINCE
        self.refuses_unknown_parameters = has_course
        self._modes = {
            mode.custom_mode: mode
            for mode in PX4_MODES.values()
            if has_course or mode is not GUIDED_COURSE
        }
        self.modes = tuple(self._modes.values())
        self.parameters = px4_parameters(config)
        self.arming = Arming(self._arming_fault, refused=Result.TEMPORARILY_REJECTED)
        self.commands = {
            mavlink.MAV_CMD_DO_SET_MODE: self._set_mode,
            mavlink.MAV_CMD_DO_CHANGE_SPEED: self._change_speed,
            mavlink.MAV_CMD_DO_CHANGE_ALTITUDE: change_altitude,
            **({mavlink.MAV_CMD_GUIDED_CHANGE_HEADING: change_course} if has_course else {}),
            # The aircraft rolls as soon as it is armed; the height is MIS_TAKEOFF_ALT.
            mavlink.MAV_CMD_NAV_TAKEOFF: self.mode_command(AUTO_TAKEOFF.custom_mode),
            mavlink.MAV_CMD_NAV_LOITER_UNLIM: self.mode_command(AUTO_LOITER.custom_mode),
            mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH: self.mode_command(AUTO_RTL.custom_mode),
            mavlink.MAV_CMD_DO_REPOSITION: self._reposition,
        }
        self.setpoints = {
            "SET_POSITION_TARGET_LOCAL_NED": self._take,
            "SET_POSITION_TARGET_GLOBAL_INT": self._take,
        }
        self._failed_safe = False
        self._latest: Px4Setpoint | None = None
        self._latest_us: int | None = None
        self._stream_lost_us: int | None = None
        self._ground_station_us: int | None = None
        self._link_failed = False

    @property
    def deadline_us(self) -> int | None:
        """Simulation time at which a fail-safe may be due."""
        due = [one for one in (self._stream_lost_us, self._link_lost_us()) if one is not None]
        return min(due, default=None)

    def changed(self, flight: EmulatedFlight, name: str) -> None:
        """Let a changed parameter take effect."""
        super().changed(flight, name)
        flight.plant = with_loops(flight.plant, name, self.parameters)
        # A fail-safe that is switched on now may be due already.
        self.watch(flight)

    def request_mode(self, flight: EmulatedFlight, custom_mode: int) -> Result:
        """Enter a mode; OFFBOARD only while setpoints are already arriving."""
        mode = self._modes.get(custom_mode)
        fresh = self._latest_us is not None and flight.time_us - self._latest_us <= STREAM_FRESH_US
        enters = mode is not flight.mode
        if mode is None or (mode is OFFBOARD and enters and not fresh):
            return Result.TEMPORARILY_REJECTED
        self._failed_safe = False
        if not enters:
            return Result.ACCEPTED
        if mode is OFFBOARD:
            bank_rad = flight.motion().bank_rad
            flight.enter(mode)
            if self._number < KEEPS_COURSE:
                flight.hold_turn(TurnTarget("bank", bank_rad))
            self._fly(flight)
        else:
            self._stream_lost_us = None
            flight.enter(mode)
        return Result.ACCEPTED

    def hear(self, flight: EmulatedFlight, heartbeat: MAVLink_message) -> None:
        """Note the time of a ground station's heartbeat for NAV_DLL_ACT."""
        if heartbeat.type == GROUND_STATION:
            self._ground_station_us = flight.time_us
            self._link_failed = False

    def system_status(self, flight: EmulatedFlight) -> SystemStatus:
        """Return CRITICAL from a fail-safe until a mode is selected, else ACTIVE if armed."""
        if self._failed_safe:
            return SystemStatus.CRITICAL
        return SystemStatus.ACTIVE if flight.armed else SystemStatus.STANDBY

    def watch(self, flight: EmulatedFlight) -> None:
        """Apply the fail-safes for lost setpoints and a lost ground station, and end a complete take-off."""
        now_us = flight.time_us
        if self._stream_lost_us is not None and now_us >= self._stream_lost_us:
            self._stream_lost_us = None
            self._failed_safe = True
            loiters = self.parameters["COM_OBL_RC_ACT"] == STREAM_ACTION_LOITER
            flight.enter(AUTO_LOITER if loiters else AUTO_RTL)
        lost_us = self._link_lost_us()
        if lost_us is not None and now_us >= lost_us:
            self._link_failed = True
            if not self._bears_silence(flight.mode):
                self._failed_safe = True
                flight.texts.append("Failsafe activated")
                flight.enter(LINK_ACTIONS[round(self.parameters["NAV_DLL_ACT"])])
        if flight.mode is AUTO_TAKEOFF and flight.phase == "flying":
            orbit = flight.present_orbit
            flight.enter(AUTO_LOITER)
            if orbit is not None:
                flight.orbit(orbit)

    def _link_lost_us(self) -> int | None:
        """Return the time at which NAV_DLL_ACT is due, once for each silence; None for never."""
        if self._link_failed or round(self.parameters["NAV_DLL_ACT"]) not in LINK_ACTIONS:
            return None
        if self._ground_station_us is None:
            return 0
        silence_us = round(self.parameters["COM_DL_LOSS_T"] * 1e6) + LINK_NOTICED_US
        return self._ground_station_us + silence_us

    def _bears_silence(self, mode: AutopilotMode) -> bool:
        """Check whether the loss of the ground station changes nothing in a mode."""
        excepted = int(self.parameters["COM_DLL_EXCEPT"]) & HOLD_BIT
        return mode is AUTO_RTL or (mode in {AUTO_LOITER, GUIDED_COURSE} and bool(excepted))

    def _arming_fault(self, _flight: EmulatedFlight) -> str | None:
        slowest, fastest = self.parameters["FW_AIRSPD_MIN"], self.parameters["FW_AIRSPD_MAX"]
        if not 0.0 < slowest < fastest:
            return "Invalid airspeed limits"
        return None

    def _set_mode(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 176: param2 main mode, param3 sub mode."""
        flags, main, sub = command.used(1, 2, 3)
        in_bytes = all(0.0 <= part <= 255.0 and part == int(part) for part in (main, sub))
        if not int(flags) & CUSTOM_MODE_FLAG or not in_bytes:
            return Result.TEMPORARILY_REJECTED
        return self.request_mode(flight, px4_custom_mode(int(main), int(sub)))

    def _change_speed(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 178: param1 type, param2 m/s. Accept everything and fly the nearest speed.

        Only the article's ideal plant flies a ground speed; all others take it as an airspeed. A
        speed not above 0 means cruise; a `path` setpoint in OFFBOARD keeps its speed.
        """
        kind, speed_m_s = command.parameters[:2]
        if flight.mode is OFFBOARD and self._latest is not None and self._latest.steers == "path":
            return Result.ACCEPTED
        if not (math.isfinite(speed_m_s) and speed_m_s > 0.0):
            flight.cruise()
        elif kind == GROUND_SPEED and flight.plant.kind == "course-hold":
            flight.hold_speed(SpeedTarget("ground-speed", speed_m_s))
        else:
            hold_airspeed(flight, speed_m_s)
        return Result.ACCEPTED

    def _reposition(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 192: loiter around a place; param1 is the airspeed, unchanged where it is not above 0."""
        where = place(command)
        height = height_target(flight, command.frame, *finite(command.z))
        if where is None or height is None:
            return Result.DENIED
        self.request_mode(flight, AUTO_LOITER.custom_mode)
        flight.orbit(flight.orbit_at(*where))
        flight.hold_height(height)
        airspeed_m_s = command.parameters[0]
        if math.isfinite(airspeed_m_s) and airspeed_m_s > 0.0:
            hold_airspeed(flight, airspeed_m_s)
        return Result.ACCEPTED

    def _take(self, flight: EmulatedFlight, message: MAVLink_message) -> str | None:
        """Store a setpoint, and fly it in OFFBOARD; return why it is refused, or None."""
        setpoint = setpoint_of(flight, message)
        if isinstance(setpoint, str):
            return setpoint
        self._latest, self._latest_us = setpoint, flight.time_us
        if flight.mode is OFFBOARD:
            self._fly(flight)
        return None

    def _fly(self, flight: EmulatedFlight) -> None:
        """Fly the latest setpoint, as far as this version supports it, at the autopilot's airspeed."""
        setpoint = self._latest
        if setpoint is None or self._latest_us is None:
            return
        steers = setpoint.steers != "velocity" or self._number <= STEERS_BY_VELOCITY
        if steers and setpoint.turn is not None:
            flight.hold_turn(setpoint.turn)
        if steers and setpoint.height is not None:
            flight.hold_height(setpoint.height)
        flight.cruise()
        after_us = max(0, round(self.parameters["COM_OF_LOSS_T"] * 1e6))
        self._stream_lost_us = self._latest_us + after_us + NOTICED_US


def with_loops(
    plant: PlantParameters, name: str, parameters: Mapping[str, float]
) -> PlantParameters:
    """Return the plant after a parameter change; values outside the real autopilot's range are ignored.

    The course loop of first-order plants is NPFG's here. Throttle parameters affect only PX4's speed holds:
    `px4` where the throttle of each airspeed is known, else `px4-untrimmed`.
    """
    period_s, damping = parameters["NPFG_PERIOD"], parameters["NPFG_DAMPING"]
    if name in COURSE_LOOP and 1.0 <= period_s <= 100.0 and 0.1 <= damping <= 1.0:
        return replace(plant, alpha_1_s=4.0 * math.pi * damping / period_s)
    if name == "FW_R_TC" and 0.2 <= parameters[name] <= 1.0:
        return replace(plant, roll_time_s=parameters[name])
    if name in THROTTLES and plant.slews:
        slowest, middle, fastest = (parameters[one] for one in THROTTLES)
        trimmed = 0.0 < slowest < middle < fastest
        return replace(plant, speed_response="px4" if trimmed else "px4-untrimmed")
    return plant


def hold_airspeed(flight: EmulatedFlight, airspeed_m_s: float) -> None:
    """Fly an airspeed, clamped to the aircraft's range."""
    slowest_m_s, fastest_m_s = flight.airspeed_range_m_s
    flown_m_s = max(slowest_m_s, min(fastest_m_s, airspeed_m_s))
    flight.hold_speed(SpeedTarget("airspeed", flown_m_s))


def change_course(flight: EmulatedFlight, command: Command) -> Result:
    """Handle 43002 in Guided Course: param1 type, param2 degrees, of any number of turns."""
    kind, course_deg = command.parameters[:2]
    # A NaN type is denied, too.
    if flight.mode is not GUIDED_COURSE or kind != COURSE_OVER_GROUND:
        return Result.DENIED
    (course_deg,) = finite(course_deg)
    flight.hold_turn(TurnTarget("course", math.remainder(math.radians(course_deg), math.tau)))
    return Result.ACCEPTED


def change_altitude(flight: EmulatedFlight, command: Command) -> Result:
    """Handle 186 in Guided Course and AUTO.LOITER: param1 metres, param2 frame."""
    altitude_m, frame = command.used(1, 2)
    if flight.mode not in {GUIDED_COURSE, AUTO_LOITER}:
        return Result.DENIED
    above_home_m = 0.0 if int(frame) in AMSL_FRAMES else flight.home.altitude_amsl_m
    flight.hold_height(AltitudeTarget(altitude_m + above_home_m))
    return Result.ACCEPTED
