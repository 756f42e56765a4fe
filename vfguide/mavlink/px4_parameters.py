"""What in PX4's parameters does not fit a flight, in words: a pure function of their values."""

from collections.abc import Mapping

from vfguide.mavlink.parameters import FlightNeeds, airspeed_warnings, bank_warning, first_known

NAMES = ("COM_OF_LOSS_T", "COM_OBL_RC_ACT", "FW_AIRSPD_MIN", "FW_AIRSPD_MAX", "FW_R_LIM")
"""Those that matter here."""

SHORTEST_LOSS_S, LONGEST_LOSS_S = 0.5, 5.0
"""s: a stream at the autopilot's least rate has gaps of half a second; after five a formation is torn."""

RC_ACTIONS_THAT_DESCEND = {4: "lands where it is", 6: "ends the flight", 7: "disarms"}
"""Values of COM_OBL_RC_ACT after which nobody flies on."""


def px4_warnings(parameters: Mapping[str, float], needs: FlightNeeds) -> list[str]:
    """One line for each parameter that does not fit."""
    known = dict(parameters)
    return [
        *loss_warnings(known),
        *airspeed_warnings(
            first_known(known, "FW_AIRSPD_MIN"), first_known(known, "FW_AIRSPD_MAX"), needs
        ),
        *bank_warning(first_known(known, "FW_R_LIM"), needs),
    ]


def loss_warnings(parameters: Mapping[str, float]) -> list[str]:
    """What happens when the setpoints stop."""
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
    action = RC_ACTIONS_THAT_DESCEND.get(round(parameters.get("COM_OBL_RC_ACT", 0.0)))
    if action is not None:
        value = round(parameters["COM_OBL_RC_ACT"])
        warnings.append(
            f"COM_OBL_RC_ACT is {value}: when the setpoints stop, the aircraft {action}; 5 lets it loiter"
        )
    return warnings
