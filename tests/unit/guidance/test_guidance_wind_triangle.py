"""The wind triangle and the accelerations that go with it."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import (
    air_relative_rates,
    airspeed_for_ground_velocity,
    compose,
    ground_speed_on_course,
    heading_rate_at_constant_airspeed,
    polar,
    resolve,
)

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=200)
ANGLES = st.floats(-math.pi, math.pi)
Timed = Callable[[float], float]


@REPEATABLE
@given(north=st.floats(-100.0, 100.0), east=st.floats(-100.0, 100.0), direction=ANGLES)
def test_composing_undoes_resolving(north, east, direction):
    back = compose(*resolve(north, east, direction), direction)
    assert back == pytest.approx((north, east), abs=1e-9)


@pytest.mark.parametrize(
    ("course", "wind", "ground_speed", "closes"),
    [
        (0.0, (0.0, 0.0), 20.0, True),
        (0.0, (5.0, 0.0), 25.0, True),  # tail wind
        (0.0, (-5.0, 0.0), 15.0, True),  # head wind
        (0.0, (0.0, 12.0), 16.0, True),  # across: sqrt(20² - 12²)
        (0.0, (3.0, -12.0), 19.0, True),
        # eastward, wind toward the south-east (-12, 5): 5 along, 12 across: 5 + 16
        (math.pi / 2.0, (-12.0, 5.0), 21.0, True),
        # a crosswind faster than the aircraft leaves the tail wind alone
        (0.0, (4.0, 25.0), 4.0, False),
        (0.0, (-4.0, 20.0), -4.0, False),
    ],
)
def test_ground_speed_on_a_course(course, wind, ground_speed, closes):
    assert ground_speed_on_course(20.0, course, *wind) == pytest.approx(ground_speed)
    if closes:
        airspeed = airspeed_for_ground_velocity(ground_speed, course, *wind)
        assert airspeed == pytest.approx(20.0)


@REPEATABLE
@given(st.floats(5.0, 50.0), ANGLES, st.tuples(st.floats(-60.0, 60.0), st.floats(-60.0, 60.0)))
def test_ground_speed_is_finite_and_closes_the_triangle_where_it_can(airspeed, course, wind):
    ground_speed = ground_speed_on_course(airspeed, course, *wind)
    assert math.isfinite(ground_speed)
    _, cross = resolve(*wind, course)
    needed = airspeed_for_ground_velocity(ground_speed, course, *wind)
    assert needed == pytest.approx(max(airspeed, abs(cross)))


def heading_of(time: float) -> float:
    return 0.7 + 0.3 * time + 0.2 * math.sin(0.5 * time)


def wind_of(time: float) -> tuple[float, float]:
    return 5.0 + 3.0 * math.cos(0.4 * time), -4.0 + 2.0 * math.sin(0.3 * time)


def ground_velocity(time: float, airspeed: Timed) -> tuple[float, float]:
    """(speed, course) that the triangle gives."""
    air = polar(airspeed(time), heading_of(time))
    north, east = (blown + still for blown, still in zip(wind_of(time), air, strict=True))
    return math.hypot(north, east), math.atan2(east, north)


def slope(function: Timed, time: float) -> float:
    return (function(time + 1e-4) - function(time - 1e-4)) / 2e-4


def triangle(time: float, airspeed: Timed) -> tuple[float, float, dict[str, float]]:
    """(dV_g/dt, dchi/dt) by differences, and the state that the formulas ask for."""
    speed, course = ground_velocity(time, airspeed)
    course_rate = slope(lambda at: wrap_angle(ground_velocity(at, airspeed)[1] - course), time)
    state = {
        "ground_speed": speed,
        "course": course,
        "airspeed": airspeed(time),
        "heading": heading_of(time),
        "wind_rate_north": slope(lambda at: wind_of(at)[0], time),
        "wind_rate_east": slope(lambda at: wind_of(at)[1], time),
    }
    return slope(lambda at: ground_velocity(at, airspeed)[0], time), course_rate, state


@pytest.mark.parametrize("time", [0.0, 1.3, 4.0, 7.7, 12.0])
def test_air_relative_rates_are_those_of_the_triangle(time):
    def airspeed(at: float) -> float:
        return 20.0 + 2.0 * math.sin(0.6 * at)

    acceleration, course_rate, state = triangle(time, airspeed)
    airspeed_rate, heading_rate = air_relative_rates(acceleration, course_rate, **state)
    assert airspeed_rate == pytest.approx(slope(airspeed, time), abs=1e-6)
    assert heading_rate == pytest.approx(slope(heading_of, time), abs=1e-6)
    # At constant airspeed.
    _, course_rate, state = triangle(time, lambda _: 20.0)
    heading_rate = heading_rate_at_constant_airspeed(course_rate, **state)
    assert heading_rate == pytest.approx(slope(heading_of, time), abs=1e-6)


CALM = {"wind_rate_north": 0.0, "wind_rate_east": 0.0, "ground_speed": 20.0, "airspeed": 20.0}


def test_without_wind_air_and_ground_rates_are_the_same():
    state = {**CALM, "course": 1.0, "heading": 1.0}
    assert air_relative_rates(2.0, 0.3, **state) == pytest.approx((2.0, 0.3))
    assert heading_rate_at_constant_airspeed(0.3, **state) == pytest.approx(0.3)


@pytest.mark.parametrize("drift", [1.25, math.pi / 2.0, 2.0, math.pi])
def test_a_drift_beyond_70_degrees_does_not_ask_for_more_than_one_of_70(drift):
    # 0.1 / 0.34
    rate = heading_rate_at_constant_airspeed(0.1, course=0.0, heading=drift, **CALM)
    assert rate == pytest.approx(0.2941, abs=1e-4)
