"""Heights along a path: even climbs between waypoints, joined by vertical curves as on roads.

Along a vertical curve the slope changes evenly, so that it never jumps: an aircraft goes over into a climb
about as it goes over into a turn. It cuts the corner of the heights as a fillet does that of the course.
"""

from bisect import bisect_right
from collections.abc import Sequence

import numpy as np

from vfguide.elementwise import Number, like

EASED_M = 120.0
"""Length of a vertical curve where there is room for it."""


class HeightProfile:
    """Height and slope by progress."""

    def __init__(self, knots: Sequence[tuple[float, float]], *, closed: bool) -> None:
        """Join heights.

        Args:
            knots: (progress, height) in m, two or more, the progress ascending. Of a closed line the last is
                the first again, a round later; one that is not is level before the first and after the last.
            closed: whether it is.
        """
        run, height = np.array(knots, dtype=float).T
        room = np.diff(run)
        if not closed:
            # What lies outside is level: the first climb begins, and the last ends, with its vertical curve.
            run[0] += min(EASED_M, room[0] / 2.0) / 2.0
            run[-1] -= min(EASED_M, room[-1] / 2.0) / 2.0
        first, last = run[0] - knots[0][0], knots[-1][0] - run[-1]
        room = np.diff(run)
        slopes = np.diff(height) / room
        reach = (
            np.minimum(EASED_M, np.minimum(np.append(np.inf, room), np.append(room, np.inf))) / 2.0
        )
        reach[0] = reach[-1] = min(reach[0], reach[-1]) if closed else 0.0
        if not closed:
            reach[0], reach[-1] = first, last
        before = np.append(slopes[-1] if closed else 0.0, slopes)
        after = np.append(slopes, slopes[0] if closed else 0.0)
        progress = np.column_stack([run - reach, run + reach]).ravel()
        slope = np.column_stack([before, after]).ravel()
        if closed:
            # The curve at the last knot is that at the first.
            progress, slope = progress[:-1], slope[:-1]
        lengths = np.diff(progress)
        self._closed, self._round = closed, float(knots[-1][0] - knots[0][0])
        self._level = not height.any()
        self._progress = progress.tolist()
        self._slope = slope.tolist()
        self._growth = (np.diff(slope) / np.where(lengths > 0.0, lengths, 1.0)).tolist()
        rises = lengths * 0.5 * (slope[:-1] + slope[1:])
        self._height = (
            height[0] - reach[0] * before[0] + np.append(0.0, np.cumsum(rises))
        ).tolist()

    def at(self, progress: Number) -> tuple[Number, Number]:
        """(height in m, slope) at a progress (m)."""
        if self._level:
            return like(0.0, progress), like(0.0, progress)
        if isinstance(progress, float):
            return self._one(progress)
        values = [self._one(one) for one in np.ravel(progress).tolist()]
        height, slope = np.array(values).T.reshape(2, *np.shape(progress))
        return height, slope

    def _one(self, progress: float) -> tuple[float, float]:
        first, last = self._progress[0], self._progress[-1]
        if self._closed:
            progress = first + (progress - first) % self._round
        elif not first < progress < last:
            return (self._height[0] if progress <= first else self._height[-1]), 0.0
        index = min(bisect_right(self._progress, progress) - 1, len(self._growth) - 1)
        run, slope, growth = (
            progress - self._progress[index],
            self._slope[index],
            self._growth[index],
        )
        height = self._height[index] + run * (slope + 0.5 * growth * run)
        return height, slope + growth * run
