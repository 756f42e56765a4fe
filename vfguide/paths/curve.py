"""A closed curve of any shape, by its points: what a path of one's own is usually made of.

The curve is looked at once, at the start: points a metre or so apart, with the course and the curvature of a
periodic cubic spline through them. The nearest point is then found by a k-d tree of places and courses, so
that a place where the curve crosses itself belongs to the branch that the vehicle flies along, and from there
by going along the curve until it is abeam.
"""

import math
from abc import abstractmethod
from typing import Any, Self

import numpy as np

from vfguide.elementwise import FloatArray, Number
from vfguide.errors import InputError, described_error
from vfguide.guidance.path import Path, PathPlace, PathPoint

SPACING_M = 1.0
"""Between the points that a curve is known by."""

FEWEST_POINTS, MOST_POINTS = 400, 100_000

TRACED_POINTS = 4
"""Points that are traced for each one that is kept."""

COURSE_M = 100.0
"""m: a branch that runs the other way counts as twice this further away, on small curves as less."""

CORNER_RAD = 0.5
"""A greater turn from one point to the next is a corner: a radius of 2 m."""

FARTHEST_M = 1e7
"""A vehicle that is further away is taken to be so far."""

CLOSED_M = 1e-3
"""m: between the beginning and the end of a curve that is closed."""

NEAR_CENTRE = 0.05
"""Least 1 - curvature times error: nearer to the centre of a turn, no point of it is abeam."""

LONGEST_STEP_M = 20.0
STEPS = 12
"""Going along the curve until it is abeam."""


class Curve(Path):
    """A closed curve that a subclass traces."""

    def __init__(self, shape: Any) -> None:  # noqa: ANN401 - each path has a section of its own
        """Look at the curve of a shape.

        Raises:
            InputError: it has no length, is not closed, or has a corner or a point that is not finite.
        """
        # The aircraft's companion needs it for such paths alone.
        from scipy.interpolate import CubicSpline
        from scipy.spatial import cKDTree

        share = np.linspace(0.0, 1.0, MOST_POINTS)
        run = self._run(shape, share)
        self._length = float(run[-1])
        count = int(min(max(self._length / SPACING_M, FEWEST_POINTS), MOST_POINTS / TRACED_POINTS))
        self._spacing = self._length / count
        progress = np.linspace(0.0, self._length, count + 1)
        points = np.column_stack(self._traced(shape, np.interp(progress, run, share)))
        points[-1] = points[0]
        spline = CubicSpline(progress, points, bc_type="periodic")
        (north, east), (north_1, east_1) = points[:-1].T, spline(progress[:-1], 1).T
        north_2, east_2 = spline(progress[:-1], 2).T
        self._north, self._east = north, east
        self._course = np.arctan2(east_1, north_1)
        self._curvature = (north_1 * east_2 - east_1 * north_2) / np.hypot(north_1, east_1) ** 3
        following, before = np.roll(self._curvature, -1), np.roll(self._curvature, 1)
        self._growth = (following - before) / (2.0 * self._spacing)
        self._places = cKDTree(points[:-1])
        turns = np.abs(np.angle(np.exp(1j * np.diff(np.append(self._course, self._course[0])))))
        if turns.max() > CORNER_RAD:
            corner = int(turns.argmax())
            raise InputError(
                f"path {self.name}: it has a corner near north {north[corner]:.0f} m, east"
                f" {east[corner]:.0f} m; round it off"
            )
        self._course_m = min(COURSE_M, self._length / (4.0 * math.pi))
        self._tree = cKDTree(self._key(north, east, self._course))

    def _traced(self, shape: Any, share: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        """What the subclass traces.

        Raises:
            InputError: it fails, or gives something else than two arrays.
        """
        try:
            north, east = (np.asarray(one, dtype=float) for one in self.trace(shape, share))
        except Exception as error:
            reason = described_error(error)
            raise InputError(f"path {self.name}: trace() fails ({reason}); mend it") from error
        if north.shape != share.shape or east.shape != share.shape:
            raise InputError(
                f"path {self.name}: trace() gives {north.shape} and {east.shape} for {share.shape}"
                " shares; give a north and an east for each"
            )
        return north, east

    def _run(self, shape: Any, share: FloatArray) -> FloatArray:  # noqa: ANN401
        """Distance along the curve at each share of it, m."""
        north, east = self._traced(shape, share)
        finite = bool(np.all(np.isfinite(north)) and np.all(np.isfinite(east)))
        run = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(north), np.diff(east)))])
        gap = math.hypot(north[-1] - north[0], east[-1] - east[0])
        if not finite or not run[-1] > 0.0 or gap > CLOSED_M:
            what = (
                f"ends {gap:.3g} m from where it begins"
                if finite and run[-1] > 0.0
                else "has no length, or a point that is not finite"
            )
            raise InputError(f"path {self.name}: the curve that it traces {what}; mend trace()")
        return run

    @classmethod
    def of(cls, shape: Any) -> Self:  # noqa: ANN401
        """The curve of a shape."""
        return cls(shape)

    @abstractmethod
    def trace(self, shape: Any, share: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        """(north, east) of the curve, m, at shares of it from 0 to 1, where it is closed.

        Shares need not be in proportion to the distance. The curve must be smooth, or its vehicles cannot
        follow it: a corner is a turn without radius.

        Args:
            shape: an instance of `Shape`.
            share: any number of them.
        """

    @property
    def length(self) -> float:
        """Once round, m."""
        return self._length

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """The curve abeam of the vehicle, on the branch that it flies along."""
        north, east = (np.clip(one, -FARTHEST_M, FARTHEST_M) for one in (north, east))
        tree = self._places if course is None else self._tree
        key = np.stack([north, east], axis=-1) if course is None else self._key(north, east, course)
        # From a place that is not a number to a result that is none.
        index = tree.query(np.nan_to_num(key))[1]
        for _ in range(STEPS):
            run, _, _ = self._abeam(index, north, east)
            steps = np.clip(np.nan_to_num(run), -LONGEST_STEP_M, LONGEST_STEP_M) / self._spacing
            moved = np.rint(steps).astype(int)
            if not np.any(moved):
                break
            index = (index + moved) % self._course.size
        run, error, turn = self._abeam(index, north, east)
        growth = self._growth[index]
        wind_up = 0.5 * growth * run * run
        return PathPoint(
            like_number(self._course[index] + turn + wind_up, north),
            like_number(error, north),
            like_number(self._curvature[index] + growth * run, north),
            like_number((index * self._spacing + run) % self._length, north),
        )

    def _abeam(self, index: Any, north: Any, east: Any) -> tuple[Any, Any, Any]:  # noqa: ANN401
        """(distance along, cross-track error, turn of the tangent) by the circle that fits at a point."""
        away_north, away_east = north - self._north[index], east - self._east[index]
        ahead, aside = np.cos(self._course[index]), np.sin(self._course[index])
        along = away_north * ahead + away_east * aside
        right = away_east * ahead - away_north * aside
        bend = self._curvature[index]
        inward = np.maximum(1.0 - bend * right, NEAR_CENTRE)
        turn = np.arctan2(bend * along, inward)
        straight = along / inward
        run = np.where(np.abs(bend) > 1e-9, turn / np.where(bend == 0.0, 1.0, bend), straight)
        distance = np.hypot(bend * along, 1.0 - bend * right)
        error = (2.0 * right - bend * (along * along + right * right)) / (1.0 + distance)
        return run, error, turn

    def outline(self, count: int) -> FloatArray:
        """Half of the places by the distance and half by the turn: the tightest bend is among them."""
        bends = np.abs(self._curvature)
        turned = np.concatenate([[0.0], np.cumsum(bends)]) / max(float(bends.sum()), 1e-9)
        run = np.linspace(0.0, self._length, self._course.size + 1)
        even = 0.5 * turned + 0.5 * run / self._length
        places = np.interp(np.linspace(0.0, even[-1], count - 1), even, run)
        return np.sort(np.append(places, self._spacing * float(bends.argmax())))

    def _key(self, north: Any, east: Any, course: Any) -> FloatArray:  # noqa: ANN401
        """A place and a course as one vector, whose distances say how far two are from each other."""
        ahead, aside = self._course_m * np.cos(course), self._course_m * np.sin(course)
        return np.stack([north, east, ahead, aside], axis=-1)

    def at(self, progress: Number) -> PathPlace[Number]:
        """The curve at a distance from its beginning."""
        nearby = np.rint(np.asarray(progress) / self._spacing).astype(int)
        index, run = nearby % self._course.size, progress - nearby * self._spacing
        course, bend, growth = self._course[index], self._curvature[index], self._growth[index]
        middle = course + 0.5 * bend * run
        return PathPlace(
            like_number(self._north[index] + run * np.cos(middle), progress),
            like_number(self._east[index] + run * np.sin(middle), progress),
            like_number(course + bend * run + 0.5 * growth * run * run, progress),
            like_number(bend + growth * run, progress),
        )


def like_number(value: Any, other: Number) -> Number:  # noqa: ANN401
    """The value as a float where the other is one."""
    number: Number = float(value) if isinstance(other, float) else value
    return number
