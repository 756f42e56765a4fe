"""How a vehicle answered: as its companion flew it, or as its mission declares it.

Beside a companion's other logs it is a file of comma-separated values, `NAME.response.csv`, with a line for
each time that another response was flown by; the last one is how the vehicle was finally flown. In a flight
record it is an object in the description of the vehicle.
"""

from collections import deque
from pathlib import Path

import msgspec

from vfguide.record.archive import Figure
from vfguide.record.log import CompanionLog

SUFFIX = ".response.csv"
"""Follows the vehicle's name."""


class VehicleResponse(msgspec.Struct, frozen=True, kw_only=True):
    """How course and speed of a vehicle answer, and whether it slips; None for what nobody said."""

    alpha_1_s: Figure | None = None
    """Bandwidth of the course hold, 1/s."""
    course_dead_time_s: Figure | None = None
    """From a course to the first answer, s."""
    course_lag_s: Figure | None = None
    """Time constant with which the turn then follows, s."""
    course_spread: Figure | None = None
    """The true alpha lies within alpha / spread and alpha * spread."""
    beta_1_s: Figure | None = None
    """Bandwidth of the speed hold, 1/s."""
    speed_dead_time_s: Figure | None = None
    """From a speed to the first answer, s."""
    speed_lag_s: Figure | None = None
    """Time constant with which the acceleration then follows, s."""
    speed_spread: Figure | None = None
    """The true beta lies within beta / spread and beta * spread."""
    slips: bool | None = None
    """Whether it turns less than its bank says."""
    turn_efficiency: Figure | None = None
    """What it turns of that, where flight has shown it."""
    max_bank_deg: Figure | None = None
    """How far it banks, degrees."""


class TimedResponse(VehicleResponse, frozen=True, kw_only=True):
    """A response, and since when it is flown by."""

    time_s: float
    """On the companion's own clock, s."""


RESPONSES = CompanionLog(TimedResponse, ("time_s", *VehicleResponse.__struct_fields__))


def read_response(*paths: Path) -> VehicleResponse | None:
    """Return what a vehicle was flown by last; None where no file tells it.

    Args:
        paths: files of its starts in their order; of one that is cut off the whole lines count.
    """
    newest = deque(RESPONSES.read(*paths), maxlen=1)
    if not newest:
        return None
    return msgspec.convert(newest[0], VehicleResponse, from_attributes=True)
