"""Commands, arming, and replies that do not depend on the aircraft."""

import math
from collections.abc import Callable, Mapping
from enum import IntEnum

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from sitl_stub.flight import EmulatedFlight
from sitl_stub.loops import AltitudeTarget

AMSL_FRAMES = frozenset({0, 5})
"""MAV_FRAME_GLOBAL and its deprecated _INT duplicate: height above mean sea level."""

ABOVE_HOME_FRAMES = frozenset({3, 6})
"""MAV_FRAME_GLOBAL_RELATIVE_ALT and its deprecated _INT duplicate: height above home."""

CUSTOM_MODE_FLAG = 1
"""MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, without which a mode change is not understood."""

FORCED = 21196.0
"""Value of param2 that disarms in flight."""

FORCED_ARMING = 2989.0
"""Value of param2 that arms in spite of failed checks."""

MISSION_MESSAGES = (
    "MISSION_REQUEST_LIST",
    "MISSION_REQUEST",
    "MISSION_REQUEST_INT",
    "MISSION_COUNT",
    "MISSION_CLEAR_ALL",
)

LONGEST_TEXT = 50


class Result(IntEnum):
    """MAV_RESULT, in the common message set's numbers."""

    ACCEPTED = 0
    TEMPORARILY_REJECTED = 1
    DENIED = 2
    UNSUPPORTED = 3
    FAILED = 4
    COMMAND_INT_ONLY = 8


class SystemStatus(IntEnum):
    """MAV_STATE, in the common message set's numbers."""

    STANDBY = 3
    ACTIVE = 4
    CRITICAL = 5


class NonFiniteError(ValueError):
    """A required field holds NaN or infinity."""


def finite(*values: float) -> tuple[float, ...]:
    """Return the values after checking that all are finite.

    Raises:
        NonFiniteError: a value is not finite.
    """
    if all(map(math.isfinite, values)):
        return values
    raise NonFiniteError


class Command(msgspec.Struct, frozen=True):
    """One command; its position may be anything in commands that have none."""

    number: int
    """MAV_CMD."""

    parameters: tuple[float, float, float, float]
    """param1 to param4; may be NaN where a command does not use them."""

    frame: int
    """MAV_FRAME of the height `z`."""

    z: float
    latitude_deg: float = math.nan
    longitude_deg: float = math.nan
    is_int: bool = True
    """Whether it came as COMMAND_INT."""

    def used(self, *indices: int) -> tuple[float, ...]:
        """Return parameters by number (from 1) after checking that these are finite.

        Raises:
            NonFiniteError: one of them is not finite.
        """
        return finite(*(self.parameters[index - 1] for index in indices))


def command_of(message: MAVLink_message) -> Command:
    """Return the command in a COMMAND_INT or COMMAND_LONG.

    The long form has no frame: its height, param7, is above home as ArduPilot converts it.
    """
    parameters = (message.param1, message.param2, message.param3, message.param4)
    if message.get_type() == "COMMAND_INT":
        return Command(
            message.command,
            parameters,
            message.frame,
            message.z,
            message.x * 1e-7,
            message.y * 1e-7,
        )
    return Command(
        message.command,
        parameters,
        min(ABOVE_HOME_FRAMES),
        message.param7,
        message.param5,
        message.param6,
        is_int=False,
    )


Handler = Callable[[EmulatedFlight, Command], Result]
"""Executes a command; raises NonFiniteError before it changes anything."""

Handlers = Mapping[int, Handler]


def place(command: Command) -> tuple[float, float] | None:
    """Return a command's latitude and longitude in radians, or None where they cannot be flown to.

    Raises:
        NonFiniteError: they are not finite.
    """
    latitude_deg, longitude_deg = finite(command.latitude_deg, command.longitude_deg)
    if abs(latitude_deg) > 89.0 or abs(longitude_deg) > 180.0:
        return None
    return math.radians(latitude_deg), math.radians(longitude_deg)


def is_flyable_airspeed(flight: EmulatedFlight, airspeed_m_s: float) -> bool:
    """Check whether an airspeed is in the aircraft's range, to a single-precision rounding."""
    margin = 1e-6 * airspeed_m_s
    slowest_m_s, fastest_m_s = flight.airspeed_range_m_s
    return slowest_m_s - margin <= airspeed_m_s <= fastest_m_s + margin


def height_target(
    flight: EmulatedFlight, frame: int, z: float, max_climb_rate_m_s: float = math.inf
) -> AltitudeTarget | None:
    """Return the target for height `z` in a global frame, or None for other frames."""
    if frame in AMSL_FRAMES:
        return AltitudeTarget(z, max_climb_rate_m_s)
    if frame in ABOVE_HOME_FRAMES:
        return AltitudeTarget(flight.home.altitude_amsl_m + z, max_climb_rate_m_s)
    return None


class Arming:
    """MAV_CMD_COMPONENT_ARM_DISARM, for one autopilot."""

    def __init__(self, check: Callable[[EmulatedFlight], str | None], *, refused: Result) -> None:
        """Take a check, which returns why arming is refused or None, and the result of a refusal."""
        self.ready_from_us = 0
        """Simulation time at which the sensors have settled."""
        self._check = check
        self._refused = refused

    def is_ready(self, flight: EmulatedFlight) -> bool:
        """Check whether the sensors have settled."""
        return flight.time_us >= self.ready_from_us

    def fault(self, flight: EmulatedFlight) -> str | None:
        """Return why arming is refused now, or None."""
        if not self.is_ready(flight):
            return "Waiting for GPS and estimator"
        return self._check(flight)

    def handle(self, flight: EmulatedFlight, command: Command) -> Result:
        """Handle 400: param1 = 1 arms, 0 disarms; param2 forces it."""
        (wanted,) = command.used(1)
        if wanted == 1.0:
            return self._arm(flight, command)
        if wanted == 0.0:
            return self._disarm(flight, command)
        return Result.UNSUPPORTED

    def report(self, flight: EmulatedFlight, _command: Command) -> Result:
        """Handle 401: report why arming would be refused, without arming."""
        fault = self.fault(flight)
        if fault is not None:
            flight.texts.append(f"PreArm: {fault}")
        return Result.ACCEPTED

    def _arm(self, flight: EmulatedFlight, command: Command) -> Result:
        fault = self.fault(flight)
        if fault is not None and not flight.armed and command.parameters[1] != FORCED_ARMING:
            flight.texts.append(f"Arm: {fault}")
            return self._refused
        flight.set_armed(armed=True)
        return Result.ACCEPTED

    def _disarm(self, flight: EmulatedFlight, command: Command) -> Result:
        if flight.armed and not flight.on_ground and command.parameters[1] != FORCED:
            flight.texts.append("Disarming refused: in the air")
            return self._refused
        flight.set_armed(armed=False)
        return Result.ACCEPTED


def mission_reply(message: MAVLink_message) -> list[MAVLink_message]:
    """Report empty missions, fences and rally points, and refuse uploads for want of space."""
    to = (message.get_srcSystem(), message.get_srcComponent())
    kind = message.mission_type
    name = message.get_type()
    if name == "MISSION_REQUEST_LIST":
        return [mavlink.MAVLink_mission_count_message(*to, 0, kind)]
    if name == "MISSION_CLEAR_ALL" or (name == "MISSION_COUNT" and message.count == 0):
        result = mavlink.MAV_MISSION_ACCEPTED
    elif name == "MISSION_COUNT":
        result = mavlink.MAV_MISSION_NO_SPACE
    else:
        result = mavlink.MAV_MISSION_INVALID_SEQUENCE
    return [mavlink.MAVLink_mission_ack_message(*to, result, kind)]


def timesync_reply(message: MAVLink_message, boot_ns: int) -> list[MAVLink_message]:
    """Answer a request (tc1 = 0) with the time since boot in nanoseconds."""
    if message.tc1 != 0:
        return []
    return [mavlink.MAVLink_timesync_message(boot_ns, message.ts1)]


def ping_reply(message: MAVLink_message) -> list[MAVLink_message]:
    """Return a ping without a target to its sender."""
    if message.target_system or message.target_component:
        return []
    to = (message.get_srcSystem(), message.get_srcComponent())
    return [mavlink.MAVLink_ping_message(message.time_usec, message.seq, *to)]


def status_text(text: str) -> MAVLink_message:
    """Return a STATUSTEXT of severity INFO."""
    content = text.encode("ascii")[:LONGEST_TEXT]
    return mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_INFO, content)
