"""What guidance asks of a path: where its nearest point is, which way it runs there, and how it curves.

Nothing here or in the laws knows which kind of path it is. The paths themselves are in `vfguide.paths`.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, Self

import numpy as np

from vfguide.elementwise import FloatArray, Number

Direction = Literal[1, -1]
"""Turning sense seen from above: 1 clockwise (the course increases), -1 counter-clockwise."""

END_SHARE = 0.25
"""Of the last circle of a path that hands back: once the leader has flown it without a break it is proven."""


@dataclass(frozen=True, slots=True)
class PathPoint(Generic[Number]):
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
    """Of the path there, m above the mission's flying height."""
    slope: Number | float = 0.0
    """Rise for each metre along the ground, positive where it climbs."""


@dataclass(frozen=True, slots=True)
class PathPlace(Generic[Number]):
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
    """Its fields in a mission, a `PathShape`: with their units, bounds and defaults."""

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
