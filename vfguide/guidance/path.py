"""What guidance asks of a path, and the vector field around it.

Guidance asks where the nearest point is, which way the path runs there, and how it curves. Nothing here
or in the laws knows which kind of path it is. The paths themselves are in `vfguide.paths`.

The field says which course to fly at each point of the plane: Nelson, Barber, McLain, Beard: Vector Field
Path Following for Miniature Air Vehicles, IEEE Transactions on Robotics 23(3), 2007; the article's
chi^d_l. The article's printed line field is not the path's course on the path and points away from it on
one side; the forms here are the convergent ones.
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
"""Of the last circle of a path that hands back: once the leader has flown it without a break it is proven."""


class PathPoint(msgspec.Struct, Generic[Number], frozen=True):
    """The path at the point of it that is nearest to the vehicle."""

    course: Number
    """Course of the path, rad."""
    cross_track_error: Number
    """Distance of the vehicle from the path, m, positive right of the direction of travel."""
    curvature: Number
    """Curvature of the path, 1/m, positive where it turns clockwise."""
    progress: Number
    """How far along the path the point is, m from its beginning."""
    height: Number | float = 0.0
    """Height of the path there, m above the mission's flying height."""
    slope: Number | float = 0.0
    """Rise for each metre along the ground, positive where it climbs."""


class PathPlace(msgspec.Struct, Generic[Number], frozen=True):
    """A point of the path."""

    north: Number
    """m."""
    east: Number
    """m."""
    course: Number
    """Course of the path, rad."""
    curvature: Number
    """Curvature of the path, 1/m, positive where it turns clockwise."""
    height: Number | float = 0.0
    """m above the mission's flying height."""
    slope: Number | float = 0.0
    """Rise for each metre along the ground, positive where it climbs."""


class Path(ABC):
    """A curve in the plane that a leader follows, closed or without end.

    A subclass with `@path("name")` is known as `path.type: name`, with the fields of its `Shape` in the
    mission's `path:`.
    """

    __slots__ = ()

    name: ClassVar[str]
    """What a mission calls it; set by `@path`."""

    Shape: ClassVar[type[Any]]
    """The path's fields in a mission, a `PathShape`: with their units, bounds and defaults."""

    @classmethod
    @abstractmethod
    def of(cls, shape: Any) -> Self:  # noqa: ANN401 - each path has a section of its own
        """The path of this shape, an instance of `Shape`."""

    @property
    @abstractmethod
    def length(self) -> float:
        """Once round a closed path, or to where it goes round again, m; infinite for one without end."""

    @property
    def last_circle(self) -> float | None:
        """Progress from which it goes round a circle on which all are handed back, m; None without one."""
        return None

    @abstractmethod
    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """The path at its point nearest to a place.

        Args:
            north: m.
            east: m.
            course: of the vehicle, rad. Where the path crosses itself it tells which branch is meant.
        """

    def nearest_in_space(
        self, north: Number, east: Number, course: Number, height: Number | float
    ) -> PathPoint[Number]:
        """The path at its point nearest to a place, where the height tells its branches apart.

        Args:
            north: m.
            east: m.
            course: of the vehicle, rad.
            height: of the vehicle, m above the mission's flying height; NaN where it is not known.
        """
        del height
        return self.nearest(north, east, course)

    @abstractmethod
    def at(self, progress: Number) -> PathPlace[Number]:
        """The path at a progress (m), of any number of rounds."""

    def outline(self, count: int) -> FloatArray:
        """Values of the progress at which the path is looked at, m: to draw a closed one, and for its turns.

        One without end is looked at at its beginning, unless a subclass knows better.
        """
        return np.linspace(0.0, self.length, count) if math.isfinite(self.length) else np.zeros(1)


NEAR_CENTRE = 0.05
"""Least value of 1 - curvature * error: nearer to a centre of curvature than a twentieth of the radius, the
tangent turns faster than anything could follow, so its rate stops growing there."""


PATH_TURN_SHARE = 1.2
"""A leader that joins a path may turn by so much more than the path itself, to come onto it."""


def desired_course(point: PathPoint[float], gain: float, approach_angle: float) -> float:
    """Course of the field, rad: chi^d = chi_p - chi_inf (2/pi) atan(k e).

    On a circle this is the article's gamma + lambda (pi/2 + atan(k (d - R))) when chi_inf is pi/2.

    Args:
        point: the nearest point of the path.
        gain: k, 1/m: how far from the path the field begins to bend.
        approach_angle: chi_inf, rad: the angle to the path far away from it.
    """
    bend = approach_angle * (2.0 / math.pi) * math.atan(gain * point.cross_track_error)
    return point.course - bend


def desired_course_slope(error: float, gain: float, approach_angle: float) -> float:
    """Change of the desired course with the cross-track error, rad/m: -chi_inf (2/pi) k / (1 + (k e)^2)."""
    scaled = gain * error
    return -approach_angle * (2.0 / math.pi) * gain / (1.0 + scaled * scaled)


def joining_turn_rate(point: PathPoint[float], ground_speed: float, least_radius: float) -> float:
    """Greatest turn rate (rad/s) of a leader on its way onto a path: of turns that its formation can fly.

    Args:
        point: the nearest point of the path.
        ground_speed: of the leader, m/s.
        least_radius: of its turns, m; a path that turns tighter itself is followed.
    """
    tightest = PATH_TURN_SHARE * abs(point.curvature)
    return ground_speed * max(tightest, 1.0 / least_radius)


def tangent_rate_per_speed(point: PathPoint[float], course: float) -> float:
    """Turn rate of the nearest point's tangent for each m/s of ground speed, rad/m.

    The nearest point runs along the path at V_g cos(chi - chi_p) / (1 - curvature e); on a circle this
    makes the tangent turn with the bearing, at (V_g / d) sin(chi - gamma).
    """
    shrink = max(1.0 - point.curvature * point.cross_track_error, NEAR_CENTRE)
    return point.curvature * math.cos(course - point.course) / shrink


def desired_course_rate_per_speed(
    point: PathPoint[float], course: float, gain: float, approach_angle: float
) -> float:
    """Regressor phi = d(chi^d rate)/dV_g, rad/m: the rate of the desired course is V_g phi.

    The regressor of the ground-speed observer. The article prints "d chi^d/d e . d e/d chi" for it.
    """
    slope = desired_course_slope(point.cross_track_error, gain, approach_angle)
    return tangent_rate_per_speed(point, course) + slope * math.sin(course - point.course)
