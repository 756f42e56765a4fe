"""Angles: the same direction, in the turn that is asked for."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.elementwise import wrap_angle, wrap_course

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=300)
ANGLES = st.floats(-1e4, 1e4)
DEGREES = math.pi / 180.0


@pytest.mark.parametrize(
    ("angle_deg", "wrapped_deg"),
    [
        (0, 0),
        (90, 90),
        (-90, -90),
        (181, -179),
        (-181, 179),
        (270, -90),
        (360, 0),
        (725, 5),
        (-725, -5),
    ],
)
def test_an_error_of_course_is_taken_the_short_way_round(
    angle_deg: float, wrapped_deg: float
) -> None:
    assert wrap_angle(angle_deg * DEGREES) == pytest.approx(wrapped_deg * DEGREES, abs=1e-12)


def test_half_a_turn_is_minus_half_a_turn() -> None:
    assert wrap_angle(math.pi) == -math.pi
    assert wrap_angle(-math.pi) == -math.pi


@pytest.mark.parametrize(
    ("angle_deg", "compass_deg"),
    [(0, 0), (90, 90), (-90, 270), (359, 359), (360, 0), (-1, 359), (725, 5)],
)
def test_a_compass_counts_from_north_to_a_full_turn(angle_deg: float, compass_deg: float) -> None:
    assert wrap_course(angle_deg * DEGREES) == pytest.approx(compass_deg * DEGREES, abs=1e-12)


@REPEATABLE
@given(angle=ANGLES)
def test_wrapping_keeps_the_direction(angle: float) -> None:
    for wrapped in (wrap_angle(angle), wrap_course(angle)):
        assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
        assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@REPEATABLE
@given(angle=ANGLES)
def test_wrapped_angles_stay_in_their_turn(angle: float) -> None:
    # but for rounding where a turn ends
    assert -math.pi <= wrap_angle(angle) <= math.pi + 1e-12
    assert -1e-12 <= wrap_course(angle) <= 2.0 * math.pi + 1e-12


@REPEATABLE
@given(angles=st.lists(ANGLES, min_size=1, max_size=20))
def test_arrays_are_wrapped_as_floats_are(angles: list[float]) -> None:
    batch = np.array(angles)
    assert wrap_angle(batch).tolist() == [wrap_angle(angle) for angle in angles]
    assert wrap_course(batch).tolist() == [wrap_course(angle) for angle in angles]
