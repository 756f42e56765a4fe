"""Adapter of fixed-wing PX4, whose way of steering depends on its version and on Guided Course.

| way | on | course | airspeed | altitude | when setpoints stop |
|---|---|---|---|---|---|
| Guided Course | 1.18 | 43002 | 178 | 186 | flies on; NAV_DLL_ACT counts ground stations |
| position, offboard | 1.13 to 1.18 | a point 1500 m ahead | 178 after each | the point's | COM_OBL_RC_ACT |
| velocity, offboard | up to 1.14 | a velocity's | 178 after each | that of the entry | COM_OBL_RC_ACT |

The first two were flown on PX4 1.18.0-beta1 in software with a simulated airplane; earlier versions are known
by their source. 1.15 to 1.18 accept a velocity without a position, which steers nothing: 1.15 and 1.16 keep
the attitude of the moment, 1.17 and 1.18 course and height. Measured on 1.18.0-beta1 (20 commands a second):

| | course | lag behind a ramp of 6 degrees a second | airspeed |
|---|---|---|---|
| Guided Course | within 0.6 degrees | 1.20 s | by 178 |
| position ahead | within 0.5 degrees | 1.09 s | by 178, after each position |

- Course: 0.9 1/s (4 pi NPFG_DAMPING / NPFG_PERIOD), a lag of 0.4 s, a dead time of 0.3 s; bank FW_R_LIM. All
  but 0.05 s of the dead time is the roll's, which a steady turn does not feel.
- Airspeed: a setpoint moves to a new one with 1 m/s². With the aircraft's own FW_THR_ASPD_MIN, FW_THR_TRIM
  and FW_THR_ASPD_MAX, and FW_T_TAS_TC 2, the airspeed follows by (1 + 0.4 s)/(1 + 0.18 s + 0.09 s²), an
  oscillation at 0.5 Hz; with FW_T_TAS_TC 5 nearly so. With default parameters 0.6 of a step comes like that
  (0.8 with FW_T_TAS_TC 2), the rest with a time constant of a minute. 178 accepts everything, even NaN and 99
  m/s. Height within 1 m.
- An aircraft in Guided Course flies on when its companion dies. Companions' heartbeats are not counted,
  ground stations' are: NAV_DLL_ACT 1 loitered 13 s after the last (COM_DL_LOSS_T 10). So the companion sends
  such a heartbeat beside its own, except while a pilot flies.
- Offboard: COM_OBL_RC_ACT acts 1.7 s after the last setpoint. Its default 0 returns to the launch without a
  remote control; 5 loiters.
- Estimator: positions wander by 0.2 to 0.3 m per axis, velocities by 0.3 m/s and courses by 1 degree, for a
  second or two. The course hold acts on the reported course.
- PX4 answers a mode that it does not have with TEMPORARILY_REJECTED.
"""

import math
from collections.abc import Mapping

from pymap3d import rcurve
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.frames import wrap_longitude
from vfguide.guidance.air_data import CreepingHold
from vfguide.mavlink.adapter import (
    AutopilotSetpoint,
    Px4Steering,
    UnknownAutopilot,
    Vehicle,
    autopilot,
    command_long,
    compass_degrees,
    set_mode,
    telemetry_at,
)
from vfguide.mavlink.parameters import (
    AutopilotResponse,
    FlightNeeds,
    above_zero,
    airspeed_warnings,
    bank_warning,
    first_known,
)
from vfguide.mavlink.reports import CommandReport, ParameterReport, VersionReport

MAIN_MODE_AUTO, SUB_MODE_LOITER, SUB_MODE_GUIDED_COURSE = 4, 3, 19
MAIN_MODE_OFFBOARD = 6

AIRSPEED, GROUND_SPEED = 0, 1
KEEP_THROTTLE = -1.0

COURSE_OVER_GROUND = 0
"""Only type of heading that 43002 takes in Guided Course."""

AHEAD_M = 1500.0
"""Distance of the point that stands for a course, m: 2 m off course turn its bearing by under 0.1 degrees."""

IGNORE_POSITION = 0b111
IGNORE_VELOCITY = 0b111 << 3
IGNORE_ACCELERATION = 0b111 << 6
IGNORE_YAW = 0b1 << 10
IGNORE_YAW_RATE = 0b1 << 11
POSITION_ONLY = IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE
VELOCITY_ONLY = IGNORE_POSITION | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE
"""Type masks of setpoints: PX4 ignores a field only if its bit is set."""

OFFBOARD_KEEP_ALIVE_S = 0.2
"""Longest interval of offboard setpoints, s: offboard ends below 2 Hz, and a radio may lose one of two."""


# Warnings and responses by PX4's parameters are pure functions of their values.

NAMES = (
    *("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_DLL_EXCEPT", "COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
    *("FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_R_LIM", "FW_R_TC", "NPFG_PERIOD", "NPFG_DAMPING"),
    *("FW_T_TAS_TC", "FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX"),
    *("FW_T_CLMB_MAX", "FW_T_CLMB_R_SP", "FW_T_SINK_MAX", "FW_T_SINK_R_SP"),
)
"""Parameters used here."""

SHORTEST_LOSS_S, LONGEST_LOSS_S = 0.5, 5.0
"""Limits of the stream-loss timeout, s: the slowest stream has gaps of 0.5 s; after 5 s a formation is
torn."""

RC_ACTIONS_THAT_DESCEND = {4: "lands where it is", 6: "ends the flight", 7: "disarms"}
"""Values of COM_OBL_RC_ACT after which the aircraft does not fly on."""

LINK_ACTIONS_THAT_DESCEND = {3: "lands where it is", 5: "ends the flight", 6: "disarms"}
"""Values of NAV_DLL_ACT after which the aircraft does not fly on."""

LONGEST_LINK_LOSS_S = 15.0
"""Longest link-loss timeout without a warning, s: PX4's own default is 10."""

HOLD_BIT = 1 << 1
"""Bit of COM_DLL_EXCEPT for Guided Course and similar modes."""

ALPHA_SHARE = 0.3
"""Tolerance of the mission's alpha against that of the parameters, relative."""

COURSE_DEAD_TIME_S = 0.2
"""Dead time of the course, s: formations were flown with it, and no parameter tells it."""

UNTRIMMED = CreepingHold(share=0.6, time=70.0)
"""Measured airspeed response where throttles are not set: share that comes at once, time constant of the
rest, s."""

TRIMMED_BETA, UNTRIMMED_BETA = 3.0, 1.5
"""beta of a total-energy hold with which formations were flown, with and without set throttles, 1/s."""

LEAST_TIME_S, MOST_TIME_S = 1.5, 6.0
"""Range of FW_T_TAS_TC, s: the airspeed was measured at 2 and 5, with nearly the same response."""


def alpha_of(parameters: Mapping[str, float]) -> float | None:
    """Return 4 pi NPFG_DAMPING / NPFG_PERIOD, 1/s; None if unknown."""
    period_s, damping = parameters.get("NPFG_PERIOD", 0.0), parameters.get("NPFG_DAMPING", 0.0)
    return 4.0 * math.pi * damping / period_s if period_s > 0.0 and damping > 0.0 else None


def least_rate(parameters: Mapping[str, float], *names: str) -> float | None:
    """Return the rate at which the height goes to a new one, m/s: the lowest known one of these."""
    rates = (above_zero(parameters.get(name)) for name in names)
    return min((rate for rate in rates if rate is not None), default=None)


def beta_of(parameters: Mapping[str, float]) -> float | None:
    """Return the bandwidth of the airspeed hold, 1/s; None for parameters with which it was not measured."""
    trimmed = is_trimmed(parameters)
    if trimmed is None or not LEAST_TIME_S <= parameters.get("FW_T_TAS_TC", 0.0) <= MOST_TIME_S:
        return None
    return TRIMMED_BETA if trimmed else UNTRIMMED_BETA


def is_trimmed(parameters: Mapping[str, float]) -> bool | None:
    """Return whether the throttle of every airspeed is set; None if the parameters do not tell.

    Unset throttles of FW_AIRSPD_MIN and FW_AIRSPD_MAX are 0. PX4 then uses FW_THR_TRIM at every airspeed, and
    finds the rest by an integral.
    """
    names = ("FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX")
    if any(name not in parameters for name in names):
        return None
    slowest, middle, fastest = (parameters[name] for name in names)
    return 0.0 < slowest < middle < fastest


def link_loss_warnings(parameters: Mapping[str, float]) -> list[str]:
    """Warn about the action when heartbeats stop that PX4 counts in Guided Course."""
    value = parameters.get("NAV_DLL_ACT")
    if value is None:
        return []
    if value == 0.0:
        return [
            (
                "NAV_DLL_ACT is 0: should this companion fall silent, the aircraft flies its last course on"
                " for ever; 1 lets it loiter, 2 return"
            )
        ]
    warnings = []
    action = LINK_ACTIONS_THAT_DESCEND.get(round(value))
    if action is not None:
        warnings.append(
            f"NAV_DLL_ACT is {value:g}: when nothing is heard any more, the aircraft {action};"
            " 1 lets it loiter"
        )
    if int(parameters.get("COM_DLL_EXCEPT", 0.0)) & HOLD_BIT:
        warnings.append(
            f"COM_DLL_EXCEPT is {parameters['COM_DLL_EXCEPT']:g}: in Guided Course NAV_DLL_ACT does nothing,"
            " and the aircraft flies its last course on for ever; leave out 2"
        )
    after_s = parameters.get("COM_DL_LOSS_T", 0.0)
    if after_s > LONGEST_LINK_LOSS_S:
        warnings.append(
            f"COM_DL_LOSS_T is {after_s:g} s: should this companion fall silent, the aircraft flies its last"
            " course on for that long; 5 is enough"
        )
    return warnings


def stream_loss_warnings(parameters: Mapping[str, float]) -> list[str]:
    """Warn about the action when offboard setpoints stop."""
    warnings = []
    after_s = parameters.get("COM_OF_LOSS_T")
    if after_s is not None and after_s < SHORTEST_LOSS_S:
        warnings.append(
            f"COM_OF_LOSS_T is {after_s:g} s: one late setpoint ends offboard; 1 s is what bears a"
            " telemetry radio"
        )
    if after_s is not None and after_s > LONGEST_LOSS_S:
        warnings.append(
            f"COM_OF_LOSS_T is {after_s:g} s: should this companion fall silent, the aircraft flies its"
            " last course on for that long; 1 s is enough"
        )
    value = parameters.get("COM_OBL_RC_ACT")
    if value == 0.0:
        warnings.append(
            "COM_OBL_RC_ACT is 0: when the setpoints stop, a pilot with a remote control has it at once, and"
            " without one it returns to its launch, as all others do; 5 lets it loiter"
        )
    action = None if value is None else RC_ACTIONS_THAT_DESCEND.get(round(value))
    if action is not None:
        warnings.append(
            f"COM_OBL_RC_ACT is {value:g}: when the setpoints stop, the aircraft {action}; 5 lets it loiter"
        )
    return warnings


def course_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where alpha = 4 pi NPFG_DAMPING / NPFG_PERIOD does not fit the mission's."""
    alpha = alpha_of(parameters)
    if alpha is None or abs(alpha - needs.alpha) <= ALPHA_SHARE * needs.alpha:
        return []
    period_s, damping = parameters["NPFG_PERIOD"], parameters["NPFG_DAMPING"]
    return [
        (
            f"NPFG_PERIOD {period_s:g} s and NPFG_DAMPING {damping:g} give alpha {alpha:.2f} 1/s, and the"
            f" mission says {needs.alpha:g}: fly `vfguide identify` and take over what it finds"
        )
    ]


def throttle_warning(parameters: Mapping[str, float]) -> list[str]:
    """Warn if throttles are not set, so that only half of a new airspeed comes soon."""
    if is_trimmed(parameters) is not False:
        return []
    slowest, middle, fastest = (
        parameters[name] for name in ("FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX")
    )
    return [
        (
            f"FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX are {slowest:g}, {middle:g} and {fastest:g}:"
            " half of a new airspeed comes within 2 s and the rest within a minute, which costs accuracy; set"
            " them to the throttles of level flight at FW_AIRSPD_MIN, FW_AIRSPD_TRIM and FW_AIRSPD_MAX, and"
            " FW_T_TAS_TC to 2"
        )
    ]


MAIN_MODES = {
    1: "MANUAL",
    2: "ALTITUDE",
    3: "POSITION",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
    9: "SIMPLE",
    10: "TERMINATION",
}

AUTO_MODES = {
    1: "READY",
    2: "TAKEOFF",
    3: "HOLD",
    4: "MISSION",
    5: "RETURN",
    6: "LAND",
    8: "FOLLOW",
    9: "PRECLAND",
    10: "VTOL_TAKEOFF",
    19: "GUIDED_COURSE",
}
"""Names as ground stations show them."""

HOMEWARD = frozenset({"RETURN", "LAND", "PRECLAND", "TERMINATION"})

TRIES = 4
"""Number of requests for the version, one a second."""

REFUSALS = 3
"""Refusals of Guided Course in a row, one a second, after which PX4 counts as lacking that mode."""


@autopilot("px4")
class Px4(UnknownAutopilot):
    """Adapter of PX4, which becomes a way of steering once the version is known."""

    number = mavlink.MAV_AUTOPILOT_PX4
    rehearsed_as = "px4"
    heartbeat_shows_flight = False
    """False, since PX4 is ACTIVE as soon as it is armed."""
    parameters = NAMES
    holds_altitude = True
    engaged_name = "its guided mode"
    way = ""
    """Way of steering, to follow "steers" in a sentence."""
    stops_by: str | None = None
    """Parameter that decides what happens when the companion falls silent; None while unknown."""

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        self._tries = self._refusals = 0
        self._asked = False
        # MAVSDK's own threads go on sending while a process hangs.
        self._outlives = self.by_mavsdk
        if vehicle.px4_steering != "auto":
            self.become(STEERINGS[vehicle.px4_steering])

    def questions(self) -> list[MAVLink_message]:
        """Ask for the version until it is known; without an answer, steer by positions."""
        if self._tries >= TRIES:
            self.become(Px4ByPositions)
            return []
        self._tries += 1
        wanted = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
        return [command_long(self._vehicle, mavlink.MAV_CMD_REQUEST_MESSAGE, wanted)]

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """Choose the way of steering by the version."""
        if isinstance(report, CommandReport):
            return None
        self.become(STEERINGS[steering_of(report)])
        return f"PX4 {report.major}.{report.minor}: {self.told()}"

    def told(self) -> str:
        """Tell the operator how the aircraft is steered."""
        silent = "it and every ground station fall" if self.counts_ground_stations else "it falls"
        said = f"this companion steers {self.way}; should {silent} silent, {self.stops_by} decides"
        if self.counts_ground_stations or not self._outlives:
            return said
        return (
            f"{said} once its process has ended, and not while it hangs: MAVSDK then repeats the last"
            " setpoint until a pilot selects another mode"
        )

    def parameter_value(self, report: ParameterReport) -> float:
        """Return the value; PX4 puts the bytes of whole numbers into the field of a real one."""
        return report.value if report.whole is None else float(report.whole)

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """Return the response by NPFG's parameters, TECS's throttles and the limits."""
        del needs
        known = parameters
        lowest, highest = known.get("FW_AIRSPD_MIN"), known.get("FW_AIRSPD_MAX")
        bank, roll = known.get("FW_R_LIM", 0.0), known.get("FW_R_TC", 0.0)
        alpha, beta = alpha_of(known), beta_of(known)
        creeps = beta is not None and not is_trimmed(known)
        return AutopilotResponse(
            alpha=alpha,
            beta=beta,
            airspeed_min=lowest,
            airspeed_max=highest,
            max_bank=math.radians(bank) if bank > 0.0 else None,
            climb_max=least_rate(known, "FW_T_CLMB_MAX", "FW_T_CLMB_R_SP"),
            sink_max=least_rate(known, "FW_T_SINK_MAX", "FW_T_SINK_R_SP"),
            course_dead_time=None if alpha is None else COURSE_DEAD_TIME_S,
            course_lag=roll if roll > 0.0 else None,
            # PX4 has no other kind of hold.
            speed_hold="total-energy" if known else None,
            creeping_hold=UNTRIMMED if creeps else None,
        )

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return the mismatches of parameters and flight, one line each."""
        return [
            *self.parameter_faults(parameters, needs),
            *course_warning(parameters, needs),
            *throttle_warning(parameters),
        ]

    def parameter_faults(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return missing fail-safes for a silent companion, and limits below the mission's."""
        return [
            *(link_loss_warnings(parameters) if self.stops_by != "COM_OBL_RC_ACT" else ()),
            *(stream_loss_warnings(parameters) if self.stops_by != "NAV_DLL_ACT" else ()),
            *airspeed_warnings(
                first_known(parameters, "FW_AIRSPD_MIN"),
                first_known(parameters, "FW_AIRSPD_MAX"),
                needs,
            ),
            *bank_warning(first_known(parameters, "FW_R_LIM"), needs),
        ]

    def is_handed_back(self, custom_mode: int) -> bool:
        """Check for hold: main mode auto, sub mode loiter."""
        return custom_mode >> 16 == SUB_MODE_LOITER << 8 | MAIN_MODE_AUTO

    def mode_name(self, custom_mode: int) -> str:
        """Return the name by main mode (third byte) and sub mode (fourth byte)."""
        main, sub = (custom_mode >> 16) & 0xFF, (custom_mode >> 24) & 0xFF
        names, number = (AUTO_MODES, sub) if main == MAIN_MODE_AUTO else (MAIN_MODES, main)
        return names.get(number, f"mode {main}/{sub}")

    def goes_home(self, custom_mode: int) -> bool:
        """Check for return and modes that land."""
        return self.mode_name(custom_mode) in HOMEWARD

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Return requests for position and airspeed at this rate."""
        return telemetry_at(
            self._vehicle, rate_hz, estimator=mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS
        )

    def hand_back(self) -> list[MAVLink_message]:
        """Return the command to enter hold, PX4's loiter."""
        self._asked = False
        return [set_mode(self._vehicle, MAIN_MODE_AUTO, SUB_MODE_LOITER)]


@autopilot("mavsdk")
class Px4ByMavsdk(Px4):
    """Adapter of PX4 behind MAVSDK, which carries PX4's messages."""

    by_mavsdk = True


class SteeredPx4(Px4):
    """PX4 known well enough to be steered."""

    is_ready = True
    main_mode, sub_mode = MAIN_MODE_OFFBOARD, 0

    def questions(self) -> list[MAVLink_message]:
        """Return nothing: the version is known, or the mission has chosen."""
        return []

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """Ignore the answer: the choice stays."""
        del report
        return None

    def engage(self) -> list[MAVLink_message]:
        """Return the command to enter the mode; offboard is refused unless setpoints already arrive."""
        self._asked = True
        return [set_mode(self._vehicle, self.main_mode, self.sub_mode)]


class Px4InGuidedCourse(SteeredPx4):
    """PX4 steered in Guided Course, a mode of its own that holds commands until the next."""

    way = "in Guided Course"
    engaged_name = "GUIDED_COURSE"
    stops_by = "NAV_DLL_ACT"
    streams_before_engaging = False
    counts_ground_stations = True
    keep_alive_s = 0.5
    """Longest time between repetitions, s, which only replace lost commands."""
    parts_belong_together = False
    main_mode, sub_mode = MAIN_MODE_AUTO, SUB_MODE_GUIDED_COURSE
    steering_commands = frozenset({mavlink.MAV_CMD_GUIDED_CHANGE_HEADING})

    def hear(self, report: VersionReport | CommandReport) -> str | None:
        """Change to positions once Guided Course is refused, unless the mission has chosen it."""
        if not isinstance(report, CommandReport) or report.command != mavlink.MAV_CMD_DO_SET_MODE:
            return None
        if not self._asked:
            # The answer to a hand-back, or to another sender's command.
            return None
        self._asked = False
        accepted = report.result == mavlink.MAV_RESULT_ACCEPTED
        self._refusals = 0 if accepted else self._refusals + 1
        if self._refusals < REFUSALS or self._vehicle.px4_steering != "auto":
            return None
        self.become(Px4ByPositions)
        return (
            f"Guided Course is refused: {self.told()};"
            f" to be steered by hand select {self.engaged_name}"
        )

    def is_engaged(self, custom_mode: int) -> bool:
        """Check for Guided Course, a sub mode of auto; outside it 43002 is denied."""
        return custom_mode >> 16 == SUB_MODE_GUIDED_COURSE << 8 | MAIN_MODE_AUTO

    def steering_questions(self) -> list[MAVLink_message]:
        """Return a course command, which is denied outside Guided Course."""
        return [self._course(0.0)]

    def denies_guided(self, report: CommandReport) -> bool:
        """Check for a denied course, as outside Guided Course."""
        return (report.command, report.result) == (
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            mavlink.MAV_RESULT_DENIED,
        )

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return GUIDED_CHANGE_HEADING with a course over ground and DO_CHANGE_SPEED."""
        return [self._course(setpoint.course), change_speed(self._vehicle, setpoint.speed)]

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Return DO_CHANGE_ALTITUDE, as in loiter; the mode begins at the altitude of the moment."""
        return self.loiter_at(altitude_amsl)

    def _course(self, course: float) -> MAVLink_message:
        heading = mavlink.MAV_CMD_GUIDED_CHANGE_HEADING
        return command_long(self._vehicle, heading, COURSE_OVER_GROUND, compass_degrees(course))


class Px4ByPositions(SteeredPx4):
    """PX4 steered in offboard by a point ahead on the course: flying to it flies the course.

    Offboard setpoints must keep arriving, even before offboard is entered. Each resets the airspeed to the
    autopilot's own, so that the speed command must follow it.
    """

    way = "by positions ahead in offboard"
    engaged_name = "OFFBOARD"
    stops_by = "COM_OBL_RC_ACT"
    keep_alive_s = OFFBOARD_KEEP_ALIVE_S

    def is_engaged(self, custom_mode: int) -> bool:
        """Check the main mode, which is the third byte of the custom mode."""
        return (custom_mode >> 16) & 0xFF == MAIN_MODE_OFFBOARD

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return the course and altitude, and then the speed."""
        return [*self.stay_ready(setpoint), change_speed(self._vehicle, setpoint.speed)]

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return a position on the course, at the altitude to hold; a speed would act in other modes, too."""
        latitude_deg, longitude_deg = point_ahead(setpoint, AHEAD_M)
        vehicle = self._vehicle
        return [
            mavlink.MAVLink_set_position_target_global_int_message(
                0,
                vehicle.system_id,
                vehicle.component_id,
                # PX4 does not take the altitude of frame 0, which ought to mean the same.
                mavlink.MAV_FRAME_GLOBAL_INT,
                POSITION_ONLY,
                round(latitude_deg * 1e7),
                round(longitude_deg * 1e7),
                setpoint.altitude_amsl,
                *(0.0, 0.0, 0.0),
                *(0.0, 0.0, 0.0),
                *(0.0, 0.0),
            )
        ]


class Px4ByVelocities(Px4ByPositions):
    """PX4 steered in offboard by a velocity along the course, whose magnitude is ignored.

    PX4 takes the third velocity as a climb rate without changing its sign, although the message counts it
    downward. Only 0 is understood by every version, and keeps the altitude of the entry.
    """

    way = "by velocities in offboard"
    holds_altitude = False

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return a velocity along the course; PX4 ignores it unless all three components are finite."""
        vehicle, course, speed = self._vehicle, setpoint.course, setpoint.speed
        return [
            mavlink.MAVLink_set_position_target_local_ned_message(
                0,
                vehicle.system_id,
                vehicle.component_id,
                mavlink.MAV_FRAME_LOCAL_NED,
                VELOCITY_ONLY,
                *(0.0, 0.0, 0.0),
                *(speed * math.cos(course), speed * math.sin(course), 0.0),
                *(0.0, 0.0, 0.0),
                *(0.0, 0.0),
            )
        ]


STEERINGS: dict[Px4Steering, type[SteeredPx4]] = {
    "guided-course": Px4InGuidedCourse,
    "position": Px4ByPositions,
    "velocity": Px4ByVelocities,
}
"""Ways of steering by their names in a mission."""


def steering_of(version: VersionReport) -> Px4Steering:
    """Return the way of steering of a version; positions, which most understand, for an unknown one (0)."""
    number = (version.major, version.minor)
    if number >= (1, 18):
        return "guided-course"
    return "velocity" if (0, 0) < number <= (1, 14) else "position"


def change_speed(vehicle: Vehicle, speed: float) -> MAVLink_message:
    """Return DO_CHANGE_SPEED (m/s), which PX4 always accepts; a ground speed means nothing to it."""
    kind = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED
    return command_long(vehicle, mavlink.MAV_CMD_DO_CHANGE_SPEED, kind, speed, KEEP_THROTTLE)


def point_ahead(setpoint: AutopilotSetpoint, distance_m: float) -> tuple[float, float]:
    """Return (latitude, longitude), degrees, of the point this far ahead on the course.

    By the radii of curvature at the vehicle, the bearing at 1500 m is right to 0.01 degrees up to 60 degrees
    of latitude.
    """
    latitude_deg, course = setpoint.latitude_deg, setpoint.course
    north, east = distance_m * math.cos(course), distance_m * math.sin(course)
    northward = math.degrees(north / float(rcurve.meridian(latitude_deg)))
    # On the parallel half-way, since the meridians converge.
    middle_deg = latitude_deg + 0.5 * northward
    parallel = float(rcurve.transverse(middle_deg)) * math.cos(math.radians(middle_deg))
    eastward = math.degrees(east / parallel)
    return latitude_deg + northward, wrap_longitude(setpoint.longitude_deg + eastward)
