"""ArduPlane's parameters, as far as they matter to who flies it from outside; names and types of 4.7."""

import math
from collections.abc import Mapping

from sitl_stub.config import AutopilotConfig
from sitl_stub.loops import GRAVITY_M_S2
from sitl_stub.parameters import (
    Parameter,
    Parameters,
    int8,
    int16,
    int32,
    real,
    whole_if_possible,
)

OLD_NAMES: Mapping[str, tuple[str, float]] = {
    "AIRSPEED_MIN": ("ARSPD_FBW_MIN", 1.0),
    "AIRSPEED_MAX": ("ARSPD_FBW_MAX", 1.0),
    "AIRSPEED_CRUISE": ("TRIM_ARSPD_CM", 100.0),
    "ROLL_LIMIT_DEG": ("LIM_ROLL_CD", 100.0),
    "PTCH_LIM_MAX_DEG": ("LIM_PITCH_MAX", 100.0),
    "PTCH_LIM_MIN_DEG": ("LIM_PITCH_MIN", 100.0),
    "RTL_ALTITUDE": ("ALT_HOLD_RTL", 100.0),
    "MAV_GCS_SYSID": ("SYSID_MYGCS", 1.0),
    "MAV_SYSID": ("SYSID_THISMAV", 1.0),
}
"""Name before 4.5 (the last two: before 4.7) and how many of its units make one of today's."""

SETTLED_LOOP_RATE_HZ = 200
"""SCHED_LOOP_RATE where the emulator is told none: its telemetry is on time anyway."""


def arduplane_parameters(config: AutopilotConfig) -> Parameters:
    """The parameters of an aircraft at its start."""
    parameters = described(config)
    if config.old_parameter_names:
        parameters = [renamed(one) for one in parameters]
    return Parameters(parameters, "cast")


def renamed(parameter: Parameter) -> Parameter:
    """The parameter by the name and in the unit of old."""
    name, factor = OLD_NAMES.get(parameter.name, (parameter.name, 1.0))
    if name == parameter.name:
        return parameter
    return whole_if_possible(name, factor * parameter.default)


def described(config: AutopilotConfig) -> list[Parameter]:
    """Every parameter by today's name."""
    plant = config.plant
    return [
        whole_if_possible("AIRSPEED_MIN", plant.airspeed_min_m_s),
        whole_if_possible("AIRSPEED_MAX", plant.airspeed_max_m_s),
        real("AIRSPEED_CRUISE", config.airspeed_m_s),
        real("AIRSPEED_STALL", 0.0),
        real("GUIDED_P", guided_p(config)),
        real("GUIDED_I", 0.0),
        real("GUIDED_D", 0.0),
        real("ROLL_LIMIT_DEG", math.degrees(plant.max_bank_rad)),
        real("PTCH_LIM_MAX_DEG", 20.0),
        real("PTCH_LIM_MIN_DEG", -25.0),
        real("RLL2SRV_TCONST", plant.roll_time_s),
        real("NAVL1_PERIOD", 17.0),
        real("NAVL1_DAMPING", 0.75),
        real("TECS_CLMB_MAX", plant.climb_rate_max_m_s),
        real("TECS_SINK_MAX", plant.climb_rate_max_m_s),
        real("TECS_TIME_CONST", 5.0),
        real("TECS_SPDWEIGHT", 1.0),
        int16("SCHED_LOOP_RATE", round(config.loop_rate_hz or SETTLED_LOOP_RATE_HZ)),
        int8("FS_GCS_ENABL", 0),
        int8("FS_SHORT_ACTN", 0),
        real("FS_SHORT_TIMEOUT", 1.5),
        int8("FS_LONG_ACTN", 0),
        real("FS_LONG_TIMEOUT", 5.0),
        int8("THR_FAILSAFE", 1),
        int16("MAV_GCS_SYSID", 255),
        int16("MAV_SYSID", config.system_id),
        int8("ARMING_REQUIRE", 1),
        int32("ARMING_SKIPCHK", 0),
        int8("ARSPD_TYPE", 1),
        int8("ARSPD_USE", 1),
        real("ARSPD_RATIO", 2.0),
        real("TKOFF_ALT", 50.0),
        real("TKOFF_DIST", 200.0),
        int16("WP_LOITER_RAD", 80),
        int16("WP_RADIUS", 90),
        real("RTL_ALTITUDE", 100.0),
        int16("RTL_RADIUS", 0),
        int8("FENCE_ENABLE", 0),
        int8("FENCE_TOTAL", 0),
        int16("MIS_TOTAL", 0),
        int8("RALLY_TOTAL", 0),
        int8("INITIAL_MODE", 0),
        *(int8(f"FLTMODE{number}", mode) for number, mode in enumerate((11, 11, 5, 5, 0, 0), 1)),
        int8("AHRS_EKF_TYPE", 3),
        int8("EK3_ENABLE", 1),
        int8("BATT_MONITOR", 0),
        int8("COMPASS_USE", 1),
        int8("GPS1_TYPE", 1),
        int16("FORMAT_VERSION", 13),
        int16("STAT_BOOTCNT", 1),
        int8("TRIM_THROTTLE", 45),
        int8("THR_MAX", 100),
    ]


def guided_p(config: AutopilotConfig) -> float:
    """As flown by the bank plant; else the bank per course error that gives the plant's alpha."""
    plant = config.plant
    if plant.banks:
        return plant.guided_p_cdeg_rad
    middle_speed_m_s = 0.5 * (plant.airspeed_min_m_s + plant.airspeed_max_m_s)
    return round(100.0 * math.degrees(plant.alpha_1_s * middle_speed_m_s / GRAVITY_M_S2))
