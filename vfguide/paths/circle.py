"""A circle flown round and round."""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

from pydantic import Field

from vfguide.elementwise import Number, atan2, cos, hypot, sin
from vfguide.guidance.path import Direction, Path, PathPlace, PathPoint
from vfguide.mission import quantity
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Position
from vfguide.registry import paths

Radius = Annotated[quantity.Number, Field(ge=1.0, le=100e3)]
"""Of a turn, m."""

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
        """Of its beginning from the centre, rad."""
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
