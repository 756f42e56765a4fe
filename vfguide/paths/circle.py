"""Circles, level and climbing."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from vfguide.elementwise import (
    FloatArray,
    Number,
    atan2,
    clip,
    cos,
    floor,
    hypot,
    isfinite,
    like,
    sin,
    where,
)
from vfguide.guidance.path import Direction, Path, PathPlace, PathPoint
from vfguide.mission import quantity
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Position
from vfguide.paths.climb import EASE_M, Climb, ClimbAngle, EndHeight, check_end, climb_of
from vfguide.registry import paths

Radius = Annotated[quantity.Number, Field(ge=1.0, le=100e3)]
"""Radius of a turn, m."""

Rotation = Literal["clockwise", "counterclockwise"]


def direction_of(rotation: Rotation) -> Direction:
    """Return lambda of a sense of rotation."""
    return 1 if rotation == "clockwise" else -1


class CircleShape(PathShape):
    """A circle flown round and round."""

    centre: Position
    """Centre of the circle."""

    radius_m: Radius
    """Radius, m."""

    direction: Rotation = "clockwise"
    """Sense of rotation seen from above."""


@paths.register("circle")
@dataclass(frozen=True, slots=True, kw_only=True)
class Circle(Path):
    """Circle flown in one sense.

    It begins at its point nearest to the origin, or due north of a centre at the origin.
    """

    Shape: ClassVar[type[CircleShape]] = CircleShape

    north: float
    """North coordinate of the centre c, m."""
    east: float
    """East coordinate of the centre c, m."""
    radius: float
    """Radius R, m, positive."""
    direction: Direction
    """lambda: 1 clockwise, -1 counter-clockwise."""

    @classmethod
    def of(cls, shape: CircleShape) -> Self:
        """Return the circle of a mission."""
        return cls(
            north=shape.centre.north_m,
            east=shape.centre.east_m,
            radius=shape.radius_m,
            direction=direction_of(shape.direction),
        )

    @property
    def length(self) -> float:
        """Circumference, m."""
        return 2.0 * math.pi * self.radius

    @property
    def first_bearing(self) -> float:
        """Bearing of the beginning from the centre, rad."""
        at_origin = self.north == 0.0 and self.east == 0.0
        return 0.0 if at_origin else math.atan2(-self.east, -self.north)

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the point on the vehicle's bearing gamma; from the centre, without a bearing, due north."""
        del course
        north, east = north - self.north, east - self.east
        tangent, error = around(north, east, self.radius, self.direction)
        turned = (tangent - math.pi / 2.0 * self.direction - self.first_bearing) * self.direction
        return PathPoint(
            tangent,
            error,
            error * 0.0 + self.direction / self.radius,
            self.radius * (turned % (2.0 * math.pi)),
        )

    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the circle at a distance (m) from its beginning."""
        bearing = self.first_bearing + self.direction * progress / self.radius
        return PathPlace(
            self.north + self.radius * cos(bearing),
            self.east + self.radius * sin(bearing),
            bearing + self.direction * (math.pi / 2.0),
            progress * 0.0 + self.direction / self.radius,
        )


def around(
    north: Number, east: Number, radius: float, direction: Direction
) -> tuple[Number, Number]:
    """Return (tangent course, cross-track error) on a circle of this radius about the origin."""
    tangent = atan2(east, north) + direction * (math.pi / 2.0)
    return tangent, (hypot(north, east) - radius) * -direction


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
    """Circle whose height changes with progress; the vehicle's height selects the turn.

    Beginning and course are the circle's. A vehicle that arrives low begins with the first turn.
    """

    Shape: ClassVar[type[HelixShape]] = HelixShape

    circle: Circle
    """Horizontal projection."""
    climb: Climb
    """Height by progress."""

    @classmethod
    def of(cls, shape: HelixShape) -> Self:
        """Return the helix of a mission."""
        return cls(circle=Circle.of(shape), climb=climb_of(shape.climb_deg, shape.end_height_m))

    @property
    def length(self) -> float:
        """Infinite: beyond its climb the helix continues as a circle."""
        return math.inf

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the nearest point on the turn at the flying height: the first."""
        return self.nearest_in_space(
            north, east, like(0.0, north) if course is None else course, 0.0
        )

    def nearest_in_space(
        self, north: Number, east: Number, course: Number, height: Number | float
    ) -> PathPoint[Number]:
        """Return the point on the turn whose height is nearest to the vehicle's, for NaN the first."""
        level = self.circle.nearest(north, east, course)
        measured = height + 0.0 * north
        known = where(isfinite(measured), measured, like(0.0, north))
        turn, climb = self.circle.length, self.climb
        # Progress at which the climb reaches the vehicle's height, then that on its bearing within half a
        # turn.
        reached = clip(known / climb.slope, 0.0, climb.run + EASE_M)
        turns = floor((reached - level.progress) / turn + 0.5)
        progress = level.progress + turns * turn
        # Beyond the climb all turns have one height: there the vehicle is on a level turn.
        here, _ = climb.at(progress)
        later, _ = climb.at(progress + turn)
        is_level = abs(later - known) < abs(here - known)
        progress = where(is_level, progress + turn, progress)
        height_there, slope = climb.at(progress)
        return PathPoint(
            level.course, level.cross_track_error, level.curvature, progress, height_there, slope
        )

    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the circle at a distance (m) from its beginning, with the height there."""
        place = self.circle.at(progress)
        height, slope = self.climb.at(progress)
        return PathPlace(place.north, place.east, place.course, place.curvature, height, slope)

    def outline(self, count: int) -> FloatArray:
        """Return progress values from the beginning to one round after the climb."""
        return np.linspace(0.0, self.climb.run + EASE_M + self.circle.length, count)
