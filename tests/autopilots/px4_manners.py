"""What a PX4 1.18 answers to whom steers it: one table for the real program and for the emulator.

Rows are asked in their order, of an aircraft that loiters at first.
"""

import math
from dataclasses import dataclass

NAN = math.nan
SET_MODE, REPOSITION = 176, 192
CHANGE_SPEED, CHANGE_ALTITUDE, GUIDED_CHANGE_HEADING = 178, 186, 43_002

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
"""MAV_RESULT."""


@dataclass(frozen=True, slots=True)
class Manner:
    """A command and the answer to it."""

    what: str
    """In words."""
    command: int
    parameters: tuple[float, ...]
    result: int


MANNERS = (
    Manner("a course outside Guided Course", GUIDED_CHANGE_HEADING, (0.0, 90.0), DENIED),
    Manner("offboard without a stream", SET_MODE, (1.0, 6.0, 0.0), TEMPORARILY_REJECTED),
    Manner("a mode that it does not have", SET_MODE, (1.0, 4.0, 30.0), TEMPORARILY_REJECTED),
    Manner("Guided Course", SET_MODE, (1.0, 4.0, 19.0), ACCEPTED),
    Manner("a course", GUIDED_CHANGE_HEADING, (0.0, 90.0), ACCEPTED),
    Manner("a course of no type", GUIDED_CHANGE_HEADING, (NAN, 90.0), DENIED),
    Manner("a heading", GUIDED_CHANGE_HEADING, (1.0, 90.0), DENIED),
    Manner("a course above 360", GUIDED_CHANGE_HEADING, (0.0, 400.0), ACCEPTED),
    Manner("a course below 0", GUIDED_CHANGE_HEADING, (0.0, -30.0), ACCEPTED),
    Manner("an airspeed", CHANGE_SPEED, (0.0, 15.0, -1.0), ACCEPTED),
    Manner("an airspeed out of range", CHANGE_SPEED, (0.0, 99.0, -1.0), ACCEPTED),
    Manner("an airspeed that is no number", CHANGE_SPEED, (0.0, NAN, -1.0), ACCEPTED),
    Manner("a ground speed", CHANGE_SPEED, (1.0, 15.0, -1.0), ACCEPTED),
    Manner("an altitude", CHANGE_ALTITUDE, (80.0, 0.0), ACCEPTED),
    Manner("hold", SET_MODE, (1.0, 4.0, 3.0), ACCEPTED),
)

PARAMETERS = {"COM_OBL_RC_ACT": 0, "COM_RCL_EXCEPT": 0, "NAV_DLL_ACT": 0, "COM_DL_LOSS_T": 10}
"""Whole numbers that decide what happens when a companion falls silent, as they come."""

VERSION = 0x01_12_00_80
CAPABILITIES = 59_647
