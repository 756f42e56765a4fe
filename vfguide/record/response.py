"""Response of a vehicle to setpoints: as its companion flew it, or as its mission declares it.

A companion writes it as comma-separated values to `NAME.response.csv`, with a line for each change of the
response; the last one is final. A flight record holds it as an object in the description of the vehicle.
"""

from collections import deque
from pathlib import Path

import msgspec

from vfguide.record.archive import Figure
from vfguide.record.log import CompanionLog

SUFFIX = ".response.csv"
"""Suffix after the vehicle's name."""


class VehicleResponse(msgspec.Struct, frozen=True, kw_only=True):
    """Response of a vehicle's course and speed, and its slip; None for unknown values."""

    alpha_1_s: Figure | None = None
    """Bandwidth of the course hold, 1/s."""
    course_dead_time_s: Figure | None = None
    """Time from a course setpoint to the first response, s."""
    course_lag_s: Figure | None = None
    """Time constant of the turn rate, s."""
    course_spread: Figure | None = None
    """The true alpha lies within alpha / spread and alpha * spread."""
    beta_1_s: Figure | None = None
    """Bandwidth of the speed hold, 1/s."""
    speed_dead_time_s: Figure | None = None
    """Time from a speed setpoint to the first response, s."""
    speed_lag_s: Figure | None = None
    """Time constant of the acceleration, s."""
    speed_spread: Figure | None = None
    """The true beta lies within beta / spread and beta * spread."""
    slips: bool | None = None
    """Whether the vehicle turns less than its bank angle implies."""
    turn_efficiency: Figure | None = None
    """Turn rate as a fraction of that of a coordinated turn, as shown in flight."""
    max_bank_deg: Figure | None = None
    """Maximum bank angle, degrees."""


class TimedResponse(VehicleResponse, frozen=True, kw_only=True):
    """A response from a time on."""

    time_s: float
    """Time on the companion's own clock, s."""


RESPONSES = CompanionLog(TimedResponse, ("time_s", *VehicleResponse.__struct_fields__))


def read_response(*paths: Path) -> VehicleResponse | None:
    """Return the response by which a vehicle was last flown; None without any.

    The files are those of its starts in order. Complete lines of truncated files count.
    """
    newest = deque(RESPONSES.read(*paths), maxlen=1)
    if not newest:
        return None
    return msgspec.convert(newest[0], VehicleResponse, from_attributes=True)
