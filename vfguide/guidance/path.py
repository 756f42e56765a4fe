"""Paths: where the nearest point is, which way the path runs there, and how it curves.

The field needs no more than that, and so never learns which kind of path it steers along.
"""

import math
from dataclasses import dataclass
from typing import Generic, Literal, Protocol

from vfguide.elementwise import Number, atan2, clip, hypot, where
from vfguide.guidance.wind_triangle import resolve

Direction = Literal[1, -1]
"""Turning sense seen from above: 1 clockwise (the course increases), -1 counter-clockwise."""


@dataclass(frozen=True, slots=True)
class PathPoint(Generic[Number]):
    """The path at the point of it that is nearest to the vehicle."""

    course: Number
    """Course of the path, rad."""
    cross_track_error: Number
    """Distance of the vehicle from the path, m, positive right of the direction of travel."""
    curvature: Number
    """Curvature of the path, 1/m, positive where it turns clockwise."""


class Path(Protocol):
    """What the field asks of a path."""

    def nearest(self, north: Number, east: Number) -> PathPoint[Number]:
        """The path at its point nearest to (north, east) in metres."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A straight line without ends."""

    north: float
    """North of a point on the line, m."""
    east: float
    """East of the same point, m."""
    course: float
    """Direction of travel chi_p, rad."""

    def nearest(self, north: Number, east: Number) -> PathPoint[Number]:
        """The line abeam of the vehicle; the article's e is not a distance, this one is."""
        along, right = resolve(north - self.north, east - self.east, _like(self.course, north))
        still = along * 0.0
        return PathPoint(still + self.course, right, still)


@dataclass(frozen=True, slots=True, kw_only=True)
class Circle:
    """A circle flown in one sense."""

    north: float
    """North of the centre c, m."""
    east: float
    """East of the centre, m."""
    radius: float
    """Radius R, m, positive."""
    direction: Direction
    """lambda: 1 clockwise, -1 counter-clockwise."""

    def nearest(self, north: Number, east: Number) -> PathPoint[Number]:
        """The circle on the vehicle's bearing gamma; in the centre, whose bearing is none, due north."""
        north, east = north - self.north, east - self.east
        tangent, error = _around(north, east, self.radius, self.direction)
        return PathPoint(tangent, error, error * 0.0 + self.direction / self.radius)


@dataclass(frozen=True, slots=True, kw_only=True)
class Racetrack:
    """Two straight legs joined by half circles: a circle whose centre has been drawn out to an axis."""

    north: float
    """North of the centre of the figure, m."""
    east: float
    """East of the centre of the figure, m."""
    course: float
    """Course of the first leg, rad; the second runs the other way."""
    leg: float
    """Length of each leg, m, positive."""
    radius: float
    """Radius of the half circles, m; the legs are two radii apart."""
    direction: Direction
    """1 where the half circles turn clockwise."""

    def nearest(self, north: Number, east: Number) -> PathPoint[Number]:
        """The leg abeam of the vehicle, or beyond their ends the half circle on its bearing."""
        along, right = resolve(north - self.north, east - self.east, _like(self.course, north))
        on_axis = clip(along, -self.leg / 2.0, self.leg / 2.0)
        tangent, error = _around(along - on_axis, right, self.radius, self.direction)
        straight = abs(along) < self.leg / 2.0
        turning = error * 0.0 + self.direction / self.radius
        return PathPoint(self.course + tangent, error, where(straight, turning * 0.0, turning))


def _around(
    north: Number, east: Number, radius: float, direction: Direction
) -> tuple[Number, Number]:
    """(tangent course, cross-track error) on the circle of this radius about the origin."""
    tangent = atan2(east, north) + direction * (math.pi / 2.0)
    return tangent, (hypot(north, east) - radius) * -direction


def _like(value: float, other: Number) -> Number:
    """A constant in the shape of another value."""
    return other * 0.0 + value
