"""Elementary functions under one name: a float gives a float, an array gives an array, the same values."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.elementwise import (
    atan,
    atan2,
    clip,
    cos,
    floor,
    greater_of,
    hypot,
    low_pass,
    sin,
    square_root,
    where,
    wrap_angle,
    wrap_course,
)

VALUES = [-7.25, -1.0, -0.3, 0.0, 0.3, 1.0, 7.25, 1e6]
OTHERS = [3.0, -1.0, 0.0, -2.5, 0.3, 1e-9, -4.0, 2.0]

ONE: list[Callable[[Any], Any]] = [sin, cos, atan, floor]
ONE += [lambda value: square_root(abs(value)), lambda value: clip(value, -1.0, 0.5)]
TWO: list[Callable[[Any, Any], Any]] = [atan2, hypot, greater_of]
TWO += [lambda first, second: where(first > second, first, second)]


@pytest.mark.parametrize("function", ONE)
def test_an_array_of_one_value(function):
    found = function(np.array(VALUES))
    assert isinstance(found, np.ndarray)
    assert found.tolist() == pytest.approx([function(value) for value in VALUES], rel=1e-14)


@pytest.mark.parametrize("function", TWO)
def test_an_array_of_two_values(function):
    found = np.asarray(function(np.array(VALUES), np.array(OTHERS)))
    expected = [function(*pair) for pair in zip(VALUES, OTHERS, strict=True)]
    assert found.tolist() == pytest.approx(expected, rel=1e-14)


def test_bounds_may_be_arrays_too():
    low, high = np.array([0.0, 0.0, 2.0]), np.array([1.0, 1.0, 3.0])
    assert clip(np.array([-1.0, 0.5, 9.0]), low, high).tolist() == [0.0, 0.5, 3.0]
    assert greater_of(np.array([-1.0, 0.5]), 0.0).tolist() == [0.0, 0.5]


REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=300)
ANGLES = st.floats(-1e4, 1e4)
DEGREES = math.pi / 180.0


@pytest.mark.parametrize(
    ("angle_deg", "wrapped_deg", "compass_deg"),
    [
        *((0, 0, 0), (90, 90, 90), (-90, -90, 270), (181, -179, 181), (-181, 179, 179)),
        *(
            (270, -90, 270),
            (359, -1, 359),
            (360, 0, 0),
            (-1, -1, 359),
            (725, 5, 5),
            (-725, -5, 355),
        ),
    ],
)
def test_an_error_is_taken_the_short_way_round_and_a_compass_counts_from_north_to_a_full_turn(
    angle_deg, wrapped_deg, compass_deg
):
    assert wrap_angle(angle_deg * DEGREES) == pytest.approx(wrapped_deg * DEGREES, abs=1e-12)
    assert wrap_course(angle_deg * DEGREES) == pytest.approx(compass_deg * DEGREES, abs=1e-12)


@REPEATABLE
@given(angle=ANGLES)
def test_wrapping_keeps_the_direction_and_stays_in_a_turn(angle):
    for wrapped in (wrap_angle(angle), wrap_course(angle)):
        assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
        assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)
    # but for rounding where a turn ends
    assert -math.pi <= wrap_angle(angle) <= math.pi + 1e-12
    assert -1e-12 <= wrap_course(angle) <= 2.0 * math.pi + 1e-12
    for wrap in (wrap_angle, wrap_course):
        assert wrap(np.array([angle])).tolist() == [wrap(angle)]


def test_a_low_pass_moves_by_its_share():
    # 0.1/(0.3 + 0.1) = a quarter of the way from 1 to 5
    assert low_pass(1.0, 5.0, 0.1, 0.3) == pytest.approx(2.0)
    assert low_pass(1.0, 5.0, 0.1, 0.0) == 5.0
