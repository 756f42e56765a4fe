"""What a leader tells of its own motion."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.states import vehicle_at
from vfguide.guidance.airframe import polar
from vfguide.guidance.formation import extrapolate_by_rates
from vfguide.guidance.leader_motion import (
    Observation,
    ObservedMotion,
    RateLimits,
    carried_on,
    estimated_motion,
    motion_at_first,
    observed_at_first,
    observed_motion,
)
from vfguide.state import Airframe, LeaderState, VehicleState

PERIOD, FILTER = 0.05, 0.4
AIRFRAME = Airframe()


def estimates(states: list[VehicleState], time_constant: float = FILTER) -> LeaderState:
    motion = motion_at_first(states[0])
    for state in states[1:]:
        motion = estimated_motion(motion, state, AIRFRAME, time_constant)
    return motion.state


def moving(*, turn_rate: float = 0.0, acceleration: float = 0.0) -> list[VehicleState]:
    """6 s of a leader that turns and accelerates steadily, its course within (-pi, pi]."""
    start = math.copysign(3.0, turn_rate)
    times = [index * PERIOD for index in range(round(6.0 / PERIOD) + 1)]
    return [
        vehicle_at(
            course=math.remainder(start + turn_rate * time, 2.0 * math.pi),
            ground_speed=20.0 + acceleration * time,
            time_s=time,
        )
        for time in times
    ]


@pytest.mark.parametrize("turn_rate", [0.1333, -0.1333])
def test_on_a_steady_turn_the_turn_rate_is_found_through_south(turn_rate):
    # 0.14 rad before south, the course jumps by 2 pi after 1 s, which is no turn the other way
    motion = estimates(moving(turn_rate=turn_rate))
    # 6 s are 15 time constants: (1 - 120 (1 - m)) m^120 is missing, m = e^(-0.05/0.4), 4e-6 beyond
    assert motion.turn_rate == pytest.approx(turn_rate, rel=1e-5)
    assert motion.turn_acceleration == pytest.approx(0.0, abs=1e-5)
    assert motion.acceleration == 0.0


def test_a_steady_acceleration_is_found():
    motion = estimates(moving(acceleration=1.5))
    assert motion.acceleration == pytest.approx(1.5, rel=1e-4)
    assert motion.ground_speed == pytest.approx(29.0)


@pytest.mark.parametrize("outlier", [1.0, -2.0, 3.0])
def test_an_outlier_turns_the_slot_frame_a_little_only(outlier):
    states = [vehicle_at(), vehicle_at(course=outlier, ground_speed=90.0, time_s=PERIOD)]
    # 20 rad/s and more are held at g tan(45 degrees)/12 = 0.81722 rad/s, and the speed at twice 3 m/s², of
    # which 1 - e^(-1/4) is taken
    motion = estimates(states)
    assert abs(motion.turn_rate) == pytest.approx(0.81722 * 0.221199, abs=1e-5)
    assert math.copysign(1.0, motion.turn_rate) == math.copysign(1.0, outlier)
    assert motion.acceleration == pytest.approx(6.0 * 0.221199, abs=1e-5)
    # A steeper bank allows a faster turn: 9.80665 tan(60 degrees)/12
    steep = replace(AIRFRAME, max_bank=math.radians(60.0))
    unfiltered = estimated_motion(motion_at_first(states[0]), states[1], steep, 0.0)
    assert abs(unfiltered.state.turn_rate) == pytest.approx(1.41547, abs=1e-5)


def test_however_wild_the_courses_the_turn_rate_stays_within_the_bank_limit():
    random = np.random.default_rng(5)
    motion = motion_at_first(vehicle_at())
    for index in range(1, 500):
        course, speed = random.uniform((-math.pi, 1.0), (math.pi, 60.0)).tolist()
        wild = vehicle_at(course=course, ground_speed=speed, time_s=index * PERIOD)
        motion = estimated_motion(motion, wild, AIRFRAME, FILTER)
        assert abs(motion.state.turn_rate) <= 0.8173
        assert abs(motion.state.acceleration) <= 6.0


SPEED, RADIUS = 20.0, 200.0
TURN_RATE = SPEED / RADIUS
LIMITS = RateLimits(turn_rate=0.6, acceleration=6.0)


def on_circle(time_s: float, *, velocity: bool = True) -> Observation:
    """Clockwise around a centre 200 m east of the start, north at first."""
    course = TURN_RATE * time_s
    north, east = RADIUS * math.sin(course), RADIUS * (1.0 - math.cos(course))
    known = polar(SPEED, course) if velocity else None
    return Observation(time_s=time_s, north=north, east=east, velocity=known)


def circled(period: float, until_s: float, *, velocity: bool) -> ObservedMotion:
    motion = observed_at_first(on_circle(0.0), 0.0, SPEED)
    for step in range(1, round(until_s / period) + 1):
        seen = on_circle(step * period, velocity=velocity)
        motion = observed_motion(motion, seen, LIMITS, 0.6)
    return motion


@pytest.mark.parametrize("period", [0.1, 0.25, 1.0])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_steady_turn_is_found_without_error(period, velocity):
    state = circled(period, 40.0, velocity=velocity).state
    truth = on_circle(40.0)
    assert state.turn_rate == pytest.approx(TURN_RATE, abs=1e-3)
    assert state.ground_speed == pytest.approx(SPEED, abs=0.05)
    assert math.remainder(state.course - TURN_RATE * 40.0, math.tau) == pytest.approx(0.0, abs=2e-3)
    assert math.hypot(state.north - truth.north, state.east - truth.east) < 0.05
    # The place a second and a half later is known to decimetres.
    later, truth = extrapolate_by_rates(state, 41.5), on_circle(41.5)
    assert math.hypot(later.north - truth.north, later.east - truth.east) < 0.2


def test_a_silent_aircraft_is_carried_on_along_its_arc_at_one_speed():
    state = circled(0.25, 20.0, velocity=True).state
    later = carried_on(state, 10.0, 1.0)
    assert later.time_s == pytest.approx(21.0)
    assert (later.acceleration, later.turn_acceleration) == (0.0, 0.0)
    assert later.turn_rate == pytest.approx(TURN_RATE, abs=1e-3)
    # One that was just heard flies by all its rates.
    assert carried_on(state, 0.5, 1.0) is state
