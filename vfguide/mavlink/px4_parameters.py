"""What in PX4's parameters does not fit a flight, in words: a pure function of their values."""

import math
from collections.abc import Mapping

from vfguide.mavlink.parameters import FlightNeeds, airspeed_warnings, bank_warning, first_known

NAMES = (
    *("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_DLL_EXCEPT", "COM_OF_LOSS_T", "COM_OBL_RC_ACT"),
    *("FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_R_LIM", "NPFG_PERIOD", "NPFG_DAMPING"),
)
"""Those that matter here."""

SHORTEST_LOSS_S, LONGEST_LOSS_S = 0.5, 5.0
"""s: a stream at the autopilot's least rate has gaps of half a second; after five a formation is torn."""

RC_ACTIONS_THAT_DESCEND = {4: "lands where it is", 6: "ends the flight", 7: "disarms"}
"""Values of COM_OBL_RC_ACT after which nobody flies on."""

LINK_ACTIONS_THAT_DESCEND = {3: "lands where it is", 5: "ends the flight", 6: "disarms"}
"""Values of NAV_DLL_ACT after which nobody flies on."""

LONGEST_LINK_LOSS_S = 15.0
"""s: PX4's own default is 10."""

HOLD_BIT = 1 << 1
"""Of COM_DLL_EXCEPT: Guided Course is among the modes of this bit."""

ALPHA_SHARE = 0.3
"""How far the mission's alpha may be from what the parameters give."""


def px4_warnings(
    parameters: Mapping[str, float], needs: FlightNeeds, stops_by: str | None
) -> list[str]:
    """One line for each parameter that does not fit.

    Args:
        parameters: those that were answered.
        needs: what the mission expects.
        stops_by: NAV_DLL_ACT or COM_OBL_RC_ACT, which acts when the companion falls silent; None: not known.
    """
    known = dict(parameters)
    return [
        *(link_loss_warnings(known) if stops_by != "COM_OBL_RC_ACT" else ()),
        *(stream_loss_warnings(known) if stops_by != "NAV_DLL_ACT" else ()),
        *course_warning(known, needs),
        *airspeed_warnings(
            first_known(known, "FW_AIRSPD_MIN"), first_known(known, "FW_AIRSPD_MAX"), needs
        ),
        *bank_warning(first_known(known, "FW_R_LIM"), needs),
    ]


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
    period_s, damping = parameters.get("NPFG_PERIOD"), parameters.get("NPFG_DAMPING")
    if period_s is None or damping is None or period_s <= 0.0:
        return []
    alpha = 4.0 * math.pi * damping / period_s
    if abs(alpha - needs.alpha) <= ALPHA_SHARE * needs.alpha:
        return []
    return [
        (
            f"NPFG_PERIOD {period_s:g} s and NPFG_DAMPING {damping:g} give alpha {alpha:.2f} 1/s, and the"
            f" mission says {needs.alpha:g}: fly `vfguide identify` and take over what it finds"
        )
    ]
