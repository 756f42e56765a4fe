"""Height profiles along a path: one steady climb, even climbs between waypoints, or those of a curve.

Vertical curves join even climbs, as on roads. Along a vertical curve the slope changes evenly and never
jumps: an aircraft enters a climb much as it enters a turn. The curve cuts the corner of the heights as a
fillet cuts that of the course.
"""

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Annotated

import msgspec
import numpy as np
from pydantic import Field
from pydantic_core import PydanticCustomError

from vfguide.elementwise import FloatArray, Number, clip, like
from vfguide.mission import quantity

EASE_M = 100.0
"""Length of the transition from level to the slope, m: 5 s at 20 m/s, as autopilots change their climb."""

ClimbAngle = Annotated[quantity.Number, Field(ge=-30.0, le=30.0)]
"""Angle of a climb over ground, degrees, negative for a descent."""

EndHeight = Annotated[quantity.Number, Field(ge=-9000.0, le=9000.0)]
"""Height above the mission's flying height, m."""

EASED_M = 120.0
"""Length of a vertical curve where there is room for it, m."""


class Climb(msgspec.Struct, frozen=True, kw_only=True):
    """Profile that begins to climb at progress 0, from the mission's flying height."""

    slope: float
    """Rise per metre along the ground."""
    end: float
    """Height at which the profile levels off, m above the flying height; infinite: never."""

    @property
    def run(self) -> float:
        """Distance for the slope alone to reach the end, m; the profile takes `EASE_M` more."""
        return self.end / self.slope if self.slope != 0.0 else 0.0

    def at(self, progress: Number) -> tuple[Number, Number]:
        """Return (height in m above the flying height, slope) at a progress (m)."""
        if self.slope == 0.0:
            return progress * 0.0, progress * 0.0
        half = 0.5 * min(EASE_M, self.run)
        height, slope = eased_ramp(progress - half, half)
        if math.isfinite(self.run):
            over, less = eased_ramp(progress - half - self.run, half)
            height, slope = height - over, slope - less
        return self.slope * height, self.slope * slope


LEVEL = Climb(slope=0.0, end=0.0)
"""Profile without a climb."""


def climb_of(climb_deg: float, end_m: float | None) -> Climb:
    """Return the profile of a mission's fields; without an end it climbs for ever."""
    if climb_deg == 0.0:
        return LEVEL
    slope = math.tan(math.radians(climb_deg))
    end = math.copysign(math.inf, slope) if end_m is None else end_m
    return Climb(slope=slope, end=end)


def check_end(climb_deg: float, end_m: float | None) -> None:
    """Raise PydanticCustomError if a climb leads away from its end."""
    if end_m is not None and not climb_deg * end_m > 0.0:
        kind = "climb_end"
        message = "climb_deg leads away from end_height_m"
        raise PydanticCustomError(kind, message)


def eased_ramp(progress: Number, half: float) -> tuple[Number, Number]:
    """Return (ramp, slope): 0 before 0, proportional after it, joined by a parabola over ±`half` (m)."""
    inside = clip(progress, -half, half) + half
    slope = inside / (2.0 * half)
    beyond = clip(progress - half, 0.0, math.inf)
    return 0.5 * inside * slope + beyond, slope


class HeightProfile:
    """Height and slope by progress, with vertical curves at knots."""

    def __init__(self, knots: Sequence[tuple[float, float]], *, closed: bool) -> None:
        """Join (progress, height) knots in m by even climbs, two or more, the progress ascending.

        A closed line repeats its first knot a round later; an open one is level outside its knots.
        """
        run, height = np.array(knots, dtype=float).T
        room = np.diff(run)
        if not closed:
            # Outside is level: the first climb begins, and the last ends, with its vertical curve.
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
        """Return (height in m, slope) at a progress (m)."""
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


class ClosedHeights:
    """Heights round a closed curve, by cubics between evenly spaced points."""

    def __init__(self, heights: FloatArray, slopes: FloatArray, spacing: float) -> None:
        """Join heights (m) and slopes of points `spacing` metres apart; the first follows the last one."""
        self._heights, self._slopes, self._spacing = heights, slopes, spacing

    def at(self, progress: Number) -> tuple[Number, Number]:
        """Return (height in m, slope) at a progress (m)."""
        spacing, count = self._spacing, len(self._heights)
        place = np.asarray(progress, dtype=float) / spacing
        before = np.nan_to_num(np.floor(place))
        share = place - before
        index = before.astype(int) % count
        after = (index + 1) % count
        begin, end = self._heights[index], self._heights[after]
        # Hermite cubic through both heights and slopes.
        rise = (end - begin) / spacing
        first, last = self._slopes[index], self._slopes[after]
        bend, twist = 3.0 * rise - 2.0 * first - last, first + last - 2.0 * rise
        height = begin + spacing * share * (first + share * (bend + share * twist))
        slope = first + share * (2.0 * bend + 3.0 * share * twist)
        if isinstance(progress, float):
            return float(height), float(slope)
        return height, slope
