"""What the autopilot reports: which message is made by what."""

from collections.abc import Callable, Mapping

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import motion_messages as motion
from sitl_stub import position_messages as position
from sitl_stub import status_messages as status
from sitl_stub.report import Report
from sitl_stub.telemetry_ids import (
    ADSB_VEHICLE,
    ALTITUDE,
    ATTITUDE,
    ATTITUDE_QUATERNION,
    AUTOPILOT_VERSION,
    BATTERY_STATUS,
    EKF_STATUS_REPORT,
    ESTIMATOR_STATUS,
    EXTENDED_SYS_STATE,
    FOLLOW_TARGET,
    GLOBAL_POSITION_INT,
    GLOBAL_POSITION_INT_COV,
    GPS_RAW_INT,
    HEARTBEAT,
    HIGH_LATENCY2,
    HOME_POSITION,
    LOCAL_POSITION_NED,
    MISSION_CURRENT,
    NAV_CONTROLLER_OUTPUT,
    SYS_STATUS,
    SYSTEM_TIME,
    VFR_HUD,
    WIND,
)

Builder = Callable[[Report], MAVLink_message]


TELEMETRY: Mapping[int, Builder] = {
    HEARTBEAT: status.heartbeat,
    SYSTEM_TIME: status.system_time,
    SYS_STATUS: status.sys_status,
    EXTENDED_SYS_STATE: status.extended_sys_state,
    HOME_POSITION: status.home_position,
    AUTOPILOT_VERSION: status.autopilot_version,
    GPS_RAW_INT: motion.gps_raw_int,
    BATTERY_STATUS: status.battery_status,
    MISSION_CURRENT: status.mission_current,
    EKF_STATUS_REPORT: status.ekf_status_report,
    ESTIMATOR_STATUS: status.estimator_status,
    NAV_CONTROLLER_OUTPUT: motion.nav_controller_output,
    ALTITUDE: motion.altitude,
    WIND: motion.wind,
    ATTITUDE_QUATERNION: motion.attitude_quaternion,
    ATTITUDE: motion.attitude,
    VFR_HUD: motion.vfr_hud,
    LOCAL_POSITION_NED: motion.local_position_ned,
    HIGH_LATENCY2: position.high_latency2,
    ADSB_VEHICLE: position.adsb_vehicle,
    GLOBAL_POSITION_INT_COV: position.global_position_int_cov,
    FOLLOW_TARGET: position.follow_target,
    GLOBAL_POSITION_INT: motion.global_position_int,
}
"""Builders by message id, in the order of sending within one instant: GLOBAL_POSITION_INT last, so
that a receiver which acts on a position already has the attitude and airspeed of the same instant."""

POSITION_MESSAGES = frozenset(
    {
        GPS_RAW_INT,
        LOCAL_POSITION_NED,
        HIGH_LATENCY2,
        ADSB_VEHICLE,
        GLOBAL_POSITION_INT_COV,
        FOLLOW_TARGET,
        GLOBAL_POSITION_INT,
    }
)
"""The messages that position noise enters."""
