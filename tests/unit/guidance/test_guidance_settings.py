"""The ground-speed observer, alone and inside the law."""

import math
from collections.abc import Callable

import pytest

from tests.kit.states import Plant
from vfguide.elementwise import wrap_angle
from vfguide.guidance.path import Path, desired_course, desired_course_rate_per_speed
from vfguide.guidance.settings import ObserverGains, speed_estimate_rate
from vfguide.guidance.sliding_laws import course_command, sliding_course_rate
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line

GAINS = ObserverGains(gamma=2.0, rho=200.0, sigma=0.5)
GROUND_SPEED, AIRSPEED, PERIOD = 25.0, 20.0, 0.05
LINE = Line(north=0.0, east=0.0, course=0.4)


def test_the_estimate_is_pulled_to_the_reference():
    # -Gamma sigma (V^ - V_ref) = -2 . 0.5 . (23 - 20)
    assert speed_estimate_rate(23.0, 20.0, 0.0, 0.01, GAINS) == pytest.approx(-3.0)


def test_a_course_error_along_the_regressor_lowers_the_estimate():
    # -Gamma rho chi~ phi = -2 . 200 . 0.1 . 0.01
    assert speed_estimate_rate(20.0, 20.0, 0.1, 0.01, GAINS) == pytest.approx(-0.4)
    assert speed_estimate_rate(20.0, 20.0, 0.1, -0.01, GAINS) == pytest.approx(0.4)


def fly_path(
    flyer: Plant,
    path: Path,
    reference: Callable[[float], float],
    seconds: float,
    *,
    gains: ObserverGains = GAINS,
    period: float = PERIOD,
) -> float:
    """Fly with the estimate alone in the law, the reference speed a function of time; the estimate."""
    estimate, field = AIRSPEED, (0.03, math.pi / 2.0)
    for step in range(round(seconds / period)):
        point = path.nearest(flyer.north, flyer.east)
        error = wrap_angle(flyer.course - desired_course(point, *field))
        regressor = desired_course_rate_per_speed(point, flyer.course, *field)
        speed = reference(step * period)
        estimate += period * speed_estimate_rate(estimate, speed, error, regressor, gains)
        turn = sliding_course_rate(error, estimate * regressor, 3.0, 0.3)
        flyer.fly(course_command(flyer.course, turn, 1.2), GROUND_SPEED, period)
    return estimate


def measured(_: float) -> float:
    return GROUND_SPEED


def without_gps_velocity(_: float) -> float:
    return AIRSPEED


def with_a_dropout(time_s: float) -> float:
    return AIRSPEED if 20.0 < time_s < 40.0 else GROUND_SPEED


@pytest.mark.parametrize("path", [LINE, Circle(north=0.0, east=0.0, radius=150.0, direction=-1)])
@pytest.mark.parametrize("reference", [measured, with_a_dropout])
def test_with_a_measured_reference_estimate_and_path_converge(path, reference):
    flyer = Plant(north=100.0, east=-100.0, course=2.0)
    estimate = fly_path(flyer, path, reference, 90.0)
    assert estimate == pytest.approx(GROUND_SPEED, abs=0.02)
    assert abs(path.nearest(flyer.north, flyer.east).cross_track_error) < 0.05


def test_on_a_line_the_law_survives_without_a_measured_speed():
    flyer = Plant(north=100.0, east=-100.0, course=2.0)
    fly_path(flyer, LINE, without_gps_velocity, 90.0)
    # at the end the field does not turn, so that its rate needs no speed
    assert abs(LINE.nearest(flyer.north, flyer.east).cross_track_error) < 0.01


def test_on_a_circle_an_estimate_five_short_leaves_a_third_of_a_metre():
    circle = Circle(north=0.0, east=0.0, radius=150.0, direction=1)
    flyer = Plant(north=100.0, east=-100.0, course=2.0)
    estimate = fly_path(flyer, circle, without_gps_velocity, 120.0)
    assert AIRSPEED <= estimate < GROUND_SPEED
    # (V^ - V)/R = -5/150 = -0.0333 rad/s is made up by kappa chi~/epsilon: chi~ = -0.0033 rad, the
    # vehicle then has e = chi~/k = 0.11 m; in samples of 50 ms a little more
    assert abs(circle.nearest(flyer.north, flyer.east).cross_track_error) < 0.33


def test_the_adaptation_brings_the_estimate_nearer_than_the_reference():
    circle = Circle(north=0.0, east=0.0, radius=60.0, direction=1)
    strong = ObserverGains(gamma=2.0, rho=1e5, sigma=0.5)
    flyer = Plant(north=60.0, course=math.pi / 2.0)
    estimate = fly_path(flyer, circle, without_gps_velocity, 30.0, gains=strong, period=0.002)
    # at rest kappa chi~/epsilon = 10 chi~ = (V^ - V) phi and rho chi~ phi = sigma (V_ref - V^), phi = 1/60:
    # 2.7778 (25 - V^) = 0.5 (V^ - 20)
    assert estimate == pytest.approx((2.7778 * 25.0 + 0.5 * 20.0) / 3.2778, abs=0.1)
