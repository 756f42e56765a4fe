"""The three ways in which a fixed wing of PX4 is steered from outside, by what its version has.

| way | on | course | airspeed | altitude | when setpoints stop |
|---|---|---|---|---|---|
| Guided Course | 1.18 | 43002 | 178 | 186 | flies on; NAV_DLL_ACT counts ground stations |
| position, offboard | 1.13 to 1.18 | a point 1500 m ahead | 178 after each | the point's | COM_OBL_RC_ACT |
| velocity, offboard | up to 1.14 | a velocity's | 178 after each | that of the entry | COM_OBL_RC_ACT |

Flown on PX4 1.18.0-beta1 in software, simulated airplane: the first two. By the source: the versions before.
A velocity without a position is accepted by 1.15 to 1.18 and steers nothing: 1.15 and 1.16 keep the attitude
of the moment, 1.17 and 1.18 course and height.
"""

import math
from typing import Protocol

from pymap3d import rcurve
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.frames import wrap_longitude
from vfguide.mavlink.adapter import AutopilotSetpoint, Vehicle, command_long, compass_degrees

MAIN_MODE_AUTO, SUB_MODE_LOITER, SUB_MODE_GUIDED_COURSE = 4, 3, 19
MAIN_MODE_OFFBOARD = 6

AIRSPEED, GROUND_SPEED = 0, 1
KEEP_THROTTLE = -1.0

COURSE_OVER_GROUND = 0
"""The one type of heading that 43002 takes in Guided Course."""

AHEAD_M = 1500.0
"""Distance of the point that stands for a course: 2 m off course turn its bearing by under 0.1 degrees."""

IGNORE_POSITION = 0b111
IGNORE_VELOCITY = 0b111 << 3
IGNORE_ACCELERATION = 0b111 << 6
IGNORE_YAW = 0b1 << 10
IGNORE_YAW_RATE = 0b1 << 11
POSITION_ONLY = IGNORE_VELOCITY | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE
VELOCITY_ONLY = IGNORE_POSITION | IGNORE_ACCELERATION | IGNORE_YAW | IGNORE_YAW_RATE
"""Set exactly: PX4 ignores a field only where its bit says so."""

OFFBOARD_KEEP_ALIVE_S = 0.2
"""Offboard ends when the stream is slower than 2 Hz; a radio may lose one of two."""


class Px4SteeringWay(Protocol):
    """One way of steering; what its properties mean is told at `AutopilotAdapter`."""

    name: str
    """In a sentence: steered ..."""
    stops_by: str
    """Parameter that decides what the aircraft does when its companion falls silent."""
    streams_before_engaging: bool
    counts_ground_stations: bool
    holds_altitude: bool
    keep_alive_s: float
    parts_belong_together: bool
    main_mode: int
    sub_mode: int

    def is_engaged(self, custom_mode: int) -> bool:
        """Whether this is the mode in which it is obeyed."""

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Hold a course and a speed."""

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """What has to be heard before the mode can be entered; ignored in every other mode."""

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Hold an altitude, m above mean sea level, where `fly` does not say it."""


class GuidedCourse:
    """Commands that are held until the next: a mode of PX4's own, not offboard."""

    name = "in Guided Course"
    stops_by = "NAV_DLL_ACT"
    streams_before_engaging = False
    counts_ground_stations = True
    holds_altitude = True
    keep_alive_s = 0.5
    """Repetitions are for commands that were lost on the way."""
    parts_belong_together = False
    main_mode, sub_mode = MAIN_MODE_AUTO, SUB_MODE_GUIDED_COURSE

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    def is_engaged(self, custom_mode: int) -> bool:
        """Main mode auto, sub mode Guided Course; outside it 43002 is denied."""
        return custom_mode >> 16 == SUB_MODE_GUIDED_COURSE << 8 | MAIN_MODE_AUTO

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """GUIDED_CHANGE_HEADING with a course over ground, DO_CHANGE_SPEED."""
        return [*self.course(setpoint.course), change_speed(self._vehicle, setpoint.speed)]

    def course(self, course: float) -> list[MAVLink_message]:
        """GUIDED_CHANGE_HEADING with a course over ground (rad)."""
        return [
            command_long(
                self._vehicle,
                mavlink.MAV_CMD_GUIDED_CHANGE_HEADING,
                COURSE_OVER_GROUND,
                compass_degrees(course),
            )
        ]

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """Nothing: the mode can be entered at any time."""
        del setpoint
        return []

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """DO_CHANGE_ALTITUDE; the mode is entered with the altitude of the moment."""
        command = mavlink.MAV_CMD_DO_CHANGE_ALTITUDE
        return [command_long(self._vehicle, command, altitude_amsl, mavlink.MAV_FRAME_GLOBAL)]


class Offboard:
    """What setpoints of offboard have in common: they have to go on arriving, also before it is entered."""

    stops_by = "COM_OBL_RC_ACT"
    streams_before_engaging = True
    counts_ground_stations = False
    keep_alive_s = OFFBOARD_KEEP_ALIVE_S
    parts_belong_together = True
    """Each setpoint sets the airspeed back to the autopilot's own: the command has to follow it."""
    main_mode, sub_mode = MAIN_MODE_OFFBOARD, 0

    def __init__(self, vehicle: Vehicle) -> None:
        self._vehicle = vehicle

    def is_engaged(self, custom_mode: int) -> bool:
        """The main mode is the third byte of the custom mode."""
        return (custom_mode >> 16) & 0xFF == MAIN_MODE_OFFBOARD

    def fly(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """The course and the altitude, and then the speed."""
        return [*self.stay_ready(setpoint), change_speed(self._vehicle, setpoint.speed)]

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """The setpoint alone: the speed command would be obeyed in other modes too."""
        raise NotImplementedError

    def hold_altitude(self, altitude_amsl: float) -> list[MAVLink_message]:
        """Nothing: a position says it, and a velocity keeps the altitude at which offboard was entered."""
        del altitude_amsl
        return []


class PositionAhead(Offboard):
    """The course as a point ahead: an aircraft that flies to it flies the course."""

    name = "by positions ahead in offboard"
    holds_altitude = True

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """A position on the course, at the altitude that is to be held."""
        latitude_deg, longitude_deg = point_ahead(setpoint, AHEAD_M)
        vehicle = self._vehicle
        return [
            mavlink.MAVLink_set_position_target_global_int_message(
                0,
                vehicle.system_id,
                vehicle.component_id,
                # The altitude of frame 0, which ought to mean the same, is not taken.
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


class VelocityAlong(Offboard):
    """The course as that of a velocity whose length is ignored.

    The third velocity is taken for a rate of climb without a change of sign, although the message counts it
    down: 0 is the one value that every version understands, and it keeps the altitude of the entry.
    """

    name = "by velocities in offboard"
    holds_altitude = False

    def stay_ready(self, setpoint: AutopilotSetpoint) -> list[MAVLink_message]:
        """A velocity along the course: all three components have to be finite, or the setpoint is none."""
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


def change_speed(vehicle: Vehicle, speed: float) -> MAVLink_message:
    """DO_CHANGE_SPEED (m/s); PX4 accepts whatever it says, and a ground speed means nothing to it."""
    kind = AIRSPEED if vehicle.hold == "heading-hold" else GROUND_SPEED
    return command_long(vehicle, mavlink.MAV_CMD_DO_CHANGE_SPEED, kind, speed, KEEP_THROTTLE)


def point_ahead(setpoint: AutopilotSetpoint, distance_m: float) -> tuple[float, float]:
    """(latitude, longitude) in degrees of the point this far ahead on the course.

    By the radii of curvature at the vehicle, which for 1500 m is right to 0.01 degrees of bearing up to 60
    degrees of latitude.
    """
    latitude_deg, course = setpoint.latitude_deg, setpoint.course
    north, east = distance_m * math.cos(course), distance_m * math.sin(course)
    northward = math.degrees(north / float(rcurve.meridian(latitude_deg)))
    # On the parallel half way: the meridians converge meanwhile.
    middle_deg = latitude_deg + 0.5 * northward
    parallel = float(rcurve.transverse(middle_deg)) * math.cos(math.radians(middle_deg))
    eastward = math.degrees(east / parallel)
    return latitude_deg + northward, wrap_longitude(setpoint.longitude_deg + eastward)
