"""MAVLink without sockets: reports from autopilots, and commands to them. See docs/own-autopilot.md."""

from vfguide.mavlink.adapter import (
    AutopilotAdapter,
    AutopilotSetpoint,
    autopilot,
    command_int,
    command_long,
    compass_degrees,
    set_mode,
    telemetry_at,
)

__all__ = [
    "AutopilotAdapter",
    "AutopilotSetpoint",
    "autopilot",
    "command_int",
    "command_long",
    "compass_degrees",
    "set_mode",
    "telemetry_at",
]
