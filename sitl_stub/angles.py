"""Angles on the circle: radians, clockwise from north."""

import math


def wrap_to_pi(angle_rad: float) -> float:
    """The same direction in (-pi, pi]: what an error between two courses must be."""
    wrapped = math.remainder(angle_rad, math.tau)
    return wrapped if wrapped > -math.pi else math.pi


def wrap_to_two_pi(angle_rad: float) -> float:
    """The same direction in [0, 2 pi): how a compass reads."""
    wrapped = angle_rad % math.tau
    # A tiny negative angle rounds up to the full circle itself.
    return wrapped if wrapped < math.tau else 0.0
