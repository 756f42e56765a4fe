"""How the height of a path grows with its progress: level, a steady climb or descent, and level again."""

import math
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field
from pydantic_core import PydanticCustomError

from vfguide.elementwise import Number, clip
from vfguide.mission import quantity

EASE_M = 100.0
"""Way on which a profile bends from level to its slope: 5 s at 20 m/s, as autopilots change their climb."""

ClimbAngle = Annotated[quantity.Number, Field(ge=-30.0, le=30.0)]
"""Degrees over the ground, negative for a descent."""

EndHeight = Annotated[quantity.Number, Field(ge=-9000.0, le=9000.0)]
"""Above the mission's flying height, m."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Climb:
    """A profile that begins to climb at progress 0, from the mission's flying height."""

    slope: float
    """Rise for each metre along the ground."""
    end: float
    """Height at which it levels off, m above the flying height; infinite: never."""

    @property
    def run(self) -> float:
        """The way that the slope alone would take to the end, m; the profile takes `EASE_M` more."""
        return self.end / self.slope if self.slope != 0.0 else 0.0

    def at(self, progress: Number) -> tuple[Number, Number]:
        """(height in m above the flying height, slope) at a progress in m."""
        if self.slope == 0.0:
            return progress * 0.0, progress * 0.0
        half = 0.5 * min(EASE_M, self.run)
        height, slope = eased_ramp(progress - half, half)
        if math.isfinite(self.run):
            over, less = eased_ramp(progress - half - self.run, half)
            height, slope = height - over, slope - less
        return self.slope * height, self.slope * slope


LEVEL = Climb(slope=0.0, end=0.0)
"""No climb at all."""


def climb_of(climb_deg: float, end_m: float | None) -> Climb:
    """The profile of a mission's fields; without an end it climbs for ever."""
    if climb_deg == 0.0:
        return LEVEL
    slope = math.tan(math.radians(climb_deg))
    end = math.copysign(math.inf, slope) if end_m is None else end_m
    return Climb(slope=slope, end=end)


def check_end(climb_deg: float, end_m: float | None) -> None:
    """See that a climb leads to its end.

    Raises:
        PydanticCustomError: it leads away from it.
    """
    if end_m is not None and not climb_deg * end_m > 0.0:
        kind = "climb_end"
        message = "climb_deg leads away from end_height_m"
        raise PydanticCustomError(kind, message)


def eased_ramp(progress: Number, half: float) -> tuple[Number, Number]:
    """(ramp, its slope): 0 before 0, in proportion after it, with a parabola of `half` (m) on either side."""
    inside = clip(progress, -half, half) + half
    slope = inside / (2.0 * half)
    beyond = clip(progress - half, 0.0, math.inf)
    return 0.5 * inside * slope + beyond, slope
