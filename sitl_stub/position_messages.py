"""Where the aircraft is, for others than its own companion: what a foreign leader can be heard by."""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.report import Report, centidegrees, degrees_e7, millimetres

CAPABILITIES = 0b1111
"""Position, velocity, acceleration, attitude and rates."""

POSITION_VARIANCE_M2 = 0.25
VELOCITY_VARIANCE_M2_S2 = 0.01
"""What is said of errors, for want of an estimator."""


def global_position_int_cov(report: Report) -> MAVLink_message:
    """Position, velocity and covariance: time since boot in microseconds, m/s."""
    motion, altitude_m = report.motion, report.altitude_amsl_m
    covariance = [0.0] * 36
    for axis in range(3):
        covariance[7 * axis] = POSITION_VARIANCE_M2
        covariance[7 * (axis + 3)] = VELOCITY_VARIANCE_M2_S2
    return mavlink.MAVLink_global_position_int_cov_message(
        report.time_boot_ms * 1000,
        mavlink.MAV_ESTIMATOR_TYPE_GPS_INS,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        millimetres(altitude_m),
        millimetres(altitude_m - report.flight.home.altitude_amsl_m),
        motion.north_m_s,
        motion.east_m_s,
        motion.down_m_s,
        covariance,
    )


def follow_target(report: Report) -> MAVLink_message:
    """Position, velocity and the acceleration of the turn; attitude without roll and pitch."""
    motion = report.motion
    half_yaw_rad = 0.5 * motion.heading_rad
    # Speed through the air times the rate at which it turns, to the right of the nose.
    turning_m_s2 = motion.airspeed_m_s * motion.turn_rate_rad_s
    return mavlink.MAVLink_follow_target_message(
        report.time_boot_ms,
        CAPABILITIES,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        report.altitude_amsl_m,
        [motion.north_m_s, motion.east_m_s, motion.down_m_s],
        [
            -turning_m_s2 * math.sin(motion.heading_rad),
            turning_m_s2 * math.cos(motion.heading_rad),
            0.0,
        ],
        [math.cos(half_yaw_rad), 0.0, 0.0, math.sin(half_yaw_rad)],
        [0.0, 0.0, motion.turn_rate_rad_s],
        [math.sqrt(POSITION_VARIANCE_M2)] * 3,
        0,
    )


def high_latency2(report: Report) -> MAVLink_message:
    """The summary for satellite links: whole metres of altitude, 2 degrees of heading, 0.2 m/s."""
    motion = report.motion
    return mavlink.MAVLink_high_latency2_message(
        report.time_boot_ms,
        mavlink.MAV_TYPE_FIXED_WING,
        report.personality.firmware,
        report.flight.mode.custom_mode & 0xFFFF,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        max(-32_768, min(32_767, round(report.altitude_amsl_m))),
        0,
        round(math.degrees(motion.heading_rad) / 2.0) % 180,
        0,
        0,
        0,
        min(255, round(motion.airspeed_m_s * 5.0)),
        0,
        min(255, round(motion.ground_speed_m_s * 5.0)),
        0,
        0,
        0,
        0,
        0,
        0,
        -1,
        0,
        0,
        0,
        0,
        0,
    )


def adsb_vehicle(report: Report) -> MAVLink_message:
    """What a receiver hears of its transponder: course over ground, cm/s, no time."""
    motion = report.motion
    return mavlink.MAVLink_adsb_vehicle_message(
        report.icao_address,
        degrees_e7(report.latitude_rad),
        degrees_e7(report.longitude_rad),
        mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        millimetres(report.altitude_amsl_m),
        centidegrees(motion.course_rad),
        min(65_535, round(motion.ground_speed_m_s * 100.0)),
        round(-motion.down_m_s * 100.0),
        b"EMULATED",
        mavlink.ADSB_EMITTER_TYPE_LIGHT,
        0,
        mavlink.ADSB_FLAGS_VALID_COORDS
        | mavlink.ADSB_FLAGS_VALID_ALTITUDE
        | mavlink.ADSB_FLAGS_VALID_HEADING
        | mavlink.ADSB_FLAGS_VALID_VELOCITY,
        0,
    )
