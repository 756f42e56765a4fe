"""The motion of an aircraft that tells where it is, as its followers find it."""

import math

import pytest

from vfguide.guidance.formation import extrapolate_by_rates
from vfguide.guidance.leader_motion import (
    Observation,
    ObservedMotion,
    RateLimits,
    carried_on,
    observed_at_first,
    observed_motion,
)

SPEED, RADIUS = 20.0, 200.0
TURN_RATE = SPEED / RADIUS
LIMITS = RateLimits(turn_rate=0.6, acceleration=6.0)


def on_circle(time_s: float, *, velocity: bool = True) -> Observation:
    """Clockwise around a centre 200 m east of the start, north at first."""
    course = TURN_RATE * time_s
    return Observation(
        time_s=time_s,
        north=RADIUS * math.sin(course),
        east=RADIUS * (1.0 - math.cos(course)),
        velocity=(SPEED * math.cos(course), SPEED * math.sin(course)) if velocity else None,
    )


def circled(period: float, until_s: float, *, velocity: bool) -> ObservedMotion:
    motion = observed_at_first(on_circle(0.0), 0.0, SPEED)
    for step in range(1, round(until_s / period) + 1):
        seen = on_circle(step * period, velocity=velocity)
        motion = observed_motion(motion, seen, LIMITS, 0.6)
    return motion


@pytest.mark.parametrize("period", [0.1, 0.25, 1.0])
@pytest.mark.parametrize("velocity", [True, False])
def test_a_steady_turn_is_found_without_error(period: float, velocity: bool) -> None:
    state = circled(period, 40.0, velocity=velocity).state
    truth = on_circle(40.0)
    assert state.turn_rate == pytest.approx(TURN_RATE, abs=1e-3)
    assert state.ground_speed == pytest.approx(SPEED, abs=0.05)
    assert math.remainder(state.course - TURN_RATE * 40.0, math.tau) == pytest.approx(0.0, abs=2e-3)
    assert math.hypot(state.north - truth.north, state.east - truth.east) < 0.05


@pytest.mark.parametrize("velocity", [True, False])
def test_the_place_a_second_and_a_half_later_is_known_to_decimetres(velocity: bool) -> None:
    later = extrapolate_by_rates(circled(1.0, 40.0, velocity=velocity).state, 41.5)
    truth = on_circle(41.5)
    assert math.hypot(later.north - truth.north, later.east - truth.east) < 0.2


def test_a_course_that_jumps_turns_the_frame_no_faster_than_the_aircraft_can() -> None:
    motion = observed_at_first(on_circle(0.0), 0.0, SPEED)
    back = Observation(time_s=0.1, north=2.0, east=0.0, velocity=(-SPEED, 1.0))
    state = observed_motion(motion, back, LIMITS, 0.6).state
    assert abs(state.turn_rate) <= LIMITS.turn_rate
    assert abs(state.acceleration) <= LIMITS.acceleration


def test_a_silent_aircraft_is_carried_on_along_its_arc_at_one_speed() -> None:
    state = circled(0.25, 20.0, velocity=True).state
    later = carried_on(state, 10.0, 1.0)
    assert later.time_s == pytest.approx(21.0)
    assert (later.acceleration, later.turn_acceleration) == (0.0, 0.0)
    assert later.turn_rate == pytest.approx(TURN_RATE, abs=1e-3)


def test_one_that_was_just_heard_flies_by_all_its_rates() -> None:
    state = circled(0.25, 20.0, velocity=True).state
    assert carried_on(state, 0.5, 1.0) is state
