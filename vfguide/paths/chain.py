"""Chains of pieces as one path, and paths along any closed curve.

Every position is computed from its piece, so a straight leg of ten kilometres is one piece and as exact as a
bend. A tree finds the nearest piece; steps along the chain then find the point abeam of the vehicle.

A custom path is usually a closed curve of any shape, given by its points. It is sampled once, at the start:
points a metre or so apart become the joints of a chain. A periodic cubic spline through them gives course and
curvature.
"""

import math
from abc import abstractmethod
from bisect import bisect_right
from typing import Any, Self

import numpy as np
from msgspec.structs import replace

from vfguide.elementwise import FloatArray, Number
from vfguide.errors import InputError, described_error
from vfguide.guidance.path import NEAR_CENTRE, Path, PathPlace, PathPoint
from vfguide.paths.climb import ClosedHeights, HeightProfile
from vfguide.paths.pieces import GAUSS, Pieces, PieceTree, displacement

FEW = 16
"""Number of vehicles up to which each is searched for singly."""

COURSE_M = 100.0
"""Penalty of a branch with the opposite course, m: twice this farther away, on small curves less."""

FARTHEST_M = 1e7
"""Limit to which positions are clipped, m."""

LONGEST_STEP_M = 20.0
STEPS = 12
ABEAM_M = 1e-5
"""Limits of the search for the point abeam: longest step, m; number of steps; tolerance, m."""

SPACING_M = 1.0
"""Distance between the points of a curve, m."""

FEWEST_POINTS, MOST_POINTS = 400, 100_000

TRACED_POINTS = 4
"""Number of points traced for each point kept."""

CORNER_RAD = 0.5
"""Turn between neighbouring points above which a curve has a corner, rad: a radius of 2 m."""

STEEPENING_1_M = 0.02
"""Change of slope per metre above which heights have an edge, 1/m: 8 m/s² at 20 m/s."""

CLOSED_M = 1e-3
"""Largest gap between the ends of a closed curve, m."""


class Chain:
    """Row of pieces; after the last one it continues with the first, or with a later one."""

    def __init__(self, pieces: Pieces, *, again: float | None = 0.0) -> None:
        """Create a chain of pieces, each starting where the previous one ends.

        `again` is the progress of the piece after the last one, m; None where the last piece runs on.
        """
        self.pieces, self.length, self.again = pieces, pieces.total, again
        self._closed = again == 0.0
        self._starts = pieces.progress.tolist()
        self._rows = list(
            zip(
                pieces.north.tolist(),
                pieces.east.tolist(),
                pieces.course.tolist(),
                pieces.curvature.tolist(),
                pieces.growth.tolist(),
                strict=True,
            )
        )
        self._course_m = min(COURSE_M, self.length / (4.0 * math.pi))
        self._tree = PieceTree(pieces)

    def wrapped(self, progress: Any) -> Any:  # noqa: ANN401
        """Return a progress within the chain; before the start of an open chain it stays as it is."""
        if self.again is None:
            return progress
        span = self.length - self.again
        if self._closed:
            return progress % span
        if isinstance(progress, float):
            return (
                progress if progress < self.length else self.again + (progress - self.again) % span
            )
        return np.where(
            progress < self.length, progress, self.again + (progress - self.again) % span
        )

    def at(self, progress: Number) -> tuple[Number, Number, Number, Number]:
        """Return (north, east, course, curvature) at a progress, in m, rad and 1/m."""
        if isinstance(progress, float):
            return self._place(self.wrapped(progress))[:4]
        return self._places(self.wrapped(np.asarray(progress, dtype=float)))[:4]

    def nearest(
        self, north: Number, east: Number, course: Number | None
    ) -> tuple[Number, Number, Number, Number]:
        """Return (course, cross-track error, curvature, progress) of the chain abeam of a vehicle.

        Its course (rad) selects the branch; None ignores courses. Position in m.
        """
        weight = 0.0 if course is None else self._course_m
        if isinstance(north, float) and isinstance(east, float):
            return self._nearest_one(north, east, course, weight)
        return self._nearest_all(north, east, course, weight)

    def _place(self, progress: float) -> tuple[float, float, float, float, float]:
        index = max(bisect_right(self._starts, progress) - 1, 0)
        north, east, course, curvature, growth = self._rows[index]
        run = progress - self._starts[index]
        if curvature == 0.0 and growth == 0.0:
            return north + run * math.cos(course), east + run * math.sin(course), course, 0.0, 0.0
        for place, weight in GAUSS:
            at = place * run
            direction = course + at * (curvature + 0.5 * growth * at)
            north += weight * run * math.cos(direction)
            east += weight * run * math.sin(direction)
        direction = course + run * (curvature + 0.5 * growth * run)
        return north, east, direction, curvature + growth * run, growth

    def _places(
        self, progress: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        pieces = self.pieces
        index = np.maximum(np.searchsorted(pieces.progress, progress, side="right") - 1, 0)
        run = progress - pieces.progress[index]
        course, bend, growth = pieces.course[index], pieces.curvature[index], pieces.growth[index]
        north, east = displacement(course, bend, growth, run)
        return (
            pieces.north[index] + north,
            pieces.east[index] + east,
            course + run * (bend + 0.5 * growth * run),
            bend + growth * run,
            growth,
        )

    def _nearest_one(
        self, north: float, east: float, course: float | None, weight: float
    ) -> tuple[float, float, float, float]:
        if math.isnan(north) or math.isnan(east) or not math.isfinite(course or 0.0):
            return math.nan, math.nan, math.nan, math.nan
        north = min(max(north, -FARTHEST_M), FARTHEST_M)
        east = min(max(east, -FARTHEST_M), FARTHEST_M)
        ahead, aside = (0.0, 0.0) if course is None else (math.cos(course), math.sin(course))
        progress = self._tree.closest(north, east, ahead, aside, weight)
        for left in range(STEPS, -1, -1):
            at_north, at_east, tangent, bend, growth = self._place(progress)
            away_north, away_east = north - at_north, east - at_east
            ahead, aside = math.cos(tangent), math.sin(tangent)
            along = away_north * ahead + away_east * aside
            right = away_east * ahead - away_north * aside
            inward = max(1.0 - bend * right, NEAR_CENTRE)
            turn = math.atan2(bend * along, inward)
            run = turn / bend if abs(bend) > 1e-9 else along / inward
            if abs(run) < ABEAM_M or not left:
                break
            longest = math.inf if bend == 0.0 else LONGEST_STEP_M
            progress = self.wrapped(progress + min(max(run, -longest), longest))
        distance = math.hypot(bend * along, 1.0 - bend * right)
        error = (2.0 * right - bend * (along * along + right * right)) / (1.0 + distance)
        return (
            tangent + turn + 0.5 * growth * run * run,
            error,
            bend + growth * run,
            self.wrapped(progress + run),
        )

    def _nearest_all(
        self, north: FloatArray, east: FloatArray, course: FloatArray | None, weight: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        shapes = [np.shape(one) for one in (north, east, course) if one is not None]
        shape = np.broadcast_shapes(*shapes)
        north, east = (
            np.clip(np.broadcast_to(one, shape).astype(float).ravel(), -FARTHEST_M, FARTHEST_M)
            for one in (north, east)
        )
        facing = np.zeros(north.size) if course is None else np.broadcast_to(course, shape).ravel()
        known = ~np.isnan(north) & ~np.isnan(east) & np.isfinite(facing)
        found = np.full((4, north.size), math.nan)
        if north.size > FEW:
            found[:, known] = self._abeam(north[known], east[known], facing[known], weight)
        else:
            vehicles = zip(north.tolist(), east.tolist(), facing.tolist(), strict=True)
            found.T[:] = [self._nearest_one(*vehicle, weight) for vehicle in vehicles]
        first, second, third, fourth = found.reshape(4, *shape)
        return first, second, third, fourth

    def _abeam(
        self, north: FloatArray, east: FloatArray, course: FloatArray, weight: float
    ) -> FloatArray:
        progress = self._tree.closest_all(north, east, np.cos(course), np.sin(course), weight)
        for left in range(STEPS, -1, -1):
            at_north, at_east, tangent, bend, growth = self._places(progress)
            away_north, away_east = north - at_north, east - at_east
            ahead, aside = np.cos(tangent), np.sin(tangent)
            along = away_north * ahead + away_east * aside
            right = away_east * ahead - away_north * aside
            inward = np.maximum(1.0 - bend * right, NEAR_CENTRE)
            turn = np.arctan2(bend * along, inward)
            bent = np.abs(bend) > 1e-9
            run = np.where(bent, turn / np.where(bent, bend, 1.0), along / inward)
            moving = np.abs(run) >= ABEAM_M
            if not left or not moving.any():
                break
            longest = np.where(bend == 0.0, math.inf, LONGEST_STEP_M)
            step = np.where(moving, np.clip(run, -longest, longest), 0.0)
            progress = self.wrapped(progress + step)
        distance = np.hypot(bend * along, 1.0 - bend * right)
        error = (2.0 * right - bend * (along * along + right * right)) / (1.0 + distance)
        return np.stack(
            [
                tangent + turn + 0.5 * growth * run * run,
                error,
                bend + growth * run,
                self.wrapped(progress + run),
            ]
        )


class ChainedPath(Path):
    """Path along a chain."""

    chain: Chain

    heights: HeightProfile | ClosedHeights | None = None
    """Height profile; None where all of the path is at the mission's flying height."""

    @property
    def length(self) -> float:
        """Length of one round, or to where the path repeats, m."""
        return self.chain.length

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the path point abeam of the vehicle, on the branch along its course."""
        point = PathPoint(*self.chain.nearest(north, east, course))
        if self.heights is None:
            return point
        height, slope = self.heights.at(point.progress)
        return replace(point, height=height, slope=slope)

    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the path at a distance (m) from its beginning."""
        place = PathPlace(*self.chain.at(progress))
        if self.heights is None:
            return place
        height, slope = self.heights.at(self.chain.wrapped(progress))
        return replace(place, height=height, slope=slope)

    def outline(self, count: int) -> FloatArray:
        """Return places spread half by distance and half by turn, the tightest bend among them."""
        pieces = self.chain.pieces
        ends = np.append(pieces.progress, self.length)
        bends = np.abs(pieces.curvature) + np.abs(pieces.curvature + pieces.growth * pieces.length)
        turned = np.concatenate([[0.0], np.cumsum(bends * pieces.length)])
        even = 0.5 * turned / max(float(turned[-1]), 1e-9) + 0.5 * ends / self.length
        places = np.interp(np.linspace(0.0, even[-1], count - 1), even, ends)
        return np.sort(np.append(places, ends[int(bends.argmax())]))


def closed_spline(points: FloatArray, spacing: float) -> tuple[FloatArray, FloatArray]:
    """Return first and second derivatives, at its points, of the closed cubic spline through them.

    With points h apart the slopes m solve m[i-1] + 4 m[i] + m[i+1] = 3 (p[i+1] - p[i-1]) / h all round (de
    Boor, A Practical Guide to Splines, chapter IV). The Fourier transform diagonalises the circulant matrix,
    with 4 + 2 cos(2 pi k / n). The second derivative is
    (6 (p[i+1] - p[i]) / h - 4 m[i] - 2 m[i+1]) / h.

    `points` has one a row, without the first one repeated at the end; `spacing` is the parameter's step h.
    """
    count = len(points)
    after, before = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    diagonal = 4.0 + 2.0 * np.cos(math.tau * np.arange(count // 2 + 1) / count)
    right = np.fft.rfft(3.0 * (after - before) / spacing, axis=0)
    slopes = np.fft.irfft(right / diagonal[:, np.newaxis], count, axis=0)
    chords = (after - points) / spacing
    return slopes, (6.0 * chords - 4.0 * slopes - 2.0 * np.roll(slopes, -1, axis=0)) / spacing


class Curve(ChainedPath):
    """Closed curve that a subclass traces."""

    def __init__(self, shape: Any) -> None:  # noqa: ANN401 - each path has a section of its own
        """Sample the curve of a shape.

        Raises:
            InputError: it has no length, is not closed, or has a corner or a point that is not finite.
        """
        share = np.linspace(0.0, 1.0, MOST_POINTS)
        run = self._run(shape, share)
        length = float(run[-1])
        count = int(min(max(length / SPACING_M, FEWEST_POINTS), MOST_POINTS / TRACED_POINTS))
        spacing = length / count
        progress = np.linspace(0.0, length, count + 1)
        shares = np.interp(progress, run, share)
        points = np.column_stack(self._traced(shape, shares))
        points[-1] = points[0]
        (north, east), first, second = points[:-1].T, *closed_spline(points[:-1], spacing)
        (north_1, east_1), (north_2, east_2) = first.T, second.T
        course = np.arctan2(east_1, north_1)
        curvature = (north_1 * east_2 - east_1 * north_2) / np.hypot(north_1, east_1) ** 3
        turns = np.abs(np.angle(np.exp(1j * np.diff(np.append(course, course[0])))))
        if turns.max() > CORNER_RAD:
            corner = int(turns.argmax())
            raise InputError(
                f"path {self.name}: it has a corner near north {north[corner]:.0f} m, east"
                f" {east[corner]:.0f} m; round it off"
            )
        self.chain = Chain(
            Pieces(
                progress=progress[:-1],
                north=north,
                east=east,
                course=course,
                curvature=curvature,
                growth=(np.roll(curvature, -1) - curvature) / spacing,
                length=np.full(count, spacing),
            )
        )
        self.heights = self._closed_heights(shape, shares, spacing)

    def _closed_heights(
        self,
        shape: Any,  # noqa: ANN401
        shares: FloatArray,
        spacing: float,
    ) -> ClosedHeights | None:
        """Return heights `spacing` metres apart, None if all are 0; InputError if not closed or smooth."""
        heights = self._heights_at(shape, shares)
        if not heights.any():
            return None
        step = float(heights[-1] - heights[0])
        if abs(step) > CLOSED_M:
            raise InputError(
                f"path {self.name}: it ends {step:.3g} m above where it begins; mend height()"
            )
        slopes = closed_spline(heights[:-1, np.newaxis], spacing)[0][:, 0]
        steepening = np.abs(np.diff(np.append(slopes, slopes[0]))) / spacing
        if steepening.max() > STEEPENING_1_M:
            north, east, _, _ = self.chain.at(spacing * float(steepening.argmax()))
            raise InputError(
                f"path {self.name}: its height has an edge near north {north:.0f} m, east"
                f" {east:.0f} m; round it off"
            )
        return ClosedHeights(heights[:-1], slopes, spacing)

    def _heights_at(self, shape: Any, share: FloatArray) -> FloatArray:  # noqa: ANN401
        """Return the subclass's heights, or raise InputError if not one finite height for each share."""
        try:
            heights = np.asarray(self.height(shape, share), dtype=float)
        except Exception as error:
            reason = described_error(error)
            raise InputError(f"path {self.name}: height() fails ({reason}); mend it") from error
        if heights.shape != share.shape or not np.all(np.isfinite(heights)):
            raise InputError(
                f"path {self.name}: height() gives {heights.shape} for {share.shape} shares, or a"
                " height that is not finite; give one for each"
            )
        return heights

    def _traced(self, shape: Any, share: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        """Return the subclass's trace, or raise InputError if it is not two arrays of the shares' shape."""
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
        """Return the distance along the curve at each share, m."""
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
        """Return the curve of a shape."""
        return cls(shape)

    @abstractmethod
    def trace(self, shape: Any, share: FloatArray) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401
        """Return (north, east), m, at any number of shares from 0 to 1 of the closed curve.

        Shares need not be proportional to distance. The curve must be smooth, or vehicles cannot follow it: a
        corner is a turn without radius. `shape` is an instance of `Shape`.
        """

    def height(self, shape: Any, share: FloatArray) -> FloatArray:  # noqa: ANN401
        """Return heights at shares of the curve, m above the mission's flying height; the default is 0.

        They must be as smooth as the curve, and end where they begin. `shape` is an instance of `Shape`.
        """
        del shape
        return np.zeros_like(share)
