"""An autopilot's reports in MAVLink's units: motion, position and status.

Only this module knows these units. Heights above the ellipsoid and above mean sea level are equal here.
"""

import math
from collections.abc import Callable, Mapping

import msgspec
import pymap3d
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import EmulatedFlight
from sitl_stub.geometry import wrap_to_pi, wrap_to_two_pi
from sitl_stub.personality import Personality
from sitl_stub.sensors import Measurement

SATELLITES = 14

CRUISE_THROTTLE_PERCENT = 50
"""Reported for want of an engine model."""

CAPABILITIES = 0b1111
"""Position, velocity, acceleration, attitude and rates."""

POSITION_VARIANCE_M2 = 0.25

VELOCITY_VARIANCE_M2_S2 = 0.01
"""Reported variances, for want of an estimator."""

SENSORS = 0x10000027
"""Gyroscope, accelerometer, magnetometer, GPS and pre-arm check: what MAVSDK wants healthy."""

UNREADY = 0x10000020
"""GPS and pre-arm check, which are not healthy while the sensors settle."""

CELL_MILLIVOLTS, NO_CELL = 4100, 65_535

ESTIMATOR_FLYING = 0x33F
"""Bits of PX4's ESTIMATOR_STATUS in flight."""

EKF_FLYING = 0x33F
"""Bits of ArduPilot's EKF_STATUS_REPORT in the air: attitude, velocity, position and heights are good."""


class ReportedInstant(msgspec.Struct, frozen=True):
    """Common data of all messages of one instant, so that they agree."""

    time_boot_ms: int
    flight: EmulatedFlight
    config: AutopilotConfig
    measured: Measurement
    personality: Personality
    ready: bool
    """Whether the sensors have settled."""

    @property
    def altitude_amsl_m(self) -> float:
        """Altitude as measured."""
        return self.flight.state.altitude_amsl_m + self.measured.altitude_error_m


def centidegrees(angle_rad: float) -> int:
    """Convert an angle to hundredths of a degree, [0, 36000)."""
    return round(math.degrees(angle_rad) * 100.0) % 36_000


def centimetres_per_second(speed_m_s: float) -> int:
    """Convert a speed to cm/s, clamped to the field's 16 bits."""
    return max(-32_767, min(32_767, round(speed_m_s * 100.0)))


def degrees_e7(angle_rad: float) -> int:
    """Convert a latitude or longitude to 1e-7 degrees (11 mm)."""
    return round(math.degrees(angle_rad) * 1e7)


def millimetres(length_m: float) -> int:
    """Convert a height to mm, clamped to the field's 32 bits."""
    return max(-(2**31), min(2**31 - 1, round(length_m * 1000.0)))


def gps_raw_int(report: ReportedInstant) -> MAVLink_message:
    """Return the GPS receiver's report; it has a fix once the sensors have settled."""
    motion = report.measured.motion
    fix = mavlink.GPS_FIX_TYPE_3D_FIX if report.ready else mavlink.GPS_FIX_TYPE_NO_FIX
    return mavlink.MAVLink_gps_raw_int_message(
        report.time_boot_ms * 1000,
        fix,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
        millimetres(report.flight.state.altitude_amsl_m + report.measured.satellite_error_m),
        120,
        200,
        abs(centimetres_per_second(motion.ground_speed_m_s)),
        centidegrees(motion.course_rad),
        SATELLITES if report.ready else 0,
    )


def nav_controller_output(report: ReportedInstant) -> MAVLink_message:
    """Return the navigation report, in which only the roll and the course are known."""
    motion = report.measured.motion
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


def altitude(report: ReportedInstant) -> MAVLink_message:
    """Return PX4's heights: above mean sea level, and above home."""
    flight = report.flight
    amsl_m = report.altitude_amsl_m
    above_home_m = amsl_m - flight.home.altitude_amsl_m
    return mavlink.MAVLink_altitude_message(
        report.time_boot_ms * 1000, amsl_m, amsl_m, above_home_m, above_home_m, math.nan, math.nan
    )


def attitude(report: ReportedInstant) -> MAVLink_message:
    """Return the bank, yaw and yaw rate; pitch is the climb angle."""
    motion = report.measured.motion
    # The airspeed may be zero on the ground.
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


def attitude_quaternion(report: ReportedInstant) -> MAVLink_message:
    """Return ATTITUDE_QUATERNION: yaw, pitch, roll in that order, w first."""
    motion = report.measured.motion
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


def vfr_hud(report: ReportedInstant) -> MAVLink_message:
    """Return airspeed, ground speed, heading in whole degrees, altitude and climb rate."""
    motion = report.measured.motion
    return mavlink.MAVLink_vfr_hud_message(
        motion.airspeed_m_s,
        motion.ground_speed_m_s,
        round(math.degrees(motion.heading_rad)) % 360,
        0 if report.flight.phase == "standing" else CRUISE_THROTTLE_PERCENT,
        report.altitude_amsl_m,
        -motion.down_m_s,
    )


def wind(report: ReportedInstant) -> MAVLink_message:
    """Return the autopilot's slowly converging wind estimate; its direction is where the wind comes from."""
    north_m_s, east_m_s = report.flight.wind_estimate_m_s
    from_rad = wrap_to_two_pi(math.atan2(-east_m_s, -north_m_s))
    return mavlink.MAVLink_wind_message(
        math.degrees(from_rad), math.hypot(north_m_s, east_m_s), 0.0
    )


def local_position_ned(report: ReportedInstant) -> MAVLink_message:
    """Return the position north, east and down of home, and the ground velocity."""
    home, altitude_m = report.flight.home, report.altitude_amsl_m
    # At home's own height: z counts height, not the drop of the tangent plane with distance.
    east_m, north_m, _up_m = pymap3d.geodetic2enu(
        report.measured.latitude_rad,
        report.measured.longitude_rad,
        altitude_m,
        home.latitude_rad,
        home.longitude_rad,
        altitude_m,
        deg=False,
    )
    motion = report.measured.motion
    return mavlink.MAVLink_local_position_ned_message(
        report.time_boot_ms,
        float(north_m),
        float(east_m),
        home.altitude_amsl_m - altitude_m,
        motion.north_m_s,
        motion.east_m_s,
        motion.down_m_s,
    )


def global_position_int(report: ReportedInstant) -> MAVLink_message:
    """Return position and ground velocity; `hdg` is the heading of the nose, not the course."""
    motion, altitude_m = report.measured.motion, report.altitude_amsl_m
    return mavlink.MAVLink_global_position_int_message(
        report.time_boot_ms,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
        millimetres(altitude_m),
        millimetres(altitude_m - report.flight.home.altitude_amsl_m),
        centimetres_per_second(motion.north_m_s),
        centimetres_per_second(motion.east_m_s),
        centimetres_per_second(motion.down_m_s),
        centidegrees(motion.heading_rad),
    )


def global_position_int_cov(report: ReportedInstant) -> MAVLink_message:
    """Return position, velocity (m/s) and covariance; the time is in microseconds since boot."""
    motion, altitude_m = report.measured.motion, report.altitude_amsl_m
    covariance = [0.0] * 36
    for axis in range(3):
        covariance[7 * axis] = POSITION_VARIANCE_M2
        covariance[7 * (axis + 3)] = VELOCITY_VARIANCE_M2_S2
    return mavlink.MAVLink_global_position_int_cov_message(
        report.time_boot_ms * 1000,
        mavlink.MAV_ESTIMATOR_TYPE_GPS_INS,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
        millimetres(altitude_m),
        millimetres(altitude_m - report.flight.home.altitude_amsl_m),
        motion.north_m_s,
        motion.east_m_s,
        motion.down_m_s,
        covariance,
    )


def follow_target(report: ReportedInstant) -> MAVLink_message:
    """Return position, velocity and the turn's acceleration; the attitude has no roll and pitch."""
    motion = report.measured.motion
    half_yaw_rad = 0.5 * motion.heading_rad
    # Airspeed times turn rate, to the right of the nose.
    turning_m_s2 = motion.airspeed_m_s * motion.turn_rate_rad_s
    return mavlink.MAVLink_follow_target_message(
        report.time_boot_ms,
        CAPABILITIES,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
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


def high_latency2(report: ReportedInstant) -> MAVLink_message:
    """Return the summary for satellite links: whole metres of altitude, 2 degrees of heading, 0.2 m/s."""
    motion = report.measured.motion
    return mavlink.MAVLink_high_latency2_message(
        report.time_boot_ms,
        report.config.vehicle_type,
        report.personality.firmware,
        report.flight.mode.custom_mode & 0xFFFF,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
        max(-32_768, min(32_767, round(report.altitude_amsl_m))),
        0,
        round(math.degrees(motion.heading_rad) / 2.0) % 180,
        0,
        0,
        0,
        min(255, round(motion.airspeed_m_s * 5.0)),
        0,
        min(255, round(motion.ground_speed_m_s * 5.0)),
        *(0,) * 6,
        -1,
        *(0,) * 5,
    )


def adsb_vehicle(report: ReportedInstant) -> MAVLink_message:
    """Return the report of the aircraft's transponder: course over ground, cm/s, no time."""
    motion = report.measured.motion
    return mavlink.MAVLink_adsb_vehicle_message(
        report.config.icao_address,
        degrees_e7(report.measured.latitude_rad),
        degrees_e7(report.measured.longitude_rad),
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


def heartbeat(report: ReportedInstant) -> MAVLink_message:
    """Return the autopilot's type, mode, arming and status."""
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if report.flight.armed else 0
    return mavlink.MAVLink_heartbeat_message(
        report.config.vehicle_type,
        report.personality.firmware,
        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
        report.flight.mode.custom_mode,
        report.personality.system_status(report.flight),
        3,
    )


def system_time(report: ReportedInstant) -> MAVLink_message:
    """Return the time since boot; the date is unknown (0)."""
    return mavlink.MAVLink_system_time_message(0, report.time_boot_ms)


def sys_status(report: ReportedInstant) -> MAVLink_message:
    """Report all sensors present, enabled and, once settled, healthy; the battery is full."""
    healthy = SENSORS if report.ready else SENSORS & ~UNREADY
    return mavlink.MAVLink_sys_status_message(
        SENSORS, SENSORS, healthy, 0, 65_535, -1, 100, 0, 0, 0, 0, 0, 0
    )


def extended_sys_state(report: ReportedInstant) -> MAVLink_message:
    """Report the landed state and no VTOL."""
    landed = {
        "standing": mavlink.MAV_LANDED_STATE_ON_GROUND,
        "rolling": mavlink.MAV_LANDED_STATE_ON_GROUND,
        "climbing": mavlink.MAV_LANDED_STATE_TAKEOFF,
        "flying": mavlink.MAV_LANDED_STATE_IN_AIR,
    }
    return mavlink.MAVLink_extended_sys_state_message(
        mavlink.MAV_VTOL_STATE_UNDEFINED, landed[report.flight.phase]
    )


def battery_status(_report: ReportedInstant) -> MAVLink_message:
    """Report three full cells."""
    cells = (CELL_MILLIVOLTS,) * 3 + (NO_CELL,) * 7
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 32_767, cells, -1, -1, -1, 100)


def mission_current(_report: ReportedInstant) -> MAVLink_message:
    """Report that there is no mission."""
    return mavlink.MAVLink_mission_current_message(0)


def ekf_status_report(_report: ReportedInstant) -> MAVLink_message:
    """Report a healthy estimator of ArduPilot."""
    return mavlink.MAVLink_ekf_status_report_message(EKF_FLYING, 0.1, 0.1, 0.1, 0.1, 0.0)


def estimator_status(report: ReportedInstant) -> MAVLink_message:
    """Report a healthy estimator of PX4."""
    ratios = (0.1,) * 6
    return mavlink.MAVLink_estimator_status_message(
        report.time_boot_ms * 1000, ESTIMATOR_FLYING, *ratios, 0.3, 0.5
    )


def home_position(report: ReportedInstant) -> MAVLink_message:
    """Return the start position on the ground, which is also the origin of the local frame."""
    home = report.flight.home
    return mavlink.MAVLink_home_position_message(
        degrees_e7(home.latitude_rad),
        degrees_e7(home.longitude_rad),
        millimetres(home.altitude_amsl_m),
        0.0,
        0.0,
        0.0,
        (1.0, 0.0, 0.0, 0.0),
        0.0,
        0.0,
        0.0,
    )


def autopilot_version(report: ReportedInstant) -> MAVLink_message:
    """Return capabilities and the emulated firmware version; the hash identifies the emulator."""
    emulator = tuple(b"sitlstub")
    no_hash = (0,) * 8
    return mavlink.MAVLink_autopilot_version_message(
        report.personality.capabilities,
        report.personality.version,
        0,
        0,
        0,
        emulator,
        no_hash,
        no_hash,
        0,
        0,
        report.config.uid,
    )


Builder = Callable[[ReportedInstant], MAVLink_message]


def numbered(*builders: Builder) -> dict[int, Builder]:
    """Return the builders by message id; each has the name of its message."""
    return {getattr(mavlink, f"MAVLINK_MSG_ID_{one.__name__.upper()}"): one for one in builders}


TELEMETRY: Mapping[int, Builder] = numbered(
    heartbeat,
    system_time,
    sys_status,
    extended_sys_state,
    home_position,
    autopilot_version,
    gps_raw_int,
    battery_status,
    mission_current,
    ekf_status_report,
    estimator_status,
    nav_controller_output,
    altitude,
    wind,
    attitude_quaternion,
    attitude,
    vfr_hud,
    local_position_ned,
    high_latency2,
    adsb_vehicle,
    global_position_int_cov,
    follow_target,
    global_position_int,
)
"""Builders by message id, in the order of sending within one instant.

GLOBAL_POSITION_INT is last, so that a receiver that acts on a position already has the attitude and airspeed
of the same instant.
"""

POSITION_MESSAGES = frozenset(
    numbered(
        gps_raw_int,
        local_position_ned,
        high_latency2,
        adsb_vehicle,
        global_position_int_cov,
        follow_target,
        global_position_int,
    )
)
"""Messages that position noise affects."""
