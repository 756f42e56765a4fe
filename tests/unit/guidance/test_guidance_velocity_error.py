"""Errors of reported velocities, found by the positions that come with them."""

import math

import pytest
from msgspec.structs import replace

from vfguide.guidance.navigation import (
    Sample,
    velocity_error,
    velocity_error_at_first,
    with_right_velocity,
)

PERIOD, SPEED = 0.04, 15.0


def sample(step: int, *, wrong_north: float = 0.0, wrong_east: float = 0.0) -> Sample:
    """A vehicle that flies north; its velocity is reported wrong by so much (m/s)."""
    time_s = step * PERIOD
    return Sample(
        time_s=time_s,
        north=SPEED * time_s,
        east=0.0,
        velocity_north=SPEED + wrong_north,
        velocity_east=wrong_east,
        heading=0.0,
        airspeed=SPEED,
    )


def test_a_lasting_error_of_the_velocity_is_taken_off():
    error = velocity_error_at_first(sample(0, wrong_north=0.3, wrong_east=-0.2))
    for step in range(1, 100):
        error = velocity_error(error, sample(step, wrong_north=0.3, wrong_east=-0.2), 0.3)
    right = with_right_velocity(sample(99, wrong_north=0.3, wrong_east=-0.2), error)
    # After 4 s, thirteen memories: 13 e^-13 of the 0.3 m/s.
    assert right.velocity_north == pytest.approx(SPEED, abs=1e-4)
    assert right.velocity_east == pytest.approx(0.0, abs=1e-4)


def test_a_velocity_that_is_right_stays_as_it_is():
    error = velocity_error_at_first(sample(0))
    for step in range(1, 100):
        error = velocity_error(error, sample(step), 0.3)
        assert abs(error.short_north) < 1e-9
        assert error.north == pytest.approx(SPEED * step * PERIOD)


def test_half_of_a_step_in_the_error_is_found_after_1_68_memories():
    """A double pole answers with 1 - (1 + t/T) e^(-t/T)."""
    error = velocity_error_at_first(sample(0))
    steps = round(1.678 * 1.0 / PERIOD)
    for step in range(1, steps + 1):
        error = velocity_error(error, sample(step, wrong_east=0.4), 1.0)
    assert -error.short_east == pytest.approx(0.4 * 0.5, rel=0.05)


def test_noise_of_positions_comes_through_as_the_memory_says():
    """One position 1 m off moves the velocity by rate_gain / period of it: (1 - e^(-dt/T))^2 / dt."""
    error = velocity_error_at_first(sample(0))
    off = replace(sample(1), north=sample(1).north + 1.0)
    error = velocity_error(error, off, 0.3)
    assert error.short_north == pytest.approx((1.0 - math.exp(-PERIOD / 0.3)) ** 2 / PERIOD)
