"""Fields around lines and circles: where they point, and how fast they turn along a flight."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from vfguide.elementwise import wrap_angle
from vfguide.guidance.path import (
    Direction,
    Path,
    desired_course,
    desired_course_rate_per_speed,
    desired_course_slope,
    tangent_rate_per_speed,
)
from vfguide.guidance.wind_triangle import compose, polar
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=200)
GAIN = 0.03
COURSES = [math.radians(course) for course in (0, 45, 90, 135, 180, 225, 270, 315)]
SENSES: tuple[Direction, Direction] = (1, -1)
PATHS: list[Path] = [
    Line(north=10.0, east=-20.0, course=0.7),
    Line(north=0.0, east=0.0, course=4.0),
    Circle(north=30.0, east=40.0, radius=150.0, direction=1),
    Circle(north=30.0, east=40.0, radius=150.0, direction=-1),
]


def angle_between(first: float, second: float) -> float:
    return abs(wrap_angle(first - second))


@pytest.mark.parametrize("course", COURSES)
@pytest.mark.parametrize("approach", [math.pi / 2.0, 0.6])
@pytest.mark.parametrize("right", [0.0, 1e7, -1e7])
def test_the_field_points_along_a_line_and_far_away_approaches_it_at_the_approach_angle(
    course, approach, right
):
    line = Line(north=5.0, east=7.0, course=course)
    # (-sin, cos) is the unit vector right of the course
    north, east = compose(300.0, right, course)
    point = line.nearest(5.0 + north, 7.0 + east)
    assert point.cross_track_error == pytest.approx(right, rel=1e-6, abs=1e-9)
    assert point.curvature == 0.0
    expected = course - approach * np.sign(right)
    assert angle_between(desired_course(point, GAIN, approach), expected) < (
        1e-5 if right else 1e-9
    )


def test_at_one_over_the_gain_the_field_has_bent_half_way():
    # e = 1/k = 33.3 m right: atan(1) = pi/4, half of pi/2, so half of the approach angle, to the left
    point = Line(north=0.0, east=0.0, course=0.0).nearest(0.0, 1.0 / GAIN)
    assert desired_course(point, GAIN, 0.8) == pytest.approx(-0.4)


def test_outside_a_clockwise_circle_the_vehicle_is_left_of_it():
    # 200 m north of the centre, flying east: the circle of 150 m is 50 m to the right
    clockwise = Circle(north=0.0, east=0.0, radius=150.0, direction=1).nearest(200.0, 0.0)
    assert clockwise.cross_track_error == pytest.approx(-50.0)
    assert clockwise.course == pytest.approx(math.pi / 2.0)
    other = Circle(north=0.0, east=0.0, radius=150.0, direction=-1).nearest(200.0, 0.0)
    assert other.cross_track_error == pytest.approx(50.0)
    assert other.course == pytest.approx(-math.pi / 2.0)


@REPEATABLE
@given(
    bearing=st.floats(-math.pi, math.pi),
    distance=st.floats(0.1, 1e6),
    direction=st.sampled_from(SENSES),
    gain=st.floats(0.001, 1.0),
)
@example(bearing=0.5, distance=150.0, direction=1, gain=GAIN)
@example(bearing=-2.5, distance=150.0, direction=-1, gain=GAIN)
def test_the_circle_field_is_the_articles(bearing, distance, direction, gain):
    # The tangent on the circle itself; far away it points at the centre.
    circle = Circle(north=12.0, east=-34.0, radius=150.0, direction=direction)
    north, east = polar(distance, bearing)
    point = circle.nearest(12.0 + north, -34.0 + east)
    article = bearing + direction * (math.pi / 2.0 + math.atan(gain * (distance - 150.0)))
    assert angle_between(desired_course(point, gain, math.pi / 2.0), article) < 1e-8
    assert point.cross_track_error == pytest.approx(direction * (150.0 - distance), abs=1e-8)
    assert point.curvature == pytest.approx(direction / 150.0)


@pytest.mark.parametrize("error", [-80.0, -5.0, 0.0, 3.0, 60.0])
def test_the_slope_is_the_derivative_of_the_field_across_a_line(error):
    line, step = Line(north=0.0, east=0.0, course=0.0), 1e-4
    after = desired_course(line.nearest(0.0, error + step), GAIN, 0.9)
    before = desired_course(line.nearest(0.0, error - step), GAIN, 0.9)
    slope = desired_course_slope(error, GAIN, 0.9)
    assert slope == pytest.approx((after - before) / (2.0 * step), rel=1e-6)


def test_on_the_path_the_slope_is_minus_two_over_pi_times_approach_angle_and_gain():
    # -(pi/2) (2/pi) 0.03 = -0.03 rad/m
    assert desired_course_slope(0.0, GAIN, math.pi / 2.0) == pytest.approx(-0.03)


@pytest.mark.parametrize(
    ("path", "position", "course"),
    list(product(PATHS, [(100.0, 220.0), (-140.0, -30.0), (60.0, 60.0)], [0.3, 2.0, -2.5])),
)
def test_along_a_flight_field_and_tangent_turn_at_the_analytic_rates(path, position, course):
    (north, east), step, approach = position, 1e-3, math.pi / 2.0
    ahead = path.nearest(north + step * math.cos(course), east + step * math.sin(course))
    behind = path.nearest(north - step * math.cos(course), east - step * math.sin(course))
    here = path.nearest(north, east)
    # over the ground by +-1 mm: what changes per metre flown is the rate per m/s of ground speed
    tangent = wrap_angle(ahead.course - behind.course) / (2.0 * step)
    assert tangent_rate_per_speed(here, course) == pytest.approx(tangent, abs=1e-8)
    change = desired_course(ahead, GAIN, approach) - desired_course(behind, GAIN, approach)
    rate = desired_course_rate_per_speed(here, course, GAIN, approach)
    assert rate == pytest.approx(wrap_angle(change) / (2.0 * step), abs=1e-8)


def test_a_vehicle_on_the_circle_turns_with_it():
    # 20 m/s on 150 m: 20/150 = 0.1333 rad/s clockwise
    point = Circle(north=0.0, east=0.0, radius=150.0, direction=1).nearest(150.0, 0.0)
    rate = 20.0 * desired_course_rate_per_speed(point, math.pi / 2.0, GAIN, math.pi / 2.0)
    assert rate == pytest.approx(0.13333, abs=1e-5)


@pytest.mark.parametrize("direction", SENSES)
def test_at_the_centre_of_a_circle_everything_is_finite(direction):
    circle = Circle(north=30.0, east=40.0, radius=150.0, direction=direction)
    point = circle.nearest(30.0, 40.0)
    assert abs(point.cross_track_error) == pytest.approx(150.0)
    assert math.isfinite(desired_course(point, GAIN, math.pi / 2.0))
    for course in COURSES:
        rate = desired_course_rate_per_speed(point, course, GAIN, math.pi / 2.0)
        # at most (1/R) / NEAR_CENTRE + k = 0.133 + 0.03 rad/m
        assert abs(rate) < 0.17


@pytest.mark.parametrize("direction", SENSES)
def test_flying_the_field_from_the_centre_leads_onto_the_circle(direction):
    circle = Circle(north=30.0, east=40.0, radius=150.0, direction=direction)
    north, east, turned = 30.0, 40.0, 0.0
    bearing = math.nan
    for second in range(20 * 120):
        course = desired_course(circle.nearest(north, east), GAIN, math.pi / 2.0)
        north, east = north + math.cos(course), east + math.sin(course)
        if second >= 20 * 100:
            now = math.atan2(east - 40.0, north - 30.0)
            turned += 0.0 if math.isnan(bearing) else wrap_angle(now - bearing)
            bearing = now
    # 1 m steps along the tangent spiral outward by (1 m)²/(2 R) = 3.3 mm each, which k pulls back
    assert math.hypot(north - 30.0, east - 40.0) == pytest.approx(150.0, abs=0.3)
    # 399 steps of 1 m on 150 m
    assert turned == pytest.approx(direction * 399.0 / 150.0, abs=0.02)
