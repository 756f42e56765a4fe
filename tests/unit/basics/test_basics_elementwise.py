"""Elementary functions under one name: a float gives a float, an array gives an array, the same values."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from vfguide.elementwise import (
    FloatArray,
    atan,
    atan2,
    clip,
    cos,
    floor,
    greater_of,
    hypot,
    sin,
    square_root,
    where,
)

VALUES = [-7.25, -1.0, -0.3, 0.0, 0.3, 1.0, 7.25, 1e6]
OTHERS = [3.0, -1.0, 0.0, -2.5, 0.3, 1e-9, -4.0, 2.0]


def least_and_most(value: float) -> float:
    return clip(value, -1.0, 0.5)


def root_of_magnitude(value: float) -> float:
    return square_root(abs(value))


ONE: list[tuple[Callable[[float], float], Callable[[float], float]]] = [
    (sin, math.sin),
    (cos, math.cos),
    (atan, math.atan),
    (floor, math.floor),
    (root_of_magnitude, lambda value: math.sqrt(abs(value))),
    (least_and_most, lambda value: max(-1.0, min(0.5, value))),
]
TWO: list[tuple[Callable[[float, float], float], Callable[[float, float], float]]] = [
    (atan2, math.atan2),
    (hypot, lambda first, second: math.sqrt(first * first + second * second)),
    (greater_of, max),
    (lambda first, second: where(first > second, first, second), max),
]


@pytest.mark.parametrize(("function", "expected"), ONE)
def test_functions_of_one_value(
    function: Callable[[float], float], expected: Callable[[float], float]
) -> None:
    for value in VALUES:
        assert type(function(value)) is float
        assert function(value) == pytest.approx(expected(value), rel=1e-14)


@pytest.mark.parametrize(("function", "expected"), TWO)
def test_functions_of_two_values(
    function: Callable[[float, float], float], expected: Callable[[float, float], float]
) -> None:
    for first, second in zip(VALUES, OTHERS, strict=True):
        assert type(function(first, second)) is float
        assert function(first, second) == pytest.approx(expected(first, second), rel=1e-14)


@pytest.mark.parametrize("function", [function for function, _ in ONE])
def test_an_array_of_one_value(function: Callable[[FloatArray], FloatArray]) -> None:
    found = function(np.array(VALUES))
    assert isinstance(found, np.ndarray)
    assert found.tolist() == pytest.approx([function(value) for value in VALUES], rel=1e-14)


@pytest.mark.parametrize("function", [function for function, _ in TWO])
def test_an_array_of_two_values(function: Callable[[FloatArray, FloatArray], FloatArray]) -> None:
    found = np.asarray(function(np.array(VALUES), np.array(OTHERS)))
    expected = [function(*pair) for pair in zip(VALUES, OTHERS, strict=True)]
    assert found.tolist() == pytest.approx(expected, rel=1e-14)


def test_the_zero_vector_points_north() -> None:
    assert atan2(0.0, 0.0) == 0.0


def test_bounds_may_be_arrays_too() -> None:
    low, high = np.array([0.0, 0.0, 2.0]), np.array([1.0, 1.0, 3.0])
    assert clip(np.array([-1.0, 0.5, 9.0]), low, high).tolist() == [0.0, 0.5, 3.0]
    assert greater_of(np.array([-1.0, 0.5]), 0.0).tolist() == [0.0, 0.5]
