"""What PX4's parameters say: how the aircraft answers, and what does not fit a flight, in words.

Pure functions of the parameters' values. `px4.py` tells how a PX4 is steered, and what was measured of it.
"""

import math
from collections.abc import Mapping

from vfguide.guidance.creeping_speed import CreepingHold
from vfguide.mavlink.parameters import (
    AutopilotResponse,
    FlightNeeds,
    above_zero,
    airspeed_warnings,
    bank_warning,
    first_known,
)

NAMES = (
    *("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_DLL_EXCEPT", "COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
    *("FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_R_LIM", "FW_R_TC", "NPFG_PERIOD", "NPFG_DAMPING"),
    *("FW_T_TAS_TC", "FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX"),
    *("FW_T_CLMB_MAX", "FW_T_CLMB_R_SP", "FW_T_SINK_MAX", "FW_T_SINK_R_SP"),
)
"""The parameters that are asked for."""

SHORTEST_LOSS_S, LONGEST_LOSS_S = 0.5, 5.0
"""s: a stream at the autopilot's least rate has gaps of half a second; after five a formation is torn."""

RC_ACTIONS_THAT_DESCEND = {4: "lands where it is", 6: "ends the flight", 7: "disarms"}
"""Values of COM_OBL_RC_ACT after which nobody flies on."""

LINK_ACTIONS_THAT_DESCEND = {3: "lands where it is", 5: "ends the flight", 6: "disarms"}
"""Values of NAV_DLL_ACT after which nobody flies on."""

LONGEST_LINK_LOSS_S = 15.0
"""s: PX4's own default is 10."""

HOLD_BIT = 1 << 1
"""The bit of COM_DLL_EXCEPT for Guided Course and its like."""

ALPHA_SHARE = 0.3
"""How far the mission's alpha may be from what the parameters give."""

COURSE_DEAD_TIME_S = 0.2
"""s: formations were flown with this; no parameter tells it."""

UNTRIMMED = CreepingHold(share=0.6, time=70.0)
"""What of a new airspeed comes at once where throttles are not set, as measured."""

TRIMMED_BETA, UNTRIMMED_BETA = 3.0, 1.5
"""1/s: the betas of a total-energy hold with which formations were flown."""

LEAST_TIME_S, MOST_TIME_S = 1.5, 6.0
"""FW_T_TAS_TC: with 2 and with 5 the airspeed was measured, and answers nearly alike."""


def px4_warnings(
    parameters: Mapping[str, float], needs: FlightNeeds, stops_by: str | None
) -> list[str]:
    """One line for each parameter that does not fit; arguments as of `px4_faults`."""
    return [
        *px4_faults(parameters, needs, stops_by),
        *course_warning(parameters, needs),
        *throttle_warning(parameters),
    ]


def px4_faults(
    parameters: Mapping[str, float], needs: FlightNeeds, stops_by: str | None
) -> list[str]:
    """Parameters with which an aircraft should not take off: no fail-safe, or limits below the mission's.

    Args:
        parameters: those that were answered.
        needs: what the mission expects.
        stops_by: NAV_DLL_ACT or COM_OBL_RC_ACT, which acts when the companion falls silent; None: not known.
    """
    known = dict(parameters)
    return [
        *(link_loss_warnings(known) if stops_by != "COM_OBL_RC_ACT" else ()),
        *(stream_loss_warnings(known) if stops_by != "NAV_DLL_ACT" else ()),
        *airspeed_warnings(
            first_known(known, "FW_AIRSPD_MIN"), first_known(known, "FW_AIRSPD_MAX"), needs
        ),
        *bank_warning(first_known(known, "FW_R_LIM"), needs),
    ]


def px4_response(parameters: Mapping[str, float]) -> AutopilotResponse:
    """How the vehicle answers, and its limits."""
    known = dict(parameters)
    lowest, highest = known.get("FW_AIRSPD_MIN"), known.get("FW_AIRSPD_MAX")
    bank, roll = known.get("FW_R_LIM", 0.0), known.get("FW_R_TC", 0.0)
    alpha, beta = alpha_of(known), beta_of(known)
    creeps = beta is not None and not is_trimmed(known)
    return AutopilotResponse(
        alpha=alpha,
        beta=beta,
        airspeed_min=lowest,
        airspeed_max=highest,
        max_bank=math.radians(bank) if bank > 0.0 else None,
        climb_max=least_rate(known, "FW_T_CLMB_MAX", "FW_T_CLMB_R_SP"),
        sink_max=least_rate(known, "FW_T_SINK_MAX", "FW_T_SINK_R_SP"),
        course_dead_time=None if alpha is None else COURSE_DEAD_TIME_S,
        course_lag=roll if roll > 0.0 else None,
        # Of every PX4: it has no other.
        speed_hold="total-energy" if known else None,
        creeping_hold=UNTRIMMED if creeps else None,
    )


def alpha_of(parameters: Mapping[str, float]) -> float | None:
    """4 pi NPFG_DAMPING / NPFG_PERIOD, 1/s; None where they do not tell."""
    period_s, damping = parameters.get("NPFG_PERIOD", 0.0), parameters.get("NPFG_DAMPING", 0.0)
    return 4.0 * math.pi * damping / period_s if period_s > 0.0 and damping > 0.0 else None


def least_rate(parameters: Mapping[str, float], *names: str) -> float | None:
    """How fast the height goes to a new altitude, m/s: the lowest of these rates; None if none is known."""
    rates = (above_zero(parameters.get(name)) for name in names)
    return min((rate for rate in rates if rate is not None), default=None)


def beta_of(parameters: Mapping[str, float]) -> float | None:
    """Bandwidth of the airspeed hold, 1/s; None for parameters with which it was not measured."""
    trimmed = is_trimmed(parameters)
    if trimmed is None or not LEAST_TIME_S <= parameters.get("FW_T_TAS_TC", 0.0) <= MOST_TIME_S:
        return None
    return TRIMMED_BETA if trimmed else UNTRIMMED_BETA


def is_trimmed(parameters: Mapping[str, float]) -> bool | None:
    """Whether the throttle of every airspeed is known to the autopilot; None where it does not tell.

    That of FW_AIRSPD_MIN and of FW_AIRSPD_MAX are 0 where they are not: it then goes by FW_THR_TRIM at every
    airspeed, and finds the rest by an integral.
    """
    names = ("FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX")
    if any(name not in parameters for name in names):
        return None
    slowest, middle, fastest = (parameters[name] for name in names)
    return 0.0 < slowest < middle < fastest


def link_loss_warnings(parameters: Mapping[str, float]) -> list[str]:
    """What happens when the heartbeats stop of which PX4 takes notice in Guided Course."""
    value = parameters.get("NAV_DLL_ACT")
    if value is None:
        return []
    if value == 0.0:
        return [
            (
                "NAV_DLL_ACT is 0: should this companion fall silent, the aircraft flies its last course on"
                " for ever; 1 lets it loiter, 2 return"
            )
        ]
    warnings = []
    action = LINK_ACTIONS_THAT_DESCEND.get(round(value))
    if action is not None:
        warnings.append(
            f"NAV_DLL_ACT is {value:g}: when nothing is heard any more, the aircraft {action};"
            " 1 lets it loiter"
        )
    if int(parameters.get("COM_DLL_EXCEPT", 0.0)) & HOLD_BIT:
        warnings.append(
            f"COM_DLL_EXCEPT is {parameters['COM_DLL_EXCEPT']:g}: in Guided Course NAV_DLL_ACT does nothing,"
            " and the aircraft flies its last course on for ever; leave out 2"
        )
    after_s = parameters.get("COM_DL_LOSS_T", 0.0)
    if after_s > LONGEST_LINK_LOSS_S:
        warnings.append(
            f"COM_DL_LOSS_T is {after_s:g} s: should this companion fall silent, the aircraft flies its last"
            " course on for that long; 5 is enough"
        )
    return warnings


def stream_loss_warnings(parameters: Mapping[str, float]) -> list[str]:
    """What happens when the setpoints of offboard stop."""
    warnings = []
    after_s = parameters.get("COM_OF_LOSS_T")
    if after_s is not None and after_s < SHORTEST_LOSS_S:
        warnings.append(
            f"COM_OF_LOSS_T is {after_s:g} s: one late setpoint ends offboard; 1 s is what bears a"
            " telemetry radio"
        )
    if after_s is not None and after_s > LONGEST_LOSS_S:
        warnings.append(
            f"COM_OF_LOSS_T is {after_s:g} s: should this companion fall silent, the aircraft flies its"
            " last course on for that long; 1 s is enough"
        )
    value = parameters.get("COM_OBL_RC_ACT")
    if value == 0.0:
        warnings.append(
            "COM_OBL_RC_ACT is 0: when the setpoints stop, a pilot with a remote control has it at once, and"
            " without one it returns to its launch, as all others do; 5 lets it loiter"
        )
    action = None if value is None else RC_ACTIONS_THAT_DESCEND.get(round(value))
    if action is not None:
        warnings.append(
            f"COM_OBL_RC_ACT is {value:g}: when the setpoints stop, the aircraft {action}; 5 lets it loiter"
        )
    return warnings


def course_warning(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """NPFG decides how fast a course is taken up: alpha = 4 pi NPFG_DAMPING / NPFG_PERIOD."""
    alpha = alpha_of(parameters)
    if alpha is None or abs(alpha - needs.alpha) <= ALPHA_SHARE * needs.alpha:
        return []
    period_s, damping = parameters["NPFG_PERIOD"], parameters["NPFG_DAMPING"]
    return [
        (
            f"NPFG_PERIOD {period_s:g} s and NPFG_DAMPING {damping:g} give alpha {alpha:.2f} 1/s, and the"
            f" mission says {needs.alpha:g}: fly `vfguide identify` and take over what it finds"
        )
    ]


def throttle_warning(parameters: Mapping[str, float]) -> list[str]:
    """Without the throttles of its airspeeds a PX4 goes half way to a new one, and creeps on from there."""
    if is_trimmed(parameters) is not False:
        return []
    slowest, middle, fastest = (
        parameters[name] for name in ("FW_THR_ASPD_MIN", "FW_THR_TRIM", "FW_THR_ASPD_MAX")
    )
    return [
        (
            f"FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX are {slowest:g}, {middle:g} and {fastest:g}:"
            " half of a new airspeed comes within 2 s and the rest within a minute, which costs accuracy; set"
            " them to the throttles of level flight at FW_AIRSPD_MIN, FW_AIRSPD_TRIM and FW_AIRSPD_MAX, and"
            " FW_T_TAS_TC to 2"
        )
    ]
