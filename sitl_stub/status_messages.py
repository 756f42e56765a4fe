"""How the autopilot is: mode, health, battery, home, version."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.report import Report, degrees_e7, millimetres

SENSORS = 0x10000027
"""Gyroscope, accelerometer, magnetometer, GPS and pre-arm check: what MAVSDK wants healthy."""

UNREADY = 0x10000020
"""Those that are not healthy yet while sensors settle: GPS and pre-arm check."""

CELL_MILLIVOLTS, NO_CELL = 4100, 65_535
ESTIMATOR_FLYING = 0x33F
"""The same bits of PX4's."""

EKF_FLYING = 0x33F
"""Attitude, velocity, position and heights are good: what ArduPilot reports in the air."""


def heartbeat(report: Report) -> MAVLink_message:
    """Who this is, the mode, whether armed."""
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if report.flight.armed else 0
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_FIXED_WING,
        report.personality.firmware,
        mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED | armed,
        report.flight.mode.custom_mode,
        report.personality.system_status(report.flight),
        3,
    )


def system_time(report: Report) -> MAVLink_message:
    """Time since boot; the date is unknown (0)."""
    return mavlink.MAVLink_system_time_message(0, report.time_boot_ms)


def sys_status(report: Report) -> MAVLink_message:
    """All sensors present, enabled and, once settled, healthy; a full battery."""
    healthy = SENSORS if report.ready else SENSORS & ~UNREADY
    return mavlink.MAVLink_sys_status_message(
        SENSORS, SENSORS, healthy, 0, 65_535, -1, 100, 0, 0, 0, 0, 0, 0
    )


def extended_sys_state(report: Report) -> MAVLink_message:
    """No VTOL; where it is between ground and air."""
    landed = {
        "standing": mavlink.MAV_LANDED_STATE_ON_GROUND,
        "rolling": mavlink.MAV_LANDED_STATE_ON_GROUND,
        "climbing": mavlink.MAV_LANDED_STATE_TAKEOFF,
        "flying": mavlink.MAV_LANDED_STATE_IN_AIR,
    }
    return mavlink.MAVLink_extended_sys_state_message(
        mavlink.MAV_VTOL_STATE_UNDEFINED, landed[report.flight.phase]
    )


def battery_status(_report: Report) -> MAVLink_message:
    """Three full cells."""
    cells = (CELL_MILLIVOLTS,) * 3 + (NO_CELL,) * 7
    return mavlink.MAVLink_battery_status_message(0, 0, 0, 32_767, cells, -1, -1, -1, 100)


def mission_current(_report: Report) -> MAVLink_message:
    """There is no mission."""
    return mavlink.MAVLink_mission_current_message(0)


def ekf_status_report(_report: Report) -> MAVLink_message:
    """ArduPilot's estimator is content."""
    return mavlink.MAVLink_ekf_status_report_message(EKF_FLYING, 0.1, 0.1, 0.1, 0.1, 0.0)


def estimator_status(report: Report) -> MAVLink_message:
    """PX4's estimator is content."""
    ratios = (0.1,) * 6
    return mavlink.MAVLink_estimator_status_message(
        report.time_boot_ms * 1000, ESTIMATOR_FLYING, *ratios, 0.3, 0.5
    )


def home_position(report: Report) -> MAVLink_message:
    """The start position on the ground, which is the origin of the local frame too."""
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


def autopilot_version(report: Report) -> MAVLink_message:
    """What it can do, and the version whose manners it has; the hash tells that it is none of theirs."""
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
        0,
    )
