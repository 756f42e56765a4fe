"""Angles in radians: wrapping and differences."""

import math

from vfguide.elementwise import Number, floor

TURN = 2.0 * math.pi


def wrap_angle(angle: Number) -> Number:
    """The same direction in [-pi, pi)."""
    return angle - TURN * floor((angle + math.pi) / TURN)


def wrap_course(course: Number) -> Number:
    """The same direction in [0, 2 pi), as a compass counts."""
    return course - TURN * floor(course / TURN)
