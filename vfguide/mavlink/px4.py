"""PX4, fixed wing: offboard mode, the course as a velocity setpoint, the speed as a command.

What a fixed wing makes of a velocity setpoint (PX4 1.14 to 1.17, its fixed-wing mode manager):

- the course is that of the north and east velocity; their length is ignored;
- all three velocities have to be finite, or the setpoint is none;
- the third is taken for a rate of climb without a change of sign, although the message counts it down: 0 is
  the one value that every version understands, and it locks the altitude at which offboard was entered;
- each setpoint cancels the airspeed that was commanded before it: the command has to follow each of them.
"""

import math
from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.mavlink.adapter import Vehicle, command_long, set_mode, telemetry_at
from vfguide.mavlink.parameters import FlightNeeds
from vfguide.mavlink.px4_parameters import NAMES, px4_warnings
from vfguide.mavlink.recognition import other_autopilot
from vfguide.mavlink.reports import ParameterReport

MAIN_MODE_AUTO, SUB_MODE_LOITER = 4, 3
MAIN_MODE_OFFBOARD = 6

IGNORE_POSITION = 0b111
IGNORE_ACCELERATION = 0b111 << 6
IGNORE_YAW = 0b1 << 10
IGNORE_YAW_RATE = 0b1 << 11
VELOCITY_ONLY = IGNORE_POSITION | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE
"""Set exactly: PX4 ignores a field only where its bit says so."""

AIRSPEED, GROUND_SPEED = 0, 1
KEEP_THROTTLE = -1.0


class Px4:
    """Adapter for PX4."""

    streams_before_engaging = True
    holds_altitude = False
    keep_alive_s = 0.2
    """Offboard ends when the stream is slower than 2 Hz; a radio may lose one of two."""
    parts_belong_together = True
    parameters = NAMES

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle
        self._speed_type = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED

    def recognise(self, autopilot: int) -> str | None:
        """Anything but PX4 is another one."""
        return other_autopilot(autopilot, mavlink.MAV_AUTOPILOT_PX4)

    def parameter_value(self, report: ParameterReport) -> float:
        """PX4 puts the bytes of whole numbers into the field of a real one."""
        return report.value if report.whole is None else float(report.whole)

    def parameter_warnings(self, parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
        """What does not fit the flight, one line each."""
        return px4_warnings(parameters, needs)

    def is_engaged(self, custom_mode: int) -> bool:
        """Offboard: the main mode is the third byte of the custom mode."""
        return (custom_mode >> 16) & 0xFF == MAIN_MODE_OFFBOARD

    def is_handed_back(self, custom_mode: int) -> bool:
        """Hold: main mode auto, sub mode loiter."""
        return custom_mode >> 16 == SUB_MODE_LOITER << 8 | MAIN_MODE_AUTO

    def request_telemetry(self, rate_hz: float) -> list[MAVLink_message]:
        """Position and airspeed at this rate."""
        return telemetry_at(self._vehicle, rate_hz)

    def engage(self) -> list[MAVLink_message]:
        """Enter offboard; refused unless setpoints are already arriving."""
        return [set_mode(self._vehicle, MAIN_MODE_OFFBOARD)]

    def hand_back(self) -> list[MAVLink_message]:
        """Enter hold, PX4's loiter."""
        return [set_mode(self._vehicle, MAIN_MODE_AUTO, SUB_MODE_LOITER)]

    def fly(self, course: float, speed: float) -> list[MAVLink_message]:
        """A velocity along the course, whose length is ignored, and then the speed by DO_CHANGE_SPEED."""
        return [
            self._velocity(course, speed),
            command_long(
                self._vehicle,
                mavlink.MAV_CMD_DO_CHANGE_SPEED,
                self._speed_type,
                speed,
                KEEP_THROTTLE,
            ),
        ]

    def stay_ready(self, course: float, speed: float) -> list[MAVLink_message]:
        """The stream of setpoints without which offboard cannot be entered, by the pilot neither.

        PX4 ignores them in every other mode. The speed command is left out: that one it would obey.
        """
        return [self._velocity(course, speed)]

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Nothing: velocity setpoints keep the altitude at which offboard was entered."""
        del altitude_amsl
        return []

    def _velocity(self, course: float, speed: float) -> MAVLink_message:
        """SET_POSITION_TARGET_LOCAL_NED with a velocity and nothing else."""
        vehicle = self._vehicle
        velocity = (speed * math.cos(course), speed * math.sin(course), 0.0)
        return mavlink.MAVLink_set_position_target_local_ned_message(
            0,
            vehicle.system_id,
            vehicle.component_id,
            mavlink.MAV_FRAME_LOCAL_NED,
            VELOCITY_ONLY,
            *(0.0, 0.0, 0.0),
            *velocity,
            *(0.0, 0.0, 0.0),
            *(0.0, 0.0),
        )
