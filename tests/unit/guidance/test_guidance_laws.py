"""Course law, speed law, their boundary layer and the limits of an aircraft."""

import math
from itertools import pairwise

import pytest
from msgspec.structs import replace

from tests.kit.states import Plant, choices, vehicle_at
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, saturation, speed_range
from vfguide.guidance.formation import SlotMotion
from vfguide.guidance.path import desired_course, desired_course_rate_per_speed
from vfguide.guidance.sliding_laws import (
    acceleration_toward,
    boundary_layer,
    course_command,
    sliding_acceleration,
    sliding_course_rate,
    speed_command,
)
from vfguide.laws import DesiredMotion, LeaderMotion, LeaderView, View
from vfguide.paths.line import Line
from vfguide.state import Airframe

KAPPA, ALPHA, BETA, SPEED = 3.0, 1.2, 0.8, 20.0


def test_saturation_is_the_value_inside_one_and_the_sign_outside():
    values = [-7.0, -1.0, -0.25, 0.0, 0.25, 1.0, 7.0]
    assert [saturation(value) for value in values] == [-1.0, -1.0, -0.25, 0.0, 0.25, 1.0, 1.0]


def test_a_bank_of_45_degrees_turns_20_m_s_at_0_49_rad_s():
    # 9.80665 tan(45 degrees) / 20 = 0.49033
    assert bank_limited_turn_rate(math.pi / 4.0, 20.0) == pytest.approx(0.4903, abs=1e-4)
    # 9.80665 tan(30 degrees) / 30 = 5.66187/30
    assert bank_limited_turn_rate(math.pi / 6.0, 30.0) == pytest.approx(0.18873, abs=1e-5)


@pytest.mark.parametrize(
    ("course", "slowest", "fastest"),
    [
        (0.0, 15.0, 3.0 + math.sqrt(375.0)),  # 3 + sqrt(13² - 5²), 3 + sqrt(20² - 5²)
        (math.pi / 2.0, 5.0 + math.sqrt(160.0), 5.0 + math.sqrt(391.0)),
        (math.pi, 9.0, -3.0 + math.sqrt(375.0)),
    ],
)
def test_a_ground_speed_hold_may_be_told_what_the_airspeed_range_comes_to_on_the_course(
    course, slowest, fastest
):
    # 13 to 20 m/s through an air that moves north by 3 and east by 5 m/s.
    airframe = Airframe(hold="course-hold", airspeed_min=13.0, airspeed_max=20.0)
    state = vehicle_at(course=course, wind=(3.0, 5.0))
    assert speed_range(state, airframe) == (pytest.approx(slowest), pytest.approx(fastest))
    assert speed_range(state, replace(airframe, hold="heading-hold")) == (13.0, 20.0)


def test_on_the_field_the_course_turns_with_it():
    assert sliding_course_rate(0.0, 0.13, KAPPA, 0.3) == 0.13


@pytest.mark.parametrize(("error", "rate"), [(0.1, -0.9), (-0.1, 1.1), (2.0, -2.9), (-2.0, 3.1)])
def test_off_the_field_the_law_turns_back_with_kappa_at_most(error, rate):
    # 0.1 - 3 sat(error / 0.3): a third of the layer gives 1 rad/s, beyond it 3 rad/s
    assert sliding_course_rate(error, 0.1, KAPPA, 0.3) == pytest.approx(rate)


def test_a_command_leads_by_the_rate_over_the_bandwidth():
    # 0.3 rad/s / 1.2 1/s = 0.25 rad ahead, 2 m/s² / 0.8 1/s = 2.5 m/s more
    assert course_command(1.0, 0.3, ALPHA) == pytest.approx(1.25)
    assert speed_command(20.0, 2.0, BETA) == pytest.approx(22.5)
    flyer = Plant(course=1.0, speed=20.0)
    flyer.fly(course_command(1.0, 0.3, ALPHA), speed_command(20.0, 2.0, BETA), 1e-4)
    assert (flyer.course - 1.0) / 1e-4 == pytest.approx(0.3, rel=1e-3)
    assert (flyer.speed - 20.0) / 1e-4 == pytest.approx(2.0, rel=1e-3)


def test_a_setpoint_that_stands_leads_by_half_of_that_time_more():
    # 1/1.2 + 0.05/2 = 0.858333 s and 1/0.8 + 0.05/2 = 1.275 s
    assert course_command(1.0, 0.3, ALPHA, 0.05) == pytest.approx(1.2575)
    assert speed_command(20.0, 2.0, BETA, 0.05) == pytest.approx(22.55)


def test_the_acceleration_toward_a_command_is_the_one_it_was_made_for():
    assert acceleration_toward(22.55, 20.0, BETA, 0.05) == pytest.approx(2.0)
    # ideal, 0.8 1/s of what is missing
    assert acceleration_toward(18.0, 20.0, BETA) == pytest.approx(-1.6)
    assert acceleration_toward(20.0, 20.0, BETA, 0.2) == 0.0


# A hold of bandwidth a answers a step d with d (1 - e^(-a T)) after T. With x = a T, the lead 1/a + T/2 turns
# T times (1/x + 1/2)(1 - e^-x) = 1 - x^2/12 + x^3/24 - ... of the rate, the lead 1/a alone 1 - x/2 + ...
@pytest.mark.parametrize("period", [0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("bandwidth", [ALPHA, BETA])
def test_what_has_a_setpoint_that_stands_changes_as_wanted_but_for_the_second_order(
    period, bandwidth
):
    leading, late = Plant(course=1.0), Plant(course=1.0)
    for plant, stands in ((leading, period), (late, 0.0)):
        for _ in range(10):
            if bandwidth == ALPHA:
                plant.fly(course_command(plant.course, 0.3, ALPHA, stands), SPEED, period)
            else:
                plant.fly(1.0, speed_command(plant.speed, 0.3, BETA, stands), period)
    changed = [one.course - 1.0 + one.speed - SPEED for one in (leading, late)]
    wanted, x = 0.3 * 10.0 * period, bandwidth * period
    assert x**2 / 12.0 - x**3 / 24.0 < 1.0 - changed[0] / wanted < x**2 / 12.0
    assert 1.0 - changed[1] / wanted == pytest.approx(x / 2.0, rel=0.1)


@pytest.mark.parametrize(
    ("speed_error", "along", "expected"),
    [
        (0.0, 0.0, 0.5),  # the field's own rate
        (0.0, 25.0, 1.0),  # + 25/50
        (0.3, 0.0, -0.7),  # - 3 . 0.3/0.75
        (-0.3, -25.0, 1.2),  # - 25/50 + 3 . 0.4
        (5.0, 0.0, -2.5),  # - 3
        (0.0, 1000.0, 1.5),  # 1000/50 = 20, held at kappa/3 = 1
        (0.0, -1000.0, -0.5),
        (0.0, 50.0, 1.5),  # 50/50 is that bound
    ],
)
def test_the_speed_law_adds_field_position_and_sliding(speed_error, along, expected):
    acceleration = sliding_acceleration(speed_error, along, 0.5, gain=KAPPA, layer=0.75, rho=50.0)
    assert acceleration == pytest.approx(expected)


def test_however_far_behind_the_position_term_never_outweighs_the_sliding_term():
    # V~ = +1 is too fast: however far ahead the slot is, the law brakes by kappa - kappa/3 = 2 m/s²
    rate = sliding_acceleration(1.0, 1e9, 0.0, gain=KAPPA, layer=0.75, rho=50.0)
    assert rate == pytest.approx(-2.0)


@pytest.mark.parametrize(
    ("period", "delay", "factor", "layer"),
    [
        (0.001, 0.0, 2.0, 0.01),  # 2 . 3 . 0.001 = 0.006 is less than the article's 0.01
        (0.05, 0.0, 2.0, 0.3),  # 2 . 3 . 0.05
        (0.05, 0.05, 2.0, 0.6),
        (0.05, 0.0, 3.5, 0.525),
    ],
)
def test_the_boundary_layer_follows_period_and_delay(period, delay, factor, layer):
    found = boundary_layer(KAPPA, 0.01, period=period, delay=delay, factor=factor)
    assert found == pytest.approx(layer)


@pytest.mark.parametrize(
    ("period", "layer"), [(0.005, 0.525), (0.01, 0.525), (0.02, 0.525), (0.05, 0.525), (0.1, 1.05)]
)
def test_a_loop_faster_than_twenty_hertz_keeps_the_layer_of_twenty_hertz(period, layer):
    # MAVLink's velocities are rounded to the same centimetres at any rate
    assert choices().sliding.layer(period) == pytest.approx(layer)


def fly_line(
    flyer: Plant, *, layer: float, period: float, delayed_samples: int, seconds: float
) -> tuple[float, float]:
    """(mean |chi~| in rad, total variation of the command per second in rad/s), after 30 s on a line."""
    line = Line(north=0.0, east=0.0, course=0.0)
    pending = [0.0] * delayed_samples
    errors, commands = [], []
    for step in range(round(seconds / period)):
        point = line.nearest(flyer.north, flyer.east)
        error = wrap_angle(flyer.course - desired_course(point, 0.03, math.pi / 2.0))
        rate = SPEED * desired_course_rate_per_speed(point, flyer.course, 0.03, math.pi / 2.0)
        turn = sliding_course_rate(error, rate, KAPPA, layer)
        pending.append(course_command(flyer.course, turn, ALPHA))
        command = pending.pop(0)
        flyer.fly(command, SPEED, period)
        if step * period >= 30.0:
            errors.append(abs(error))
            commands.append(command)
    variation = sum(abs(after - before) for before, after in pairwise(commands))
    return sum(errors) / len(errors), variation / (seconds - 30.0)


@pytest.mark.parametrize(
    ("period", "delayed_samples", "least_error", "least_variation"),
    [(0.02, 0, 0.02, 200.0), (0.02, 1, 0.04, 60.0), (0.05, 1, 0.1, 25.0)],
)
def test_the_literal_layer_limit_cycles_and_the_sampled_one_does_not(
    period, delayed_samples, least_error, least_variation
):
    literal = 0.01
    assert KAPPA * period / literal > 2.0  # beyond it, each sample overshoots the layer
    run = {"period": period, "delayed_samples": delayed_samples, "seconds": 60.0}
    error, variation = fly_line(Plant(east=20.0), layer=literal, **run)
    assert error > least_error
    assert variation > least_variation

    delay = delayed_samples * period
    layer = boundary_layer(KAPPA, literal, period=period, delay=delay, factor=2.0)
    error, variation = fly_line(Plant(east=20.0), layer=layer, **run)
    assert error < 0.001
    assert variation < 0.1


def test_just_inside_the_sampling_bound_the_law_settles():
    # kappa dt / epsilon = 1.9 and 2.1 at 20 ms
    run = {"period": 0.02, "delayed_samples": 0, "seconds": 120.0}
    _, inside = fly_line(Plant(east=20.0), layer=KAPPA * 0.02 / 1.9, **run)
    _, outside = fly_line(Plant(east=20.0), layer=KAPPA * 0.02 / 2.1, **run)
    assert inside < 0.1
    assert outside > 10.0


@pytest.mark.parametrize("named", [View, DesiredMotion, LeaderView, LeaderMotion, SlotMotion])
def test_what_laws_of_ones_own_name_may_have_its_numbers_in_brackets(named):
    assert named[float] is named
