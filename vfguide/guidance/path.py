"""Paths: where the nearest point is, which way the path runs there, and how it curves.

The field needs no more than that, and so never learns which kind of path it steers along.
"""

import math
from dataclasses import dataclass
from typing import Generic, Literal, Protocol

from vfguide.elementwise import Number, atan2, clip, hypot, like, where
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
        along, right = resolve(north - self.north, east - self.east, like(self.course, north))
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
    """Two straight legs joined by half circles: a circle whose centre has been drawn out to an axis.

    Where leg and half circle meet the curvature jumps, and with it the motion of every slot: 40 m behind
    a leader that starts to turn at 0.13 rad/s, a rigid slot moves sideways at 5 m/s from one instant to
    the next. An easement spreads the jump: the curvature grows evenly along it, as on a railway, and
    the half circle lies inward by the shift that this takes, about easement²/(24 radius).
    """

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
    easement: float = 0.0
    """Length over which the curvature changes, m, half of it on the leg; at most leg and radius."""

    def nearest(self, north: Number, east: Number) -> PathPoint[Number]:
        """The leg abeam of the vehicle, or beyond their ends the half circle on its bearing."""
        along, right = resolve(north - self.north, east - self.east, like(self.course, north))
        beyond = along - clip(along, -self.leg / 2.0, self.leg / 2.0)
        tangent, error = _around(beyond, right, self.radius, self.direction)
        # Distance run since the nearest end of a leg; negative on the leg, before its end or after.
        on_leg = clip(abs(along) - self.leg / 2.0, -self.leg, 0.0)
        run = on_leg + self.radius * (math.pi / 2.0 - atan2(abs(right), abs(beyond)))
        entering = where(along * right * self.direction < 0.0, like(1.0, along), like(-1.0, along))
        lead, shift, curvature = self._eased(run)
        return PathPoint(
            tangent + self.course + lead * entering * self.direction,
            error - shift * self.direction,
            curvature * self.direction,
        )

    def _eased(self, run: Number) -> tuple[Number, Number, Number]:
        """(turn of the tangent, inward shift, curvature) that the easement adds at a distance from the end.

        The curvature rises linearly from 0 to that of the half circle; tangent and shift are its first and
        second integrals, less those of the jump that it replaces.
        """
        half = max(self.easement, LEAST_EASEMENT) / 2.0
        # sharpest half² / 6 with sharpest = 1 / (radius - full_shift): else the error jumps midway.
        full_shift = (self.radius - math.sqrt(self.radius**2 - half * half / 1.5)) / 2.0
        sharpest = 1.0 / (self.radius - full_shift)
        inside = clip(run, -half, half)
        to_edge = half - abs(inside)
        growth = sharpest * to_edge * to_edge / (4.0 * half)
        bump = growth * to_edge / 3.0
        shift = where(inside < 0.0, bump, full_shift - bump)
        return growth, shift, sharpest * (inside + half) / (2.0 * half)


LEAST_EASEMENT = 1e-3
"""m: without any easement the curvature would have no value at the very end of a leg."""


def _around(
    north: Number, east: Number, radius: float, direction: Direction
) -> tuple[Number, Number]:
    """(tangent course, cross-track error) on the circle of this radius about the origin."""
    tangent = atan2(east, north) + direction * (math.pi / 2.0)
    return tangent, (hypot(north, east) - radius) * -direction
