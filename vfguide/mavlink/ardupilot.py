"""ArduPlane: GUIDED mode, course, airspeed and altitude by commands that it holds until the next."""

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

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
from vfguide.mavlink.arduplane_parameters import NAMES, arduplane_response, arduplane_warnings
from vfguide.mavlink.parameters import AutopilotResponse, FlightNeeds
from vfguide.mavlink.reports import CommandReport

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
"""Names, from number 0."""

HOMEWARD = frozenset({"RTL", "QLAND", "QRTL", "LOITER_ALT_QLAND", "AUTOLAND"})

COURSE_OVER_GROUND = 0
AIRSPEED, GROUND_SPEED = 0, 1


@autopilot("ardupilot")
class ArduPlane(AutopilotAdapter):
    """Adapter for ArduPlane."""

    number = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    holds_altitude = True
    keep_alive_s = 0.5
    """It holds commands for ever: repetitions are for those that were lost on the way."""
    engaged_name = "GUIDED"
    heartbeat_shows_flight = True
    parameters = NAMES

    def __init__(self, vehicle: Vehicle) -> None:
        super().__init__(vehicle)
        # ArduPlane itself denies a ground speed; the article's ideal hold takes one.
        self._speed_type = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED

    def response(self, parameters: Mapping[str, float], needs: FlightNeeds) -> AutopilotResponse:
        """By GUIDED_P, TECS_TIME_CONST and its limits."""
        return arduplane_response(parameters, needs)

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What does not fit the flight, one line each."""
        return arduplane_warnings(parameters, needs)

    def is_engaged(self, custom_mode: int) -> bool:
        """GUIDED."""
        return custom_mode == GUIDED

    def is_handed_back(self, custom_mode: int) -> bool:
        """LOITER."""
        return custom_mode == LOITER

    def mode_name(self, custom_mode: int) -> str:
        """As in its manual."""
        return MODES[custom_mode] if custom_mode < len(MODES) else f"mode {custom_mode}"

    def goes_home(self, custom_mode: int) -> bool:
        """RTL, and what lands."""
        return self.mode_name(custom_mode) in HOMEWARD

    def denies_guided(self, report: CommandReport) -> bool:
        """Courses and altitudes fail in every other mode, and for no other reason."""
        guided_only = {
            mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
            mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
        }
        return report.command in guided_only and report.result == mavlink.MAV_RESULT_FAILED

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Position and airspeed at this rate."""
        return telemetry_at(
            self._vehicle, rate_hz, estimator=mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT
        )

    def engage(self) -> list[MAVLink_message]:
        """Enter GUIDED; entering it again while in it changes nothing."""
        return [set_mode(self._vehicle, GUIDED)]

    def hand_back(self) -> list[MAVLink_message]:
        """Enter LOITER."""
        return [set_mode(self._vehicle, LOITER)]

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """GUIDED_CHANGE_HEADING with a course, GUIDED_CHANGE_SPEED.

        The lateral acceleration is what a turn may take: 0 would be accepted and the aircraft would
        not turn. The speed's acceleration is 0: any other restarts the slew with each new value.
        """
        vehicle = self._vehicle
        return [
            command_int(
                vehicle,
                mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
                COURSE_OVER_GROUND,
                compass_degrees(setpoint.course),
                vehicle.lateral_acceleration,
            ),
            command_int(
                vehicle, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, self._speed_type, setpoint.speed
            ),
        ]

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """GUIDED_CHANGE_ALTITUDE; a climb rate of 0 leaves it to the autopilot."""
        command = mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE
        return [command_int(self._vehicle, command, altitude=altitude_amsl)]
