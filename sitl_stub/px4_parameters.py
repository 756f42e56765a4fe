"""PX4's parameters of a fixed wing, as far as they matter to who flies it from outside."""

import math

from sitl_stub.config import AutopilotConfig
from sitl_stub.parameters import Parameters, int32, real


def px4_parameters(config: AutopilotConfig) -> Parameters:
    """The parameters of an aircraft at its start."""
    plant = config.plant
    return Parameters(
        [
            real("FW_AIRSPD_MIN", plant.airspeed_min_m_s),
            real("FW_AIRSPD_MAX", plant.airspeed_max_m_s),
            real("FW_AIRSPD_TRIM", config.airspeed_m_s),
            real("FW_AIRSPD_STALL", 0.8 * plant.airspeed_min_m_s),
            real("FW_R_LIM", math.degrees(plant.max_bank_rad)),
            real("FW_R_TC", plant.roll_time_s),
            real("FW_P_TC", 0.4),
            real("FW_P_LIM_MAX", 30.0),
            real("FW_P_LIM_MIN", -30.0),
            real("FW_T_CLMB_MAX", plant.climb_rate_max_m_s),
            real("FW_T_SINK_MAX", plant.sink_rate_max_m_s),
            real("NPFG_PERIOD", 10.0),
            real("NPFG_DAMPING", 0.7),
            real("COM_OF_LOSS_T", 1.0),
            int32("COM_OBL_RC_ACT", 0),
            int32("COM_RC_IN_MODE", 1),
            int32("COM_DL_LOSS_T", 10),
            real("COM_DISARM_PRFLT", 10.0),
            real("COM_DISARM_LAND", 2.0),
            int32("COM_RCL_EXCEPT", 0),
            int32("COM_DLL_EXCEPT", 0),
            int32("COM_ARM_WO_GPS", 1),
            int32("NAV_DLL_ACT", 0),
            int32("NAV_RCL_ACT", 2),
            real("NAV_LOITER_RAD", 80.0),
            real("NAV_ACC_RAD", 10.0),
            real("MIS_TAKEOFF_ALT", 50.0),
            real("RTL_RETURN_ALT", 100.0),
            int32("RTL_TYPE", 0),
            int32("GF_ACTION", 2),
            int32("CBRK_SUPPLY_CHK", 0),
            int32("BAT1_N_CELLS", 3),
            int32("EKF2_GPS_CTRL", 7),
            int32("SYS_HAS_NUM_ASPD", 1),
            int32("SYS_AUTOSTART", 2100),
            int32("SYS_AUTOCONFIG", 0),
            int32("MAV_SYS_ID", config.system_id),
            int32("MAV_COMP_ID", 1),
            int32("MAV_TYPE", 1),
            int32("MAV_PROTO_VER", 0),
            int32("MAV_0_RATE", 1200),
        ],
        "bytewise",
    )
