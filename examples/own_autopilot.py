"""An autopilot of one's own: ArduPlane in the fewest words, as a beginning for another.

    vfguide fly circle-wind --plugin own_autopilot.py --set vehicles.f1.autopilot=brief

A companion asks for telemetry, waits until a pilot selects the guided mode, sends courses and speeds, and
hands back. It knows when; this file says how. What is not written here has a default (`AutopilotAdapter`): no
parameters are read, nothing has to be asked before, altitudes are left alone.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink import (
    AutopilotAdapter,
    AutopilotSetpoint,
    autopilot,
    command_int,
    compass_degrees,
    set_mode,
)

LOITER, GUIDED = 12, 15
MODES = {0: "MANUAL", 11: "RTL", LOITER: "LOITER", 13: "TAKEOFF", GUIDED: "GUIDED"}
COURSE_OVER_GROUND, AIRSPEED = 0, 0


@autopilot("brief")
class Brief(AutopilotAdapter):
    """Adapter for ArduPlane."""

    number = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    rehearsed_as = "ardupilot"
    engaged_name = "GUIDED"
    heartbeat_shows_flight = True
    """It is ACTIVE in the air only."""

    def is_engaged(self, custom_mode: int) -> bool:
        """In GUIDED it obeys."""
        return custom_mode == GUIDED

    def is_handed_back(self, custom_mode: int) -> bool:
        """In LOITER it flies by itself."""
        return custom_mode == LOITER

    def mode_name(self, custom_mode: int) -> str:
        """By its name a mission lets a vehicle be engaged out of a mode."""
        return MODES.get(custom_mode, f"mode {custom_mode}")

    def engage(self) -> list[MAVLink_message]:
        """Enter GUIDED."""
        return [set_mode(self._vehicle, GUIDED)]

    def hand_back(self) -> list[MAVLink_message]:
        """Enter LOITER."""
        return [set_mode(self._vehicle, LOITER)]

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """A course with the lateral acceleration that it may take, and an airspeed."""
        vehicle, course = self._vehicle, compass_degrees(setpoint.course)
        turn = (COURSE_OVER_GROUND, course, vehicle.lateral_acceleration)
        speed = (AIRSPEED, setpoint.speed)
        return [
            command_int(vehicle, mavlink.MAV_CMD_GUIDED_CHANGE_HEADING, *turn),
            command_int(vehicle, mavlink.MAV_CMD_GUIDED_CHANGE_SPEED, *speed),
        ]
