"""Which autopilot speaks: by what its heartbeat says."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

NAMES = {
    mavlink.MAV_AUTOPILOT_GENERIC: "a generic autopilot",
    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "ArduPilot",
    mavlink.MAV_AUTOPILOT_PX4: "PX4",
}
"""What people call them."""


def autopilot_name(autopilot: int) -> str:
    """Name of a MAV_AUTOPILOT."""
    return NAMES.get(autopilot, f"autopilot number {autopilot}")


def other_autopilot(autopilot: int, expected: int) -> str | None:
    """None for the autopilot that is expected, or else what is wrong, in words."""
    if autopilot == expected:
        return None
    return (
        f"the mission says {autopilot_name(expected)} and the vehicle is {autopilot_name(autopilot)}:"
        " not steered; write `autopilot: auto`, or what it is"
    )
