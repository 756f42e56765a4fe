"""Adapter of ArduPlane, which holds course, airspeed and altitude commands in GUIDED until the next ones.

Warnings about its parameters are pure functions of their values. The figures were measured on ArduPlane 4.7
in software.
"""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.guidance.airframe import GRAVITY
from vfguide.mavlink.adapter import (
    AutopilotAdapter,
    AutopilotSetpoint,
    Vehicle,
    autopilot,
    command_int,
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
from vfguide.mavlink.reports import CommandReport

NAMES = (
    *("FS_GCS_ENABL", "FS_LONG_ACTN", "FS_LONG_TIMEOUT", "MAV_GCS_SYSID", "SYSID_MYGCS"),
    *("GUIDED_P", "SCHED_LOOP_RATE", "TECS_TIME_CONST", "TECS_CLMB_MAX", "TECS_SINK_MAX"),
    *("AIRSPEED_MIN", "AIRSPEED_MAX", "ARSPD_FBW_MIN", "ARSPD_FBW_MAX"),
    *("ROLL_LIMIT_DEG", "LIM_ROLL_CD"),
)
"""Parameters used here; of each pair of limits the second name is the one before version 4.5."""

HEARTBEAT, HEARTBEAT_OR_RADIO = 1.0, 2.0
"""Values of FS_GCS_ENABL that cover GUIDED; 3 covers AUTO only."""

SHORTEST_LONG_S, LONGEST_LONG_S = 3.0, 15.0

LEAST_GUIDED_P = 10_000.0
"""Minimum of GUIDED_P, 0.01 degrees of bank per rad of course error: below it, 30 degrees take over 3 s."""

MOST_TECS_TIME_CONST = 3.0
"""Maximum of TECS_TIME_CONST, s: at the default of 5, speed changes over 12 s hardly move the aircraft."""

CLIMB_SHARE = 0.5
"""Share of the energy of a climb at TECS_CLMB_MAX with which TECS lets the demanded speed rise."""

ALPHA_SHARE = 0.3
"""Tolerance of the mission's alpha against that of GUIDED_P, relative."""

SLIP_TURN_SHARE = 0.745
"""Turn rate of a slipping vehicle as a share of its bank angle's, measured on the simulated plane."""

BETA_TIME_CONST = 2.0
"""beta times TECS_TIME_CONST: 1.0 1/s at 2 s was measured, and 0.45 at 5 s."""

LEAST_TURN_SHARE = 0.5
"""Minimum turn rate of a slipping vehicle as a share of its bank angle's; the simulated plane has 0.745."""

GUIDED = 15

LOITER = 12

MODES = [
    "MANUAL",
    "CIRCLE",
    "STABILIZE",
    "TRAINING",
    "ACRO",
    "FBWA",
    "FBWB",
    "CRUISE",
    "AUTOTUNE",
    "-",
    "AUTO",
    "RTL",
    "LOITER",
    "TAKEOFF",
    "AVOID_ADSB",
    "GUIDED",
    "INITIALISING",
    "QSTABILIZE",
    "QHOVER",
    "QLOITER",
    "QLAND",
    "QRTL",
    "QAUTOTUNE",
    "QACRO",
    "THERMAL",
    "LOITER_ALT_QLAND",
    "AUTOLAND",
]
"""Names of the modes by number, from 0."""

HOMEWARD = frozenset({"RTL", "QLAND", "QRTL", "LOITER_ALT_QLAND", "AUTOLAND"})

STEERING_COMMANDS = frozenset(
    {mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED}
)
"""Commands that steer in GUIDED."""

COURSE_OVER_GROUND = 0

LEAST_TICKS = 1.25
"""Minimum scheduler ticks per report: ArduPlane refuses a rate with fewer."""

AIRSPEED, GROUND_SPEED = 0, 1


def alpha_of(guided_p: float, airspeed: float) -> float:
    """Return the course response, 1/s, of coordinated turns with GUIDED_P in 0.01 degrees per rad."""
    return math.radians(guided_p / 100.0) * GRAVITY / airspeed


def failsafe_warnings(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where ArduPlane would hold the last commands of a silent companion for ever.

    Only the fail-safe for lost heartbeats notices; in GUIDED it acts where FS_LONG_ACTN is not 0. Heartbeats
    count by their system, of any type and component: a companion's come from the vehicle's own.
    """
    enabled = parameters.get("FS_GCS_ENABL", HEARTBEAT)
    if enabled not in {HEARTBEAT, HEARTBEAT_OR_RADIO}:
        covers = "is 0" if enabled == 0.0 else f"is {enabled:g}, which leaves GUIDED out"
        return [
            (
                f"FS_GCS_ENABL {covers}: should this companion fall silent, the aircraft flies its last"
                f" course on for ever; set it to 1, MAV_GCS_SYSID to {needs.system_id}, FS_LONG_ACTN to 1:"
                " silence then leads to RTL, out of a pilot's MANUAL and FBWA too"
            )
        ]
    warnings = []
    station = first_known(parameters, "MAV_GCS_SYSID", "SYSID_MYGCS")
    if station is not None and station[1] != needs.system_id:
        warnings.append(
            f"{station[0]} is {station[1]:g}: a ground station's heartbeats keep the fail-safe off after this"
            f" companion has fallen silent; set it to {needs.system_id}, the vehicle's own system"
        )
    if parameters.get("FS_LONG_ACTN", 1.0) == 0.0:
        warnings.append(
            "FS_LONG_ACTN is 0: should this companion fall silent, GUIDED goes on; set it to 1 for RTL"
        )
    after_s = parameters.get("FS_LONG_TIMEOUT", SHORTEST_LONG_S)
    if not SHORTEST_LONG_S <= after_s <= LONGEST_LONG_S:
        warnings.append(
            f"FS_LONG_TIMEOUT is {after_s:g} s: a companion that starts anew needs {SHORTEST_LONG_S:g}, and"
            f" after {LONGEST_LONG_S:g} a formation is torn; set it to 5"
        )
    return warnings


def course_warnings(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where GUIDED_P does not fit the mission's alpha: alpha = GUIDED_P g / V, or less with slip."""
    gain = parameters.get("GUIDED_P")
    if gain is None:
        return []
    alpha = alpha_of(gain, needs.airspeed)
    warnings = []
    if gain < LEAST_GUIDED_P:
        warnings.append(
            f"GUIDED_P is {gain:g}: courses are taken up slowly, and a follower swings about its slot;"
            f" {LEAST_GUIDED_P:g} to 15000 is what flies well"
        )
    slowest = LEAST_TURN_SHARE * alpha if needs.slips else alpha
    # Too little for what the mission counts on, or too much.
    if alpha < (1.0 - ALPHA_SHARE) * needs.alpha or slowest > (1.0 + ALPHA_SHARE) * needs.alpha:
        warnings.append(
            f"GUIDED_P is {gain:g}, which gives alpha {alpha:.2f} 1/s at {needs.airspeed:g} m/s, and the"
            f" mission says {needs.alpha:g}: fly `vfguide identify` and take over what it finds"
        )
    return warnings


def loop_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where the rate of reports is refused: telemetry leaves on the scheduler's ticks."""
    loop_hz, ticks = scheduled(parameters, needs)
    if not ticks < LEAST_TICKS:
        return []
    return [
        (
            f"SCHED_LOOP_RATE is {loop_hz:g}: {needs.rate_hz:g} reports a second will be refused;"
            " set it to 200, or lower rehearsal.rate_hz"
        )
    ]


def uneven_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where reports come unevenly, at rates that are no whole number of ticks."""
    loop_hz, ticks = scheduled(parameters, needs)
    if not (LEAST_TICKS <= ticks < 8.0 and abs(ticks - round(ticks)) > 0.01):
        return []
    return [
        (
            f"SCHED_LOOP_RATE is {loop_hz:g}: {needs.rate_hz:g} reports a second will come unevenly;"
            f" set it to 200, or rehearsal.rate_hz to {loop_hz / math.ceil(ticks):g}"
        )
    ]


def scheduled(parameters: Mapping[str, float], needs: FlightNeeds) -> tuple[float, float]:
    """Return the scheduler's rate (Hz) and its ticks per report; NaN while unknown."""
    loop_hz = parameters.get("SCHED_LOOP_RATE", math.nan)
    if not loop_hz > 0.0:
        return math.nan, math.nan
    return loop_hz, loop_hz / needs.rate_hz


def speed_warning(parameters: Mapping[str, float]) -> list[str]:
    """Warn where the throttle follows the demanded speed slowly because of TECS_TIME_CONST."""
    time_const = parameters.get("TECS_TIME_CONST", 0.0)
    if time_const <= MOST_TECS_TIME_CONST:
        return []
    return [
        (
            f"TECS_TIME_CONST is {time_const:g}: the speed answers slowly, and hardly to what changes within"
            f" 12 s; set it to {MOST_TECS_TIME_CONST:g}, or 2 where the aircraft bears it"
        )
    ]


def climb_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """Warn where TECS_CLMB_MAX limits the speed's rise to less than the mission's acceleration.

    TECS_CLMB_MAX tells the climb at full throttle, and TECS asks for no more of that energy in speed. A climb
    of w takes the power g w per kilogram, an acceleration V dV/dt. The demanded speed thus rises by g w / (2
    V) at most, since half is left to the heights.

    It stays a warning, and the mission's acceleration is flown even with `response: auto`. That acceleration
    counts for slowing down as well, which another parameter limits (TECS_SINK_MIN). Laws that knew the limit
    flew an emulated formation between 8 % nearer to its slots and 3 % farther from them.
    """
    climb = parameters.get("TECS_CLMB_MAX", 0.0)
    limit = speed_rise(climb, needs.airspeed)
    if not 0.0 < limit < needs.max_acceleration - 0.01:
        return []
    least = needs.max_acceleration * needs.airspeed / (CLIMB_SHARE * GRAVITY)
    return [
        (
            f"TECS_CLMB_MAX is {climb:g} m/s: at {needs.airspeed:g} m/s the autopilot lets its airspeed rise"
            f" by {limit:.1f} m/s² at most, however much throttle is left, and the mission counts on"
            f" {needs.max_acceleration:g}: a follower that has to speed up falls behind its slot and comes"
            " back late; set it to the climb that full throttle really keeps up, if that is more"
            f" ({least:.0f} would do), or max_acceleration_m_s2 to {limit:.1f}"
        )
    ]


def speed_rise(climb: float, airspeed: float) -> float:
    """Return how fast a TECS with this TECS_CLMB_MAX (m/s) lets the airspeed (m/s) rise, m/s²."""
    return CLIMB_SHARE * GRAVITY * climb / airspeed


@autopilot("ardupilot")
class ArduPlane(AutopilotAdapter):
    """Adapter for ArduPlane."""

    number = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    holds_altitude = True
    keep_alive_s = 0.5
    """Longest time between repetitions, s: commands are held for ever, so they only replace lost ones."""
    engaged_name = "GUIDED"
    heartbeat_shows_flight = True
    parameters = NAMES

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        # ArduPlane itself denies a ground speed; the article's ideal hold takes one.
        self._speed_type = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """Return the response by GUIDED_P, TECS_TIME_CONST and the limits."""
        known = parameters
        gain, time_const = known.get("GUIDED_P", 0.0), known.get("TECS_TIME_CONST", 0.0)
        share = SLIP_TURN_SHARE if needs.slips else 1.0
        roll = known.get("ROLL_LIMIT_DEG", known.get("LIM_ROLL_CD", math.nan) / 100.0)
        lowest = first_known(known, "AIRSPEED_MIN", "ARSPD_FBW_MIN")
        highest = first_known(known, "AIRSPEED_MAX", "ARSPD_FBW_MAX")
        coordinated = alpha_of(gain, needs.airspeed) if gain > 0.0 else None
        return AutopilotResponse(
            alpha=None if coordinated is None else share * coordinated,
            coordinated_alpha=coordinated,
            beta=BETA_TIME_CONST / time_const if time_const > 0.0 else None,
            airspeed_min=None if lowest is None else lowest[1],
            airspeed_max=None if highest is None else highest[1],
            max_bank=math.radians(roll) if roll > 0.0 else None,
            # By these TECS limits how fast the demanded height goes to a new one.
            climb_max=above_zero(known.get("TECS_CLMB_MAX")),
            sink_max=above_zero(known.get("TECS_SINK_MAX")),
        )

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return the mismatches of parameters and flight, one line each."""
        return [
            *self.parameter_faults(parameters, needs),
            *course_warnings(parameters, needs),
            *uneven_warning(parameters, needs),
            *speed_warning(parameters),
            *climb_warning(parameters, needs),
        ]

    def parameter_faults(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """Return missing fail-safes, and limits that keep the mission from being flown."""
        roll = first_known(parameters, "ROLL_LIMIT_DEG")
        if roll is None and "LIM_ROLL_CD" in parameters:
            roll = ("LIM_ROLL_CD (in degrees)", parameters["LIM_ROLL_CD"] / 100.0)
        return [
            *failsafe_warnings(parameters, needs),
            *loop_warning(parameters, needs),
            *airspeed_warnings(
                first_known(parameters, "AIRSPEED_MIN", "ARSPD_FBW_MIN"),
                first_known(parameters, "AIRSPEED_MAX", "ARSPD_FBW_MAX"),
                needs,
            ),
            *bank_warning(roll, needs),
        ]

    def is_engaged(self, custom_mode: int) -> bool:
        """Check for GUIDED."""
        return custom_mode == GUIDED

    def is_handed_back(self, custom_mode: int) -> bool:
        """Check for LOITER."""
        return custom_mode == LOITER

    def mode_name(self, custom_mode: int) -> str:
        """Return the mode's name in ArduPlane's manual."""
        return MODES[custom_mode] if custom_mode < len(MODES) else f"mode {custom_mode}"

    def goes_home(self, custom_mode: int) -> bool:
        """Check for RTL and modes that land."""
        return self.mode_name(custom_mode) in HOMEWARD

    @property
    def steering_commands(self) -> frozenset[int]:
        """Numbers of the course and speed commands; a vehicle without altitude commands keeps its slot."""
        return STEERING_COMMANDS

    def steering_questions(self) -> list[MAVLink_message]:
        """Return a course command, which fails outside GUIDED."""
        return [self._course(0.0)]

    def denies_guided(self, report: CommandReport) -> bool:
        """Check for a failed course or altitude: both fail in every other mode, and for no other reason."""
        guided_only = {
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        }
        return report.command in guided_only and report.result == mavlink.MAV_RESULT_FAILED

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Return requests for position and airspeed at this rate."""
        return telemetry_at(
            self._vehicle, rate_hz, estimator=mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        )

    def engage(self) -> list[MAVLink_message]:
        """Return the command to enter GUIDED, which changes nothing in GUIDED."""
        return [set_mode(self._vehicle, GUIDED)]

    def hand_back(self) -> list[MAVLink_message]:
        """Return the command to enter LOITER."""
        return [set_mode(self._vehicle, LOITER)]

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Return GUIDED_CHANGE_HEADING with a course and GUIDED_CHANGE_SPEED.

        The lateral acceleration is the greatest in a turn: ArduPlane would accept 0 and not turn. The speed's
        acceleration is 0: any other value restarts the slew with each new speed.
        """
        speed = command_int(
            self._vehicle, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, self._speed_type, setpoint.speed
        )
        return [self._course(setpoint.course), speed]

    def _course(self, course: float) -> MAVLink_message:
        return command_int(
            self._vehicle,
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            COURSE_OVER_GROUND,
            compass_degrees(course),
            self._vehicle.lateral_acceleration,
        )

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Return GUIDED_CHANGE_ALTITUDE, whose climb rate of 0 leaves the rate to the autopilot."""
        command = mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE
        return [command_int(self._vehicle, command, altitude=altitude_amsl)]
