"""What an autopilot is told, the limits that cut it, and the ground-speed observer in the law."""

import math
from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.states import Plant, vehicle_at
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import bank_limited_turn_rate, ground_speed_on_course
from vfguide.guidance.path import desired_course, desired_course_rate_per_speed
from vfguide.guidance.sliding_laws import (
    ObserverGains,
    course_command,
    cruise_setpoint,
    heading_hold,
    setpoint_for,
    sliding_course_rate,
    speed_estimate_rate,
)
from vfguide.paths.circle import Circle
from vfguide.state import Airframe, VehicleState

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=300)
HEADING_HOLD, COURSE_HOLD = Airframe(), Airframe(hold="course-hold")
ANY = st.floats(-1e6, 1e6)


@st.composite
def states(draw: st.DrawFn) -> VehicleState:
    """Any state a vehicle could report, whether or not its triangle closes."""
    angle, speed, wind = st.floats(-10.0, 10.0), st.floats(1.0, 100.0), st.floats(-60.0, 60.0)
    place = {"north": draw(ANY), "east": draw(ANY), "course": draw(angle), "heading": draw(angle)}
    speeds = {"ground_speed": draw(speed), "airspeed": draw(speed)}
    blows = {"wind_north": draw(wind), "wind_east": draw(wind)}
    names = ("wind_rate_north", "wind_rate_east", "wind_jerk_north", "wind_jerk_east")
    rates = {name: draw(st.floats(-20.0, 20.0)) for name in names}
    return VehicleState(time_s=0.0, **place, **speeds, **blows, **rates)


@pytest.mark.parametrize("hold", [0.0, 0.05, 0.2])
@pytest.mark.parametrize("airframe", [HEADING_HOLD, COURSE_HOLD])
def test_however_long_it_stands_the_setpoint_of_a_cruise_is_its_airspeed(airframe, hold):
    state = vehicle_at(ground_speed=18.0)
    setpoint = cruise_setpoint(state, 20.0, 0.0, airframe, wind_feedforward=True, hold=hold)
    assert setpoint.speed == pytest.approx(20.0)


def test_the_heading_hold_gets_airspeed_and_the_course_hold_ground_speed():
    state = vehicle_at(ground_speed=26.0, wind=(5.0, 0.0))
    assert setpoint_for(state, 0.0, 0.0, HEADING_HOLD, wind_feedforward=True).speed == 21.0
    assert setpoint_for(state, 0.0, 0.0, COURSE_HOLD, wind_feedforward=True).speed == 26.0


def test_a_heading_hold_is_given_a_course_ahead_by_the_heading_rate():
    # north at 20 m/s in a wind of 15 m/s toward the east: V_a = 25, heading cos = 0.8
    state = vehicle_at(wind=(0.0, 15.0))
    setpoint = setpoint_for(state, 0.0, 0.12, HEADING_HOLD, wind_feedforward=True)
    # V_g dchi/dt = 2.4 m/s² to the right: 2.4 . 0.8 right of the heading = 1.92 m/s², / 25 = 0.0768 rad/s,
    # and 2.4 sin(36.87 degrees) = -1.44 m/s² along it: the nose points left of the course
    assert setpoint.course == pytest.approx(0.0768 / 1.2)
    assert setpoint.speed == pytest.approx(25.0 - 1.44 / 0.8)


@pytest.mark.parametrize("airframe", [HEADING_HOLD, COURSE_HOLD])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_turn_is_cut_at_the_bank_limit(airframe, side):
    setpoint = setpoint_for(vehicle_at(), 0.0, side * 3.0, airframe, wind_feedforward=True)
    # 0.49033 rad/s at 20 m/s and 45 degrees, over 1.2
    assert setpoint.course == pytest.approx(side * 0.40861, abs=1e-5)
    assert setpoint.limited


@pytest.mark.parametrize("airframe", [HEADING_HOLD, COURSE_HOLD])
@pytest.mark.parametrize(
    ("speed", "acceleration", "wanted"),
    # 3 m/s² are allowed; 33.5 m/s is beyond the range
    [(20.0, 9.0, 23.75), (20.0, -9.0, 16.25), (31.0, 2.0, 32.0), (13.0, -2.0, 12.0)],
)
def test_speed_is_cut_at_acceleration_and_airspeed_range(airframe, speed, acceleration, wanted):
    state = vehicle_at(ground_speed=speed)
    setpoint = setpoint_for(state, acceleration, 0.0, airframe, wind_feedforward=True)
    assert setpoint.speed == pytest.approx(wanted)
    assert setpoint.limited


def test_a_course_hold_is_bounded_by_its_airspeed_through_the_wind():
    # in a head wind of 10 m/s, 12 to 32 m/s of airspeed are 2 to 22 m/s over the ground
    state = vehicle_at(ground_speed=21.0, wind=(-10.0, 0.0))
    fast = setpoint_for(state, 3.0, 0.0, COURSE_HOLD, wind_feedforward=True)
    assert (fast.speed, fast.limited) == (22.0, True)


@REPEATABLE
@given(state=states(), airspeed_rate=ANY, heading_rate=ANY)
def test_whatever_is_asked_the_heading_hold_stays_within_limits(state, airspeed_rate, heading_rate):
    setpoint = heading_hold(state, airspeed_rate, heading_rate, HEADING_HOLD)
    limit = bank_limited_turn_rate(HEADING_HOLD.max_bank, state.airspeed)
    assert abs(setpoint.course - state.course) * 1.2 <= limit * (1.0 + 1e-9) + 1e-9
    assert 12.0 <= setpoint.speed <= 32.0
    unlimited = state.airspeed + airspeed_rate / 0.8
    cut = abs(heading_rate) > limit or abs(airspeed_rate) > 3.0 or not 12.0 <= unlimited <= 32.0
    assert setpoint.limited is cut


@REPEATABLE
@given(state=states(), acceleration=ANY, course_rate=ANY)
def test_whatever_is_asked_the_course_hold_stays_within_limits(state, acceleration, course_rate):
    setpoint = setpoint_for(state, acceleration, course_rate, COURSE_HOLD, wind_feedforward=True)
    limit = bank_limited_turn_rate(COURSE_HOLD.max_bank, state.ground_speed)
    assert abs(setpoint.course - state.course) * 1.2 <= limit * (1.0 + 1e-9) + 1e-9
    slowest, fastest = (
        ground_speed_on_course(airspeed, state.course, state.wind_north, state.wind_east)
        for airspeed in (12.0, 32.0)
    )
    assert slowest <= setpoint.speed <= fastest
    within = slowest <= state.ground_speed + acceleration / 0.8 <= fastest
    cut = abs(course_rate) > limit or abs(acceleration) > 3.0 or not within
    assert setpoint.limited is cut
    # As finite are both holds, whatever is fed forward.
    for airframe, fed in product((HEADING_HOLD, COURSE_HOLD), (True, False)):
        found = setpoint_for(state, acceleration, course_rate, airframe, wind_feedforward=fed)
        assert math.isfinite(found.course + found.speed)


GAINS = ObserverGains(gamma=2.0, rho=200.0, sigma=0.5)


def test_a_course_error_along_the_regressor_lowers_the_estimate():
    # -Gamma rho chi~ phi = -2 . 200 . 0.1 . 0.01
    assert speed_estimate_rate(20.0, 20.0, 0.1, 0.01, GAINS) == pytest.approx(-0.4)
    assert speed_estimate_rate(20.0, 20.0, 0.1, -0.01, GAINS) == pytest.approx(0.4)


def test_the_adaptation_brings_the_estimate_nearer_than_the_reference():
    circle, gains = Circle(north=0, east=0, radius=60, direction=1), replace(GAINS, rho=1e5)
    flyer, estimate, field = Plant(north=60.0, course=math.pi / 2.0), 20.0, (0.03, math.pi / 2.0)
    # At 25 m/s with the estimate alone in the law; the reference is an airspeed of 20 m/s.
    for _ in range(15_000):
        point = circle.nearest(flyer.north, flyer.east)
        error = wrap_angle(flyer.course - desired_course(point, *field))
        regressor = desired_course_rate_per_speed(point, flyer.course, *field)
        estimate += 0.002 * speed_estimate_rate(estimate, 20.0, error, regressor, gains)
        turn = sliding_course_rate(error, estimate * regressor, 3.0, 0.3)
        flyer.fly(course_command(flyer.course, turn, 1.2), 25.0, 0.002)
    # at rest kappa chi~/epsilon = 10 chi~ = (V^ - V) phi and rho chi~ phi = sigma (V_ref - V^), phi = 1/60:
    # 2.7778 (25 - V^) = 0.5 (V^ - 20)
    assert estimate == pytest.approx((2.7778 * 25.0 + 0.5 * 20.0) / 3.2778, abs=0.1)
