"""Where the aircraft is and how it moves, in MAVLink's units; nothing else knows these units.

Height above the ellipsoid and above mean sea level are one here.
"""

import math

import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.geometry import wrap_to_pi, wrap_to_two_pi
from sitl_stub.report import Report, centidegrees, centimetres_per_second, degrees_e7, millimetres

SATELLITES = 14
"""Of a good fix."""

CRUISE_THROTTLE_PERCENT = 50
"""Reported for want of an engine model."""


def gps_raw_int(report: Report) -> MAVLink_message:
    """The receiver's own word; a fix as soon as sensors have settled."""
    motion = report.motion
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if report.ready else mavlink.GPS_FIX_TYPE_NO_FIX
    return mavlink.MAVLink_gps_raw_int_message(
        report.time_boot_ms * 1000,
        fix,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        millimetres(report.altitude_amsl_m),
        120,
        200,
        abs(centimetres_per_second(motion.ground_speed_m_s)),
        centidegrees(motion.course_rad),
        SATELLITES if report.ready else 0,
    )


def nav_controller_output(report: Report) -> MAVLink_message:
    """What the autopilot steers for: of a course or bank held, nothing but the roll is known."""
    motion = report.motion
    return mavlink.MAVLink_nav_controller_output_message(
        math.degrees(motion.bank_rad),
        0.0,
        round(math.degrees(motion.course_rad)) % 360,
        round(math.degrees(motion.course_rad)) % 360,
        0,
        0.0,
        0.0,
        0.0,
    )


def altitude(report: Report) -> MAVLink_message:
    """PX4's heights: above mean sea level, and above home."""
    flight = report.flight
    amsl_m = report.altitude_amsl_m
    above_home_m = amsl_m - flight.home.altitude_amsl_m
    return mavlink.MAVLink_altitude_message(
        report.time_boot_ms * 1000, amsl_m, amsl_m, above_home_m, above_home_m, math.nan, math.nan
    )


def attitude(report: Report) -> MAVLink_message:
    """Roll of the coordinated turn, yaw and its rate; pitch is the angle of climb."""
    motion = report.motion
    # On the ground there may be no airspeed at all.
    pitch_rad = math.atan2(-motion.down_m_s, max(motion.airspeed_m_s, 1.0))
    return mavlink.MAVLink_attitude_message(
        report.time_boot_ms,
        motion.bank_rad,
        pitch_rad,
        wrap_to_pi(motion.heading_rad),
        0.0,
        0.0,
        motion.turn_rate_rad_s,
    )


def attitude_quaternion(report: Report) -> MAVLink_message:
    """The same attitude: yaw, pitch, roll in that order, w first."""
    motion = report.motion
    halves = (
        0.5 * motion.bank_rad,
        0.5 * math.atan2(-motion.down_m_s, max(motion.airspeed_m_s, 1.0)),
        0.5 * wrap_to_pi(motion.heading_rad),
    )
    (cr, cp, cy), (sr, sp, sy) = map(math.cos, halves), map(math.sin, halves)
    return mavlink.MAVLink_attitude_quaternion_message(
        report.time_boot_ms,
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        0.0,
        0.0,
        motion.turn_rate_rad_s,
    )


def vfr_hud(report: Report) -> MAVLink_message:
    """Airspeed, ground speed, whole degrees of heading, altitude, climb."""
    motion = report.motion
    return mavlink.MAVLink_vfr_hud_message(
        motion.airspeed_m_s,
        motion.ground_speed_m_s,
        round(math.degrees(motion.heading_rad)) % 360,
        0 if report.flight.phase == "standing" else CRUISE_THROTTLE_PERCENT,
        report.altitude_amsl_m,
        -motion.down_m_s,
    )


def wind(report: Report) -> MAVLink_message:
    """The autopilot's own, slowly converging estimate; the direction is the one it comes from."""
    north_m_s, east_m_s = report.flight.wind_estimate_m_s
    from_rad = wrap_to_two_pi(math.atan2(-east_m_s, -north_m_s))
    return mavlink.MAVLink_wind_message(
        math.degrees(from_rad), math.hypot(north_m_s, east_m_s), 0.0
    )


def local_position_ned(report: Report) -> MAVLink_message:
    """Position north and east of home, and below it; velocity over ground."""
    home, altitude_m = report.flight.home, report.altitude_amsl_m
    # At home's own height: z counts height, not the drop of the tangent plane with distance.
    east_m, north_m, _up_m = pymap3d.geodetic2enu(
        report.latitude_rad,
        report.longitude_rad,
        altitude_m,
        home.latitude_rad,
        home.longitude_rad,
        altitude_m,
        deg=False,
    )
    motion = report.motion
    return mavlink.MAVLink_local_position_ned_message(
        report.time_boot_ms,
        float(north_m),
        float(east_m),
        home.altitude_amsl_m - altitude_m,
        motion.north_m_s,
        motion.east_m_s,
        motion.down_m_s,
    )


def global_position_int(report: Report) -> MAVLink_message:
    """Position and ground velocity. `hdg` is the heading of the nose, not the course."""
    motion, altitude_m = report.motion, report.altitude_amsl_m
    return mavlink.MAVLink_global_position_int_message(
        report.time_boot_ms,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        millimetres(altitude_m),
        millimetres(altitude_m - report.flight.home.altitude_amsl_m),
        centimetres_per_second(motion.north_m_s),
        centimetres_per_second(motion.east_m_s),
        centimetres_per_second(motion.down_m_s),
        centidegrees(motion.heading_rad),
    )
