"""A path of one's own: a curve of Lissajous, which crosses itself in its middle.

    vfguide fly circle-calm --plugin own_path.py --set "path={type: lissajous}" --set rehearsal.start={}

North = a sin t, east = b sin 2t, turned to a course. With b = a/2, as it is where the mission does not say
otherwise, it turns most tightly where it is widest, with a radius of 0.21 a.
"""

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import compose
from vfguide.paths import Course, Curve, Number, PathShape, Position, Positive, path


class LissajousShape(PathShape):
    """Fields of the mission's `path:` for `type: lissajous`."""

    centre: Position = Position()
    """Where it crosses itself."""

    half_length_m: Positive = 400.0
    """From its middle to either end, m."""

    half_width_m: Positive = 200.0
    """The same across, m."""

    bridge_m: Number = 0.0
    """So much higher it passes over its middle the second time than the first, m; 0 flies it level."""

    course_deg: Course = 0.0
    """Toward the end that is flown round clockwise, degrees clockwise from north."""


@path("lissajous")
class Lissajous(Curve):
    """A figure eight, flown round and round from its middle."""

    Shape = LissajousShape

    def trace(self, shape: LissajousShape, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        """North and east of its points, m."""
        angle = 2.0 * np.pi * share
        along = shape.half_length_m * np.sin(angle)
        across = shape.half_width_m * np.sin(2.0 * angle)
        north, east = compose(along, across, np.full_like(share, np.radians(shape.course_deg)))
        return shape.centre.north_m + north, shape.centre.east_m + east

    def height(self, shape: LissajousShape, share: FloatArray) -> FloatArray:
        """Heights of its points, m above the mission's flying height; what is left out here is level."""
        return shape.bridge_m * 0.5 * (1.0 - np.cos(2.0 * np.pi * share))
