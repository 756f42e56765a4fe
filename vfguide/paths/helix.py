"""A circle that climbs or descends as it goes round, up to a height where it goes on level."""

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from pydantic import model_validator

from vfguide.elementwise import FloatArray, Number, clip, floor, isfinite, like, where
from vfguide.guidance.path import Path, PathPlace, PathPoint
from vfguide.paths.circle import Circle, CircleShape
from vfguide.paths.climb import EASE_M, Climb, ClimbAngle, EndHeight, check_end, climb_of
from vfguide.registry import paths


class HelixShape(CircleShape):
    """A circle that climbs or descends as it goes round, up to a height where it goes on level."""

    climb_deg: ClimbAngle
    """Angle at which it climbs over the ground, degrees; negative descends."""

    end_height_m: EndHeight
    """Height at which it goes on as a circle, m above the mission's flying height; negative is below."""

    @model_validator(mode="after")
    def _leads_to_its_end(self) -> Self:
        check_end(self.climb_deg, self.end_height_m)
        return self


@paths.register("helix")
@dataclass(frozen=True, slots=True, kw_only=True)
class Helix(Path):
    """A circle whose height grows with the progress from its beginning; the vehicle's height tells the turn.

    Beginning and course are the circle's. Whoever comes to it low begins with its first turn.
    """

    Shape: ClassVar[type[HelixShape]] = HelixShape

    circle: Circle
    """Seen from above."""
    climb: Climb
    """Height by progress."""

    @classmethod
    def of(cls, shape: HelixShape) -> Self:
        """The helix of a mission."""
        return cls(circle=Circle.of(shape), climb=climb_of(shape.climb_deg, shape.end_height_m))

    @property
    def length(self) -> float:
        """It has no end: beyond its climb it goes round and round."""
        return math.inf

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """As on its first turn."""
        return self.nearest_in_space(
            north, east, like(0.0, north) if course is None else course, 0.0
        )

    def nearest_in_space(
        self, north: Number, east: Number, course: Number, height: Number | float
    ) -> PathPoint[Number]:
        """On the turn whose height is nearest to the vehicle's; on the first where that is not known."""
        level = self.circle.nearest(north, east, course)
        measured = height + 0.0 * north
        known = where(isfinite(measured), measured, like(0.0, north))
        turn, climb = self.circle.length, self.climb
        # The progress at which the climb reaches the vehicle's height, and the one within half a turn of it.
        reached = clip(known / climb.slope, 0.0, climb.run + EASE_M)
        turns = floor((reached - level.progress) / turn + 0.5)
        progress = level.progress + turns * turn
        # Beyond the climb all turns are at one height: there the vehicle is on the level ones.
        here, _ = climb.at(progress)
        later, _ = climb.at(progress + turn)
        is_level = abs(later - known) < abs(here - known)
        progress = where(is_level, progress + turn, progress)
        height_there, slope = climb.at(progress)
        return PathPoint(
            level.course,
            level.cross_track_error,
            level.curvature,
            progress,
            height_there,
            slope,
        )

    def at(self, progress: Number) -> PathPlace[Number]:
        """The circle at a distance from its beginning, and the height there."""
        place = self.circle.at(progress)
        height, slope = self.climb.at(progress)
        return PathPlace(place.north, place.east, place.course, place.curvature, height, slope)

    def outline(self, count: int) -> FloatArray:
        """From the beginning to once round after the climb."""
        return np.linspace(0.0, self.climb.run + EASE_M + self.circle.length, count)
