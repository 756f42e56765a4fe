"""Elementary functions for both floats and NumPy arrays, with angles and a low-pass filter.

Paths and the wind triangle are written once for two callers. A companion steps one vehicle at a time and
needs the speed of `math` (50 ns a call). Checks, reports and drawings process whole tracks. Each function
takes a float or an array and returns the same type. Choices between values use `where`, which evaluates
both, since an array has no single branch.
"""

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Number = TypeVar("Number", float, FloatArray)
"""A float or an array of floats; the arguments of one formula are never mixed."""

TURN = 2.0 * math.pi


def sin(angle: Number) -> Number:
    """Return the sine of an angle in radians."""
    return math.sin(angle) if isinstance(angle, float) else np.sin(angle)


def cos(angle: Number) -> Number:
    """Return the cosine of an angle in radians."""
    return math.cos(angle) if isinstance(angle, float) else np.cos(angle)


def cosine_and_sine(angle: Number) -> tuple[Number, Number]:
    """Return the (cosine, sine) of an angle in radians."""
    if isinstance(angle, float):
        return math.cos(angle), math.sin(angle)
    return np.cos(angle), np.sin(angle)


def atan(slope: Number) -> Number:
    """Return the arc tangent, in (-pi/2, pi/2)."""
    return math.atan(slope) if isinstance(slope, float) else np.arctan(slope)


def atan2(ordinate: Number, abscissa: Number) -> Number:
    """Return the angle of the vector (abscissa, ordinate), in [-pi, pi]; 0 for the zero vector."""
    if isinstance(ordinate, float):
        return math.atan2(ordinate, abscissa)
    return np.arctan2(ordinate, abscissa)


def hypot(first: Number, second: Number) -> Number:
    """Return the length of a vector in the plane."""
    return math.hypot(first, second) if isinstance(first, float) else np.hypot(first, second)


def square_root(value: Number) -> Number:
    """Return the non-negative square root of a value that is not negative."""
    return math.sqrt(value) if isinstance(value, float) else np.sqrt(value)


def floor(value: Number) -> Number:
    """Return the greatest whole number that is not above the value, as a float."""
    return float(math.floor(value)) if isinstance(value, float) else np.floor(value)


def clip(value: Number, low: Number | float, high: Number | float) -> Number:
    """Return the value limited to [low, high]."""
    if isinstance(value, float):
        # Most values are within the limits.
        return value if low <= value <= high else min(max(value, low), high)
    return np.clip(value, low, high)


def greater_of(first: Number, second: Number | float) -> Number:
    """Return the greater of two values."""
    if isinstance(first, float):
        return max(first, second)
    return np.maximum(first, second)


def isfinite(value: Number) -> bool | BoolArray:
    """Check whether a value is finite and not NaN."""
    return math.isfinite(value) if isinstance(value, float) else np.isfinite(value)


def like(value: float, other: Number) -> Number:
    """Return a constant in the shape of another value."""
    return other * 0.0 + value


def where(condition: bool | BoolArray, first: Number, second: Number) -> Number:
    """Return the first value where the condition holds, the second elsewhere."""
    if isinstance(first, float):
        return first if condition else second
    return np.where(condition, first, second)


def low_pass(previous: Number, target: Number, period: float, time_constant: float) -> Number:
    """Return the next value of a first-order low-pass filter, backward Euler."""
    return previous + (period / (time_constant + period)) * (target - previous)


def wrap_angle(angle: Number) -> Number:
    """Return the same direction in [-pi, pi)."""
    turns = (angle + math.pi) / TURN
    return angle - TURN * (math.floor(turns) if isinstance(turns, float) else np.floor(turns))


def wrap_course(course: Number) -> Number:
    """Return the same direction in [0, 2 pi), like a compass."""
    return course - TURN * floor(course / TURN)
