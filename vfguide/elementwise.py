"""Elementary functions for floats and NumPy arrays alike: angles and the low-pass filter among them.

Paths and the wind triangle are written once and serve two callers: a companion, which steps one vehicle at
a time and wants the speed of `math` (50 ns a call), and checks, reports and drawings, which look at whole
tracks. Each function here takes a float or an array, and gives back what it was given. A rule that chooses
between values is written with `where`, which evaluates both: an array has no one branch.
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Number = TypeVar("Number", float, FloatArray)
"""A float, or an array of them: never a mixture of the two in one formula's arguments."""

TURN = 2.0 * math.pi


def sin(angle: Number) -> Number:
    """Sine of an angle in radians."""
    return math.sin(angle) if isinstance(angle, float) else np.sin(angle)


def cos(angle: Number) -> Number:
    """Cosine of an angle in radians."""
    return math.cos(angle) if isinstance(angle, float) else np.cos(angle)


def cosine_and_sine(angle: Number) -> tuple[Number, Number]:
    """(cosine, sine) of an angle in radians."""
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
    return np.cos(angle), np.sin(angle)


def atan(slope: Number) -> Number:
    """Arc tangent, in (-pi/2, pi/2)."""
    return math.atan(slope) if isinstance(slope, float) else np.arctan(slope)


def atan2(ordinate: Number, abscissa: Number) -> Number:
    """Angle of the vector (abscissa, ordinate), in [-pi, pi]; 0 for the zero vector."""
    if isinstance(ordinate, float):
        return math.atan2(ordinate, abscissa)
    return np.arctan2(ordinate, abscissa)


def hypot(first: Number, second: Number) -> Number:
    """Length of a vector in the plane."""
    return math.hypot(first, second) if isinstance(first, float) else np.hypot(first, second)


def square_root(value: Number) -> Number:
    """Non-negative square root; the value must not be negative."""
    return math.sqrt(value) if isinstance(value, float) else np.sqrt(value)


def floor(value: Number) -> Number:
    """The greatest whole number that is not above the value, as a float."""
    return float(math.floor(value)) if isinstance(value, float) else np.floor(value)


def clip(value: Number, low: Number | float, high: Number | float) -> Number:
    """The value, held within [low, high]."""
    if isinstance(value, float):
        # Most often it is within.
        return value if low <= value <= high else min(max(value, low), high)
    return np.clip(value, low, high)


def greater_of(first: Number, second: Number | float) -> Number:
    """The greater of two values."""
    if isinstance(first, float):
        return max(first, second)
    return np.maximum(first, second)


def isfinite(value: Number) -> bool | BoolArray:
    """Whether a value is a number, and not infinite."""
    return math.isfinite(value) if isinstance(value, float) else np.isfinite(value)


def like(value: float, other: Number) -> Number:
    """A constant in the shape of another value."""
    return other * 0.0 + value


def where(condition: bool | BoolArray, first: Number, second: Number) -> Number:
    """The first value where the condition holds, the second elsewhere."""
    if isinstance(first, float):
        return first if condition else second
    return np.where(condition, first, second)


def low_pass(previous: Number, target: Number, period: float, time_constant: float) -> Number:
    """First-order low-pass filter, backward Euler."""
    return previous + (period / (time_constant + period)) * (target - previous)


def wrap_angle(angle: Number) -> Number:
    """The same direction in [-pi, pi)."""
    turns = (angle + math.pi) / TURN
    return angle - TURN * (math.floor(turns) if isinstance(turns, float) else np.floor(turns))


def wrap_course(course: Number) -> Number:
    """The same direction in [0, 2 pi), as a compass counts."""
    return course - TURN * floor(course / TURN)
