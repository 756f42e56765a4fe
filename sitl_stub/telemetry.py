"""What the autopilot reports: the numbers of the messages, and which is made by what."""

from collections.abc import Callable, Mapping

from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub import messages
from sitl_stub.messages import ReportedInstant

HEARTBEAT = 0
SYS_STATUS = 1
SYSTEM_TIME = 2
GPS_RAW_INT = 24
ATTITUDE = 30
ATTITUDE_QUATERNION = 31
LOCAL_POSITION_NED = 32
GLOBAL_POSITION_INT = 33
MISSION_CURRENT = 42
NAV_CONTROLLER_OUTPUT = 62
VFR_HUD = 74
GLOBAL_POSITION_INT_COV = 63
ALTITUDE = 141
FOLLOW_TARGET = 144
HIGH_LATENCY2 = 235
ADSB_VEHICLE = 246
BATTERY_STATUS = 147
AUTOPILOT_VERSION = 148
WIND = 168
EKF_STATUS_REPORT = 193
ESTIMATOR_STATUS = 230
HOME_POSITION = 242
EXTENDED_SYS_STATE = 245

ONCE_A_SECOND_US = 1_000_000
"""Interval of what ArduPilot sends without a request, and of PX4's heartbeat and slow messages."""


Builder = Callable[[ReportedInstant], MAVLink_message]


TELEMETRY: Mapping[int, Builder] = {
    HEARTBEAT: messages.heartbeat,
    SYSTEM_TIME: messages.system_time,
    SYS_STATUS: messages.sys_status,
    EXTENDED_SYS_STATE: messages.extended_sys_state,
    HOME_POSITION: messages.home_position,
    AUTOPILOT_VERSION: messages.autopilot_version,
    GPS_RAW_INT: messages.gps_raw_int,
    BATTERY_STATUS: messages.battery_status,
    MISSION_CURRENT: messages.mission_current,
    EKF_STATUS_REPORT: messages.ekf_status_report,
    ESTIMATOR_STATUS: messages.estimator_status,
    NAV_CONTROLLER_OUTPUT: messages.nav_controller_output,
    ALTITUDE: messages.altitude,
    WIND: messages.wind,
    ATTITUDE_QUATERNION: messages.attitude_quaternion,
    ATTITUDE: messages.attitude,
    VFR_HUD: messages.vfr_hud,
    LOCAL_POSITION_NED: messages.local_position_ned,
    HIGH_LATENCY2: messages.high_latency2,
    ADSB_VEHICLE: messages.adsb_vehicle,
    GLOBAL_POSITION_INT_COV: messages.global_position_int_cov,
    FOLLOW_TARGET: messages.follow_target,
    GLOBAL_POSITION_INT: messages.global_position_int,
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
