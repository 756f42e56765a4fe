"""Interface of paths for guidance, and the vector field around a path.

Guidance asks a path for its nearest point, course and curvature there. Nothing here or in the laws depends on
the kind of path. The paths themselves are in `vfguide.paths`.

The field gives the course to fly at each point of the plane: Nelson, Barber, McLain, Beard: Vector Field Path
Following for Miniature Air Vehicles, IEEE Transactions on Robotics 23(3), 2007; the article's chi^d_l. The
article's printed line field is not the path's course on the path and diverges on one side; the forms here are
the convergent ones.
"""

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar, Generic, Literal, Self

import msgspec
import numpy as np

from vfguide.elementwise import FloatArray, Number

Direction = Literal[1, -1]
"""Turning sense seen from above: 1 clockwise (the course increases), -1 counter-clockwise."""

END_SHARE = 0.25
"""Share of a path's last circle that proves it, once the leader has flown it without a break."""


class PathPoint(msgspec.Struct, Generic[Number], frozen=True):
    """Point of the path nearest to the vehicle."""

    course: Number
    """Course of the path, rad."""
    cross_track_error: Number
    """Distance of the vehicle from the path, m, positive right of the direction of travel."""
    curvature: Number
    """Curvature of the path, 1/m, positive where it turns clockwise."""
    progress: Number
    """Distance of the point from the path's beginning along the path, m."""
    height: Number | float = 0.0
    """Height of the path, m above the mission's flying height."""
    slope: Number | float = 0.0
    """Rise per metre along the ground, positive where it climbs."""


class PathPlace(msgspec.Struct, Generic[Number], frozen=True):
    """Point of the path at a progress."""

    north: Number
    """North coordinate, m."""
    east: Number
    """East coordinate, m."""
    course: Number
    """Course of the path, rad."""
    curvature: Number
    """Curvature of the path, 1/m, positive where it turns clockwise."""
    height: Number | float = 0.0
    """m above the mission's flying height."""
    slope: Number | float = 0.0
    """Rise per metre along the ground, positive where it climbs."""


class Path(ABC):
    """Curve in the plane that a leader follows, closed or without end.

    A subclass with `@path("name")` is `path.type: name` in a mission, with the fields of its `Shape`.
    """

    __slots__ = ()

    name: ClassVar[str]
    """Name in a mission; set by `@path`."""

    Shape: ClassVar[type[Any]]
    """Fields of the path in a mission, a `PathShape` with units, bounds and defaults."""

    @classmethod
    @abstractmethod
    def of(cls, shape: Any) -> Self:  # noqa: ANN401 - each path has a section of its own
        """Return the path of a shape, an instance of `Shape`."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Length of one round, or to where it repeats, m; infinite for a path without end."""

    @property
    def last_circle(self) -> float | None:
        """Progress at which the final circle for the hand-back begins, m; None without one."""
        return None

    @abstractmethod
    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the path point nearest to a position (m); `course` (rad) selects the branch at crossings."""

    def nearest_in_space(
        self, north: Number, east: Number, course: Number, height: Number | float
    ) -> PathPoint[Number]:
        """Return the path point nearest to a position (m), where the height distinguishes branches.

        Course in rad; height in m above the mission's flying height, NaN where unknown.
        """
        del height
        return self.nearest(north, east, course)

    @abstractmethod
    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the path at a progress (m) over any number of rounds."""

    def outline(self, count: int) -> FloatArray:
        """Return progress values (m) for drawing the path and checking its turns; 0 if it has no end."""
        return np.linspace(0.0, self.length, count) if math.isfinite(self.length) else np.zeros(1)


NEAR_CENTRE = 0.05
"""Lower bound of 1 - curvature * error: within a twentieth of the radius of a centre of curvature, the
tangent turns faster than anything could follow, so its rate stops growing there."""


PATH_TURN_SHARE = 1.2
"""Largest turn rate of a leader while it joins a path, relative to the path's own."""


def desired_course(point: PathPoint[float], gain: float, approach_angle: float) -> float:
    """Return the course of the field, rad: chi^d = chi_p - chi_inf (2/pi) atan(k e).

    On a circle this is the article's gamma + lambda (pi/2 + atan(k (d - R))) when chi_inf is pi/2. The gain k
    (1/m) sets where the field begins to bend; `approach_angle` is chi_inf, the angle to the path far away,
    rad.
    """
    bend = approach_angle * (2.0 / math.pi) * math.atan(gain * point.cross_track_error)
    return point.course - bend


def desired_course_slope(error: float, gain: float, approach_angle: float) -> float:
    """Return d chi^d/de, rad/m: -chi_inf (2/pi) k / (1 + (k e)^2)."""
    scaled = gain * error
    return -approach_angle * (2.0 / math.pi) * gain / (1.0 + scaled * scaled)


def joining_turn_rate(point: PathPoint[float], ground_speed: float, least_radius: float) -> float:
    """Return the largest turn rate (rad/s) of a leader joining a path that its formation can follow.

    `least_radius` limits its turns, m; a tighter path is followed nevertheless. Ground speed in m/s.
    """
    tightest = PATH_TURN_SHARE * abs(point.curvature)
    return ground_speed * max(tightest, 1.0 / least_radius)


def tangent_rate_per_speed(point: PathPoint[float], course: float) -> float:
    """Return the turn rate of the nearest point's tangent per m/s of ground speed, rad/m.

    The nearest point moves along the path at V_g cos(chi - chi_p) / (1 - curvature e). On a circle the
    tangent then turns with the bearing, at (V_g / d) sin(chi - gamma).
    """
    shrink = max(1.0 - point.curvature * point.cross_track_error, NEAR_CENTRE)
    return point.curvature * math.cos(course - point.course) / shrink


def desired_course_rate_per_speed(
    point: PathPoint[float], course: float, gain: float, approach_angle: float
) -> float:
    """Return the observer's regressor phi, rad/m: the desired course changes at V_g phi.

    The article prints "d chi^d/d e . d e/d chi" for it.
    """
    slope = desired_course_slope(point.cross_track_error, gain, approach_angle)
    return tangent_rate_per_speed(point, course) + slope * math.sin(course - point.course)
