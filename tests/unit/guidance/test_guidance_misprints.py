"""The article's misprints: what its formulas do as they are printed, and what the corrected ones do."""

import math
from collections.abc import Callable
from functools import partial
from itertools import pairwise

import pytest

from tests.kit.states import Plant
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import polar
from vfguide.guidance.formation import FormationError, arc_tangent_field, lyapunov
from vfguide.guidance.path import (
    Path,
    desired_course,
    desired_course_rate_per_speed,
    desired_course_slope,
)
from vfguide.guidance.sliding_laws import (
    ObserverGains,
    boundary_layer,
    course_command,
    sliding_acceleration,
    sliding_course_rate,
    speed_estimate_rate,
)
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line

ALPHA, KAPPA, SPEED, PERIOD = 1.2, 3.0, 20.0, 0.05
GAIN, APPROACH = 0.03, math.pi / 2.0
LAYER = boundary_layer(KAPPA, 0.01, period=PERIOD, delay=0.0, factor=2.0)
NORTHWARD = Line(north=0.0, east=0.0, course=0.0)

Field = Callable[[float, float], float]


def fly(plant: Plant, field: Field, seconds: float, layer: float = LAYER) -> None:
    """Close the course law around any field; its rate is taken by differences along the flight."""
    for _ in range(round(seconds / PERIOD)):
        wanted, step = field(plant.north, plant.east), 1e-3
        north, east = polar(step, plant.course)
        ahead = field(plant.north + north, plant.east + east)
        rate = SPEED * wrap_angle(ahead - wanted) / step
        turn = sliding_course_rate(wrap_angle(plant.course - wanted), rate, KAPPA, layer)
        plant.fly(course_command(plant.course, turn, ALPHA), SPEED, PERIOD)


def field_of(path: Path) -> Field:
    return lambda north, east: desired_course(path.nearest(north, east), GAIN, APPROACH)


def flown(field: Field, seconds: float, course: float = 0.0) -> Plant:
    """Fly a field from 5 m to the right of the origin."""
    plant = Plant(east=5.0, course=course)
    fly(plant, field, seconds)
    return plant


# The line field: i [chi_inf / 2 + (2/pi) atan(k e)] + atan(a) is printed.


def printed_line_field(sense: int) -> Field:
    return lambda _, east: sense * (APPROACH / 2.0 + 2.0 / math.pi * math.atan(GAIN * east))


def test_the_printed_line_field_does_not_point_along_the_line_and_flies_off_or_beside_it():
    # y = 0, flown to growing x: the course of the path is 0; printed i chi_inf / 2 = +-45 degrees
    outward, inward = printed_line_field(1), printed_line_field(-1)
    assert (outward(0.0, 0.0), inward(0.0, 0.0)) == pytest.approx((math.pi / 4.0, -math.pi / 4.0))
    corrected = field_of(NORTHWARD)
    assert corrected(0.0, 0.0) == 0.0
    # far away its course is chi_inf/2 + 1 = 1.785 rad, 20 m/s . sin = 19.5 m/s outward, for most of 100 s
    assert flown(outward, 100.0).east > 1000.0
    # at rest where (2/pi) atan(k e) = -pi/4: e = -tan(pi²/8)/k = -2.857/0.03 = -95.2 m
    assert flown(inward, 300.0).east == pytest.approx(-95.2, abs=0.5)
    assert flown(corrected, 100.0).east == pytest.approx(0.0, abs=0.01)


# The cross-track error: e = y - (a x + b) is printed.


def test_the_printed_error_is_not_a_distance_and_has_no_line_across_its_axis():
    # 10 m right of a line at 60 degrees: measured along y it is 10/cos(60) = 20 m
    course = math.radians(60.0)
    north, east = -10.0 * math.sin(course), 10.0 * math.cos(course)
    assert east - math.tan(course) * north == pytest.approx(20.0)
    line = Line(north=0.0, east=0.0, course=course)
    assert line.nearest(north, east).cross_track_error == pytest.approx(10.0)
    # x = 10 has no slope: toward it, the slope and with it the error of one metre grow beyond bounds
    steep = math.radians(89.99)
    assert math.cos(steep) - math.tan(steep) * -math.sin(steep) == pytest.approx(5730.0, rel=1e-3)
    flyer = Plant(course=1.0)
    fly(flyer, field_of(Line(north=10.0, east=0.0, course=math.pi / 2.0)), 60.0)
    assert flyer.north == pytest.approx(10.0, abs=0.01)
    assert flyer.course == pytest.approx(math.pi / 2.0, abs=1e-3)


def test_the_printed_error_drives_a_line_flown_backward_apart():
    # flown toward falling x, right of the line is on the other side of it, and the printed sign stays
    backward = math.radians(60.0 + 180.0)
    line = Line(north=0.0, east=0.0, course=backward)

    def with_printed_error(north: float, east: float) -> float:
        error = east - math.tan(backward) * north
        return backward - APPROACH * (2.0 / math.pi) * math.atan(GAIN * error)

    literal, corrected = (
        line.nearest(one.north, one.east).cross_track_error
        for one in (flown(field, 100.0, backward) for field in (with_printed_error, field_of(line)))
    )
    assert abs(literal) > 500.0
    assert corrected == pytest.approx(0.0, abs=0.01)


# The observer: "d chi^d/d e . d e/d chi" is printed for the regressor phi.

OBSERVER = ObserverGains(gamma=1.0, rho=200.0, sigma=0.5)
PATHS = [NORTHWARD, Circle(north=0.0, east=0.0, radius=150.0, direction=1)]


def printed_regressor(path: Path, north: float, east: float, course: float) -> float:
    """Slope of the field times d(de/dt)/dchi = V_g cos(chi - chi_p), for de/dchi itself is zero."""
    point = path.nearest(north, east)
    slope = desired_course_slope(point.cross_track_error, GAIN, APPROACH)
    return slope * SPEED * math.cos(course - point.course)


def regressor(path: Path, north: float, east: float, course: float) -> float:
    return desired_course_rate_per_speed(path.nearest(north, east), course, GAIN, APPROACH)


@pytest.mark.parametrize("path", PATHS)
def test_the_regressor_is_what_a_metre_a_second_more_does_to_the_fields_rate(path):
    north, east, course, field = 120.0, 60.0, 0.9, field_of(path)

    def rate(speed: float) -> float:
        reach = polar(speed * 1e-4, course)
        ahead = field(north + reach[0], east + reach[1])
        return wrap_angle(ahead - field(north - reach[0], east - reach[1])) / 2e-4

    difference = (rate(SPEED + 1.0) - rate(SPEED - 1.0)) / 2.0
    assert regressor(path, north, east, course) == pytest.approx(difference, abs=1e-6)
    assert abs(printed_regressor(path, north, east, course) - difference) > 0.01


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize(
    ("term", "falls"), [(regressor, True), (printed_regressor, False)], ids=["phi", "printed"]
)
def test_the_lyapunov_function_falls_with_the_regressor_alone(path, term, falls):
    north, east, estimate = 150.0, 0.0, 35.0
    course = path.nearest(north, east).course + 0.3
    step, layer = 0.002, 0.5
    values = []
    for _ in range(5000):
        course_error = wrap_angle(course - field_of(path)(north, east))
        speed_error = estimate - SPEED
        values.append(0.5 * 200.0 * course_error**2 + 0.5 * speed_error**2)
        feed_forward = estimate * regressor(path, north, east, course)
        turn = sliding_course_rate(course_error, feed_forward, KAPPA, layer)
        phi = term(path, north, east, course)
        change = speed_estimate_rate(estimate, SPEED, course_error, phi, OBSERVER)
        course, estimate = course + turn * step, estimate + change * step
        north += SPEED * math.cos(course) * step
        east += SPEED * math.sin(course) * step
    never_rose = all(after <= before + 1e-6 for before, after in pairwise(values))
    assert never_rose is falls
    # sigma Gamma = 0.5 1/s over 10 s: W falls at least by e^(-2 . 0.5 . 10)
    assert not falls or values[-1] < values[0] * math.exp(-10.0)


# The formation error: gamma_f is printed without saying from whom to whom.

SLOT = (-20.0, 20.0)


def printed_errors(along: float, right: float, *, from_leader: bool) -> tuple[float, float]:
    """(x_E, y_E) as printed, of a follower at (along, right) of a leader that flies north."""
    distance = math.hypot(along, right)
    bearing = math.atan2(right, along) if from_leader else math.atan2(-right, -along)
    ahead, aside = polar(distance, bearing - math.pi / 2.0)
    return SLOT[0] + aside, SLOT[1] + ahead


def follow(errors: Callable[[float, float], tuple[float, float]]) -> tuple[float, float]:
    """(along, right) of the leader after 60 s of the printed dual field behind it."""
    flyer = Plant(north=-30.0, east=30.0)
    for step in range(1200):
        x_error, y_error = errors(flyer.north - SPEED * PERIOD * step, flyer.east)
        course, _ = arc_tangent_field(y_error, 0.0, 0.2, math.pi / 4.0)
        push, _ = arc_tangent_field(x_error, 0.0, 0.2, 8.0)
        flyer.fly(course, SPEED + push, PERIOD)
    return flyer.north - SPEED * PERIOD * 1200, flyer.east


def test_each_reading_of_the_bearing_has_one_right_sign_and_diverges_sideways_or_along():
    # the follower 25 m behind and 30 m right, the slot 20 m behind and 20 m right: (5, -10) is true
    assert printed_errors(-25.0, 30.0, from_leader=True) == pytest.approx((5.0, 50.0))
    assert printed_errors(-25.0, 30.0, from_leader=False) == pytest.approx((-45.0, -10.0))
    # the course stays at pi/4, 20 m/s . sin = 14 m/s for a minute
    assert follow(partial(printed_errors, from_leader=True))[1] > 500.0
    # V_inf = 8 m/s too slow, for a minute
    assert follow(partial(printed_errors, from_leader=False))[0] < -400.0
    corrected = follow(lambda along, right: (SLOT[0] - along, SLOT[1] - right))
    assert corrected == pytest.approx(SLOT, abs=0.05)


# The Lyapunov function: V~^2 / (2 rho) is printed.


def off(along: float, right: float) -> FormationError:
    still = {"along_track_rate": 0.0, "cross_track_rate": 0.0}
    return FormationError(along_track=along, cross_track=right, **still)


def change_of_w(along: float, speed_error: float, weight: float) -> float:
    """dW/dt of a follower straight behind its slot, V~ weighted with weight/2; the law uses rho = 50."""
    push, slope = arc_tangent_field(along, 1.0, 0.2, 8.0)
    along_rate = -(push + speed_error)
    turn_of_field = slope * along_rate
    gains = {"gain": KAPPA, "layer": 0.75, "rho": 50.0}
    acceleration = sliding_acceleration(speed_error, along, turn_of_field, **gains)

    def value(time: float) -> float:
        changed = speed_error + (acceleration - turn_of_field) * time
        return lyapunov(off(along + along_rate * time, 0.0), 0.0, changed, weight)

    return (value(1e-6) - value(-1e-6)) / 2e-6


@pytest.mark.parametrize("along", [-40.0, -1.0, 0.5, 30.0])
@pytest.mark.parametrize("speed_error", [-3.0, -0.2, 0.5, 4.0])
def test_with_the_weight_rho_the_cross_terms_cancel(along, speed_error):
    # what is left is -x_E V_inf (2/pi) atan(k x_E) - rho kappa V~ sat(V~/epsilon)
    field = along * 8.0 * (2.0 / math.pi) * math.atan(0.2 * along)
    sliding = 50.0 * KAPPA * speed_error * max(-1.0, min(1.0, speed_error / 0.75))
    change = change_of_w(along, speed_error, 50.0)
    assert change == pytest.approx(-field - sliding, rel=1e-6, abs=1e-4)


def test_with_the_printed_weight_the_function_rises_and_the_corrected_is_half_the_squares():
    # x_E = 1, V~ = -3: -1.005 from the field, +3 (1 - 1/2500) not cancelled, -3 . 3/50 from the law = +1.81
    assert change_of_w(1.0, -3.0, 1.0 / 50.0) == pytest.approx(1.81, abs=0.01)
    # (9 + 16)/2 + 50 (0.25 + 0.01)/2 = 12.5 + 6.5
    assert lyapunov(off(3.0, 4.0), 0.1, 0.5, 50.0) == pytest.approx(19.0)
