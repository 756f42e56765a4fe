"""What an autopilot reports, in SI units."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PositionReport:
    """GLOBAL_POSITION_INT."""

    boot_time_s: float
    """Of the autopilot's clock, s."""
    latitude_deg: float
    """degrees, north positive."""
    longitude_deg: float
    """degrees, east positive."""
    altitude_amsl: float
    """m above mean sea level."""
    velocity_north: float
    """Over ground, m/s."""
    velocity_east: float
    """Over ground, m/s."""
    heading: float | None
    """psi, rad: the message's hdg is yaw, not course. None where the autopilot does not know it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AirspeedReport:
    """VFR_HUD."""

    airspeed: float
    """m/s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HeartbeatReport:
    """HEARTBEAT of the autopilot."""

    autopilot: int
    """MAV_AUTOPILOT."""
    custom_mode: int
    """Mode, in the autopilot's own numbers."""
    armed: bool
    """Whether the motors are armed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandReport:
    """COMMAND_ACK."""

    command: int
    """MAV_CMD."""
    result: int
    """MAV_RESULT."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TextReport:
    """STATUSTEXT."""

    severity: int
    """MAV_SEVERITY."""
    text: str
    """What it says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterReport:
    """PARAM_VALUE."""

    name: str
    """Of the parameter."""
    value: float
    """The value field as a number: what ArduPilot means, and PX4 where the type is a real number."""
    whole: int | None
    """The value field's bytes as a whole number, where the type is one: what PX4 means then."""


Report = (
    PositionReport | AirspeedReport | HeartbeatReport | CommandReport | TextReport | ParameterReport
)
