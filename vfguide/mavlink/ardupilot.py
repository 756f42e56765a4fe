"""ArduPlane: GUIDED mode, course, airspeed and altitude by commands that it holds until the next."""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.angles import wrap_course
from vfguide.mavlink.adapter import Vehicle, command_int, set_mode, telemetry_at
from vfguide.mavlink.arduplane_parameters import NAMES, arduplane_warnings
from vfguide.mavlink.parameters import FlightNeeds
from vfguide.mavlink.recognition import other_autopilot
from vfguide.mavlink.reports import ParameterReport

GUIDED = 15
LOITER = 12

COURSE_OVER_GROUND = 0
AIRSPEED, GROUND_SPEED = 0, 1


class ArduPlane:
    """Adapter for ArduPlane."""

    streams_before_engaging = False
    holds_altitude = True
    keep_alive_s = 0.5
    """It holds commands for ever: repetitions are for those that were lost on the way."""
    parts_belong_together = False
    parameters = NAMES

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        # ArduPlane itself denies a ground speed; the article's ideal hold takes one.
        self._speed_type = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED

    def recognise(self, autopilot: int) -> str | None:
        """Anything but ArduPilot is another one."""
        return other_autopilot(autopilot, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)

    def parameter_value(self, report: ParameterReport) -> float:
        """ArduPilot converts whole numbers to real ones."""
        return report.value

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What does not fit the flight, one line each."""
        return arduplane_warnings(parameters, needs)

    def is_engaged(self, custom_mode: int) -> bool:
        """GUIDED."""
        return custom_mode == GUIDED

    def is_handed_back(self, custom_mode: int) -> bool:
        """LOITER."""
        return custom_mode == LOITER

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Position and airspeed at this rate."""
        return telemetry_at(self._vehicle, rate_hz)

    def engage(self) -> list[MAVLink_message]:
        """Enter GUIDED; entering it again while in it changes nothing."""
        return [set_mode(self._vehicle, GUIDED)]

    def hand_back(self) -> list[MAVLink_message]:
        """Enter LOITER."""
        return [set_mode(self._vehicle, LOITER)]

    def fly(self, course: float, speed: float) -> list[MAVLink_message]:
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
                compass_degrees(course),
                vehicle.lateral_acceleration,
            ),
            command_int(vehicle, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, self._speed_type, speed),
        ]

    def stay_ready(self, course: float, speed: float) -> list[MAVLink_message]:
        """Nothing: GUIDED can be entered at any time."""
        del course, speed
        return []

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """GUIDED_CHANGE_ALTITUDE; a climb rate of 0 leaves it to the autopilot."""
        command = mavlink.MAV_CMD_GUIDED_CHANGE_ALTITUDE
        return [command_int(self._vehicle, command, altitude=altitude_amsl)]


def compass_degrees(course: float) -> float:
    """Degrees in [0, 360) for an angle in radians, also after single precision has rounded them.

    360 is denied; to a thousandth of a degree nothing below it rounds up to it.
    """
    return round(math.degrees(wrap_course(course)), 3) % 360.0
