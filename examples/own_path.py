"""A path of one's own: a figure eight, which crosses itself in its middle.

    vfguide fly circle-calm --plugin own_path.py --set "path={type: figure-eight}" --set rehearsal.start={}

It is the lemniscate of Gerono: north = a sin t, east = a sin t cos t, turned to a course. Where it is widest
it turns most tightly, with a radius of 0.21 a.
"""

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.wind_triangle import compose
from vfguide.paths import Course, Curve, PathShape, Position, Positive, path


class FigureEightShape(PathShape):
    """Fields of the mission's `path:` for `type: figure-eight`."""

    centre: Position = Position()
    """Where it crosses itself."""

    half_length_m: Positive = 400.0
    """From its middle to either end, m; it is half as wide as it is long."""

    course_deg: Course = 0.0
    """Toward the end that is flown round clockwise, degrees clockwise from north."""


@path("figure-eight")
class FigureEight(Curve):
    """A figure eight, flown round and round from its middle."""

    Shape = FigureEightShape

    def trace(self, shape: FigureEightShape, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """North and east of its points, m."""
        angle = 2.0 * np.pi * share
        along = shape.half_length_m * np.sin(angle)
        north, east = compose(
            along, along * np.cos(angle), np.full_like(share, np.radians(shape.course_deg))
        )
        return shape.centre.north_m + north, shape.centre.east_m + east
