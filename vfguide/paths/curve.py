"""A closed curve of any shape, by its points: what a path of one's own is usually made of.

The curve is looked at once, at the start: points a metre or so apart, with the course and the curvature of a
periodic cubic spline through them. These are the joints of a chain.
"""

import math
from abc import abstractmethod
from typing import Any, Self

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.errors import InputError, described_error
from vfguide.paths.chain import Chain, ChainedPath
from vfguide.paths.pieces import Pieces

SPACING_M = 1.0
"""Between the points that a curve is known by."""

FEWEST_POINTS, MOST_POINTS = 400, 100_000

TRACED_POINTS = 4
"""Points that are traced for each one that is kept."""

CORNER_RAD = 0.5
"""A greater turn from one point to the next is a corner: a radius of 2 m."""

CLOSED_M = 1e-3
"""m: between the beginning and the end of a curve that is closed."""


class Curve(ChainedPath):
    """A closed curve that a subclass traces."""

    def __init__(self, shape: Any) -> None:  # noqa: ANN401 - each path has a section of its own
        """Look at the curve of a shape.

        Raises:
            InputError: it has no length, is not closed, or has a corner or a point that is not finite.
        """
        # The aircraft's companion needs it for such paths alone.
        from scipy.interpolate import CubicSpline

        share = np.linspace(0.0, 1.0, MOST_POINTS)
        run = self._run(shape, share)
        length = float(run[-1])
        count = int(min(max(length / SPACING_M, FEWEST_POINTS), MOST_POINTS / TRACED_POINTS))
        spacing = length / count
        progress = np.linspace(0.0, length, count + 1)
        points = np.column_stack(self._traced(shape, np.interp(progress, run, share)))
        points[-1] = points[0]
        spline = CubicSpline(progress, points, bc_type="periodic")
        (north, east), (north_1, east_1) = points[:-1].T, spline(progress[:-1], 1).T
        north_2, east_2 = spline(progress[:-1], 2).T
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
