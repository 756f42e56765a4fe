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
    """Lambda of a sense of rotation."""
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
    """A circle flown in one sense.

    It begins where it is nearest to the origin, due north of a centre that is the origin itself.
    """

    Shape: ClassVar[type[CircleShape]] = CircleShape

    north: float
    """North of the centre c, m."""
    east: float
    """East of the centre, m."""
    radius: float
    """Radius R, m, positive."""
    direction: Direction
    """lambda: 1 clockwise, -1 counter-clockwise."""

    @classmethod
    def of(cls, shape: CircleShape) -> Self:
        """The circle of a mission."""
        return cls(
            north=shape.centre.north_m,
            east=shape.centre.east_m,
            radius=shape.radius_m,
            direction=direction_of(shape.direction),
        )

    @property
    def length(self) -> float:
        """Once round, m."""
        return 2.0 * math.pi * self.radius

    @property
    def first_bearing(self) -> float:
        """Bearing of its beginning from the centre, rad."""
        at_origin = self.north == 0.0 and self.east == 0.0
        return 0.0 if at_origin else math.atan2(-self.east, -self.north)

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """The circle on the vehicle's bearing gamma; in the centre, whose bearing is none, due north."""
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
        """The circle at a distance from its beginning."""
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
    """(tangent course, cross-track error) on the circle of this radius about the origin."""
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
