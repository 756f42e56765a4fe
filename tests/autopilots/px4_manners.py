"""How a PX4 1.18 behaves towards whom steers it: one list, for the real program and for the emulator.

Commands and behaviours are asked in their order, of an aircraft that loiters at first.
"""

import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

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


OFFBOARD, LOITER = (SET_MODE, 1.0, 6.0, 0.0), (SET_MODE, 1.0, 4.0, 3.0)

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

RATES_HZ = {
    "GLOBAL_POSITION_INT": 50.0,
    "ATTITUDE": 100.0,
    "LOCAL_POSITION_NED": 30.0,
    "VFR_HUD": 10.0,
}
"""What a companion is sent unasked."""

RATE_SHARE = 0.1
"""How far these may be off: the simulated clock runs at 0.96 to 0.99 of the computer's."""

STREAM_HZ = 10.0
"""Of setpoints."""


class Subject(Protocol):
    """A PX4 in the air, real or emulated, as its pilot and companion have it."""

    def result(self, command: int, *parameters: float) -> int:
        """What a command is answered with."""

    def send(self, message: MAVLink_message) -> None:
        """Send a message."""

    def pass_time(self, seconds: float) -> None:
        """Let time pass."""

    def course_deg(self) -> float:
        """Its true course, degrees."""

    def mode(self) -> tuple[int, int]:
        """Main and sub mode by its last heartbeat."""

    def texts(self) -> list[str]:
        """All that it has said by STATUSTEXT since it stood on the ground."""

    def parameter(self, name: str) -> float | None:
        """A parameter's field of a real number as it is sent; None where PARAM_ERROR is the answer."""

    def unasked_hz(self) -> Mapping[str, float]:
        """How often messages of `RATES_HZ` come on the companions' link."""

    @property
    def system_id(self) -> int:
        """Of the aircraft."""


@dataclass(frozen=True, slots=True)
class Behaviour:
    """Something that is done, and what is seen then."""

    what: str
    """In words."""
    seen: Callable[[Subject], object]
    expected: object


def whole_as_real(value: int) -> float:
    """A whole number as the field of a real one carries it: PX4 wants its bytes there."""
    real: float = struct.unpack("<f", struct.pack("<i", value))[0]
    return real


def position_at(subject: Subject, course_deg: float) -> MAVLink_message:
    """A point 100 km away: its bearing stays what it is."""
    course = math.radians(course_deg)
    north, east = 1e5 * math.cos(course), 1e5 * math.sin(course)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, subject.system_id, 1, 1, 0xDF8, north, east, -60.0, *(0.0,) * 8
    )


def velocity_at(subject: Subject, course_deg: float) -> MAVLink_message:
    """A velocity without a position."""
    course = math.radians(course_deg)
    north, east = 15.0 * math.cos(course), 15.0 * math.sin(course)
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, subject.system_id, 1, 1, 0xDC7, 0.0, 0.0, 0.0, north, east, *(0.0,) * 6
    )


def stream(subject: Subject, setpoint: MAVLink_message, seconds: float) -> None:
    """Send a setpoint again and again."""
    for _ in range(round(seconds * STREAM_HZ)):
        subject.send(setpoint)
        subject.pass_time(1.0 / STREAM_HZ)


def turned_deg(subject: Subject, before_deg: float) -> float:
    """By how much the course has changed, degrees."""
    return math.remainder(subject.course_deg() - before_deg, 360.0)


def velocity_does_not_steer(subject: Subject) -> object:
    """Offboard by a velocity across: (accepted, in offboard, turned by less than 10 degrees)."""
    # Out of a straight flight: a loiter's turn would take some seconds to end.
    subject.result(SET_MODE, 1.0, 4.0, 19.0)
    subject.result(GUIDED_CHANGE_HEADING, 0.0, 0.0)
    subject.pass_time(8.0)
    before_deg = subject.course_deg()
    setpoint = velocity_at(subject, before_deg + 90.0)
    stream(subject, setpoint, 1.0)
    result = subject.result(*OFFBOARD)
    stream(subject, setpoint, 6.0)
    return result, subject.mode(), abs(turned_deg(subject, before_deg)) < 10.0


def position_steers(subject: Subject) -> object:
    """Offboard goes on by positions: (still in it, flown toward within 3 degrees)."""
    wanted_deg = subject.course_deg() + 60.0
    stream(subject, position_at(subject, wanted_deg), 10.0)
    return subject.mode(), abs(turned_deg(subject, wanted_deg)) < 3.0


def position_is_a_stream(subject: Subject) -> object:
    """Offboard is entered on positions alone."""
    subject.result(*LOITER)
    subject.pass_time(1.0)
    stream(subject, position_at(subject, 0.0), 1.0)
    return subject.result(*OFFBOARD)


def stream_ends(action: int) -> Callable[[Subject], object]:
    """The mode 1 s and 3 s after the last setpoint of offboard, with this COM_OBL_RC_ACT."""

    def seen(subject: Subject) -> object:
        name, whole = b"COM_OBL_RC_ACT", mavlink.MAV_PARAM_TYPE_INT32
        sent = whole_as_real(action)
        system = subject.system_id
        subject.send(mavlink.MAVLink_param_set_message(system, 1, name, sent, whole))
        setpoint = position_at(subject, 0.0)
        stream(subject, setpoint, 1.0)
        subject.result(*OFFBOARD)
        stream(subject, setpoint, 1.0)
        subject.pass_time(0.9)
        soon = subject.mode()
        subject.pass_time(2.1)
        return soon, subject.mode()

    return seen


def unasked(subject: Subject) -> object:
    """Which messages come as often as they should."""
    found = subject.unasked_hz()
    return {name: abs(found[name] / hz - 1.0) <= RATE_SHARE for name, hz in RATES_HZ.items()}


BEHAVIOURS = (
    Behaviour(
        "it says nothing to a companion of its take-off", lambda subject: subject.texts(), []
    ),
    Behaviour("telemetry comes unasked", unasked, dict.fromkeys(RATES_HZ, True)),
    Behaviour("it banks by FW_R_LIM", lambda subject: subject.parameter("FW_R_LIM"), 50.0),
    Behaviour("an unknown parameter is an error", lambda subject: subject.parameter("NOPE"), None),
    Behaviour(
        "a velocity is accepted, and steers nothing",
        velocity_does_not_steer,
        (ACCEPTED, (6, 0), True),
    ),
    Behaviour("a position steers", position_steers, ((6, 0), True)),
    Behaviour("a position counts as the stream", position_is_a_stream, ACCEPTED),
    Behaviour("no stream, COM_OBL_RC_ACT 5: hold", stream_ends(5), ((6, 0), (4, 3))),
    Behaviour("no stream, COM_OBL_RC_ACT 0: return", stream_ends(0), ((6, 0), (4, 5))),
    Behaviour(
        "it says nothing to a companion of a lost stream", lambda subject: subject.texts(), []
    ),
)
