"""The navigation filter: noise down, no lag, wind and ground speed found, wrong velocities put right."""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.records import article_wind
from tests.kit.states import choices
from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import polar
from vfguide.guidance.navigation import (
    FilterTimes,
    Sample,
    first_state,
    gusts_after,
    navigate,
    navigate_blind,
    velocity_error,
    velocity_error_at_first,
    with_right_velocity,
)
from vfguide.guidance.sliding_laws import foretold_share
from vfguide.state import Airframe, VehicleState

TIMES = FilterTimes(position_s=2.0, wind_s=0.2)
PERIOD, AIRSPEED, HEADING = 0.05, 20.0, 0.6
Track = Callable[[float], Sample]
Filter = Callable[[VehicleState, Sample, FilterTimes], VehicleState]


def windy(
    time: float, farther: tuple[float, float] = (0.0, 0.0), faster: tuple[float, float] = (0.0, 0.0)
) -> Sample:
    """Straight flight at 20 m/s through a wind of (5, -3) m/s, and so much (north, east) beside it."""
    north = AIRSPEED * math.cos(HEADING) + 5.0
    east = AIRSPEED * math.sin(HEADING) - 3.0
    return Sample(
        time_s=time,
        north=north * time + farther[0],
        east=east * time + farther[1],
        velocity_north=north + faster[0],
        velocity_east=east + faster[1],
        heading=HEADING,
        airspeed=AIRSPEED,
    )


def steady_wind(time: float) -> Sample:
    return windy(time)


def growing_wind(time: float) -> Sample:
    """A wind that grows by (0.8, -0.5) m/s every second."""
    return windy(time, (0.4 * time * time, -0.25 * time * time), (0.8 * time, -0.5 * time))


def turning_wind(time: float) -> Sample:
    """A wind whose growth grows by (0.3, -0.2) m/s² every second."""
    farther = (0.05 * time**3, -0.1 / 3.0 * time**3)
    return windy(time, farther, (0.15 * time * time, -0.1 * time * time))


def run(track: Track, seconds: float, step: Filter = navigate) -> list[VehicleState]:
    states = [first_state(track(0.0))]
    for index in range(1, round(seconds / PERIOD) + 1):
        states.append(step(states[-1], track(index * PERIOD), TIMES))
    return states


def miss(state: VehicleState, truth: Sample) -> float:
    return math.hypot(state.north - truth.north, state.east - truth.east)


def test_at_constant_velocity_there_is_no_lag():
    for index, state in enumerate(run(steady_wind, 20.0)):
        assert miss(state, steady_wind(index * PERIOD)) < 1e-9
        assert state.wind_rate_north == pytest.approx(0.0, abs=1e-9)


def test_in_a_steadily_growing_wind_there_is_no_lag_either_and_its_rate_is_found_in_two_seconds():
    states = run(growing_wind, 30.0)
    # a first-order filter of 0.2 s would be 0.2 . 0.8 = 0.16 m/s behind
    assert states[-1].wind_north == pytest.approx(5.0 + 0.8 * 30.0, abs=1e-6)
    assert states[-1].wind_east == pytest.approx(-3.0 - 0.5 * 30.0, abs=1e-6)
    assert miss(states[-1], growing_wind(30.0)) < 1e-4
    # 40 samples: memory^40 = e^(-40 . 0.05/0.2), times the powers of 40 that it comes with, is 0.4 %
    assert states[40].wind_rate_north == pytest.approx(0.8, rel=0.01)
    assert states[40].wind_rate_east == pytest.approx(-0.5, rel=0.01)
    assert states[2].wind_rate_north < 0.4


def test_in_a_wind_whose_growth_grows_course_and_speed_stay_exact():
    state = run(turning_wind, 10.0)[-1]
    # a filter without the rate's rate would be 0.2² . 0.3 = 0.012 m/s behind, and the rate 2 . 0.2 . 0.3 m/s²
    assert state.wind_north == pytest.approx(5.0 + 0.15 * 100.0, abs=1e-6)
    assert state.wind_rate_north == pytest.approx(0.3 * 10.0, abs=1e-6)
    assert state.wind_rate_east == pytest.approx(-0.2 * 10.0, abs=1e-6)
    assert (state.wind_jerk_north, state.wind_jerk_east) == pytest.approx((0.3, -0.2), abs=1e-6)


def test_without_memory_the_filter_passes_reports_through():
    random = np.random.default_rng(4)
    samples = []
    for true in (growing_wind(number * PERIOD) for number in range(3)):
        north, east = random.normal(0.0, 3.0, 2).tolist()
        samples.append(replace(true, north=true.north + north, east=true.east + east))
    state = first_state(samples[0])
    for sample in samples[1:]:
        state = navigate(state, sample, FilterTimes(position_s=0.0, wind_s=0.0))
        assert miss(state, sample) < 1e-9
        found = polar(state.ground_speed, state.course)
        assert found == pytest.approx((sample.velocity_north, sample.velocity_east))
    # the difference of two winds 0.05 s apart
    assert state.wind_rate_north == pytest.approx(0.8)


def with_wrong_speed(track: Track, time: float) -> Sample:
    """The ground velocity twice as fast as it is: its course is right."""
    true = track(time)
    wrong = {"velocity_north": 2.0 * true.velocity_north, "velocity_east": 2.0 * true.velocity_east}
    return replace(true, **wrong)


@pytest.mark.parametrize(("track", "growth"), [(steady_wind, (0, 0)), (growing_wind, (0.8, -0.5))])
def test_blind_the_filter_finds_ground_speed_and_wind_from_positions(track, growth):
    state = run(partial(with_wrong_speed, track), 12.0, step=navigate_blind)[-1]
    truth = track(12.0)
    speed = math.hypot(truth.velocity_north, truth.velocity_east)
    assert state.ground_speed == pytest.approx(speed, abs=0.01)
    assert state.course == pytest.approx(math.atan2(truth.velocity_east, truth.velocity_north))
    assert miss(state, truth) < 1e-3
    assert state.wind_north == pytest.approx(5.0 + growth[0] * 12.0, abs=0.01)
    assert (state.wind_rate_north, state.wind_rate_east) == pytest.approx(growth, abs=0.01)


def test_blind_the_course_is_the_reported_one():
    north, east = polar(5.0, 1.0)
    report = replace(steady_wind(PERIOD), velocity_north=north, velocity_east=east)
    state = navigate_blind(first_state(steady_wind(0.0)), report, TIMES)
    # the positions are those of the course 0.368 rad, and so is the speed
    assert state.course == pytest.approx(1.0)
    assert state.ground_speed == pytest.approx(23.0502, abs=1e-4)


def test_a_turn_in_steady_wind_is_not_taken_for_wind():
    # 20 m/s, heading rate 0.3 rad/s, in wind (4, 2): the exact track
    def turning(time: float) -> Sample:
        heading = 0.3 * time
        return Sample(
            time_s=time,
            north=20.0 / 0.3 * math.sin(heading) + 4.0 * time,
            east=20.0 / 0.3 * (1.0 - math.cos(heading)) + 2.0 * time,
            velocity_north=20.0 * math.cos(heading) + 4.0,
            velocity_east=20.0 * math.sin(heading) + 2.0,
            heading=heading,
            airspeed=20.0,
        )

    for index, state in enumerate(run(turning, 30.0)):
        assert (state.wind_north, state.wind_east) == pytest.approx((4.0, 2.0), abs=1e-9)
        # the mean of two velocities is the chord but for (0.3 . 0.05)²/12: 0.4 mm/s
        assert miss(state, turning(index * PERIOD)) < 1e-3


SAMPLE_S, SPEED = 0.04, 15.0


def sample(step: int, *, wrong_north: float = 0.0, wrong_east: float = 0.0) -> Sample:
    """A vehicle that flies north; its velocity is reported wrong by so much (m/s)."""
    time_s = step * SAMPLE_S
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
    wrong = [sample(step, wrong_north=0.3, wrong_east=-0.2) for step in range(100)]
    error = velocity_error_at_first(wrong[0])
    for one in wrong[1:]:
        error = velocity_error(error, one, 0.3)
    right = with_right_velocity(wrong[-1], error)
    # After 4 s, thirteen memories: 13 e^-13 of the 0.3 m/s.
    assert (right.velocity_north, right.velocity_east) == pytest.approx((SPEED, 0.0), abs=1e-4)


def test_noise_of_positions_comes_through_as_the_memory_says():
    # One position 1 m off moves the velocity by rate_gain / period of it: (1 - e^(-dt/T))^2 / dt.
    off = replace(sample(1), north=sample(1).north + 1.0)
    error = velocity_error(velocity_error_at_first(sample(0)), off, 0.3)
    assert error.short_north == pytest.approx((1.0 - math.exp(-SAMPLE_S / 0.3)) ** 2 / SAMPLE_S)


SLOWER = FilterTimes(position_s=2.0, wind_s=0.35)


def navigated(winds: FloatArray, noise: FloatArray | None = None) -> list[VehicleState]:
    """North at 20 m/s through winds (n, 2), each for one report; noise (n, 2) is on the reported velocity."""
    states: list[VehicleState] = []
    north = east = 0.0
    for step, (wind_north, wind_east) in enumerate(winds):
        off = (0.0, 0.0) if noise is None else noise[step]
        sample = Sample(
            time_s=step * PERIOD,
            north=north,
            east=east,
            velocity_north=AIRSPEED + float(wind_north + off[0]),
            velocity_east=float(wind_east + off[1]),
            heading=0.0,
            airspeed=AIRSPEED,
        )
        states.append(navigate(states[-1], sample, SLOWER) if states else first_state(sample))
        north += (AIRSPEED + float(wind_north)) * PERIOD
        east += float(wind_east) * PERIOD
    return states


def random_walk(seconds: float, step_m_s: float = 0.18) -> FloatArray:
    """Moderate turbulence at 20 m/s: 2.1 m/s with 262 m, so 2.1 sqrt(2 * 20 / 262 * 0.05) = 0.18 a step."""
    steps = np.random.default_rng(3).normal(0.0, step_m_s, (round(seconds / PERIOD), 2))
    return np.cumsum(steps, axis=0)


def test_a_wind_that_swings_smoothly_is_no_gust():
    rounding = np.random.default_rng(5).uniform(-0.005, 0.005, (1200, 2))
    states = navigated(np.column_stack(article_wind(np.arange(1200) * PERIOD)), rounding)
    # At first the swing is unknown: its 2 m/s² look like a gust, until the filter has found the rate.
    assert max(state.gust_share for state in states) < 0.4
    assert max(state.gust_share for state in states[240:]) < 0.05


def test_turbulence_is_found_within_seconds_and_then_nothing_lags_behind_it():
    winds = random_walk(30.0)
    states = navigated(winds)
    assert states[120].gust_share > 0.7
    found = np.array([(state.wind_north, state.wind_east) for state in states[300:]])
    # The filter of smooth air takes 1 - exp(-3 * 0.05 / 0.35) = 0.35 of each surprise, and leaves 0.65 of it.
    assert np.linalg.norm(found - winds[300:], axis=1).mean() < 0.5 * 0.65 * 0.18


def test_innovations_that_are_all_alike_count_as_gusts_after_about_a_second():
    gusts = None
    for _ in range(30):
        gusts = gusts_after(gusts, 1.0, 0.0, PERIOD)
    # Of 1 m/s, once 0.15 m/s squared counts little: a likeness of 1, less 0.1, for 29 steps of 0.05 s.
    assert gusts.share == pytest.approx(1.0, abs=0.01)
    for step in range(200):
        gusts = gusts_after(gusts, (-1.0) ** step, 0.0, PERIOD)
    assert gusts.share == 0.0


def in_gusts(share: float) -> VehicleState:
    """A vehicle that has found this share of gusts in its wind."""
    still = navigated(np.zeros((2, 2)))[-1]
    return replace(still, gusts=replace(gusts_after(None, 0.0, 0.0, PERIOD), share=share))


def test_in_gusts_the_rate_of_the_wind_is_not_fed_forward():
    assert foretold_share(in_gusts(0.0), wind_feedforward=True) == 1.0
    assert foretold_share(in_gusts(0.8), wind_feedforward=True) == pytest.approx(0.2)
    assert foretold_share(in_gusts(0.8), wind_feedforward=False) == 0.0


@pytest.mark.parametrize(
    ("factor", "share", "layer"),
    [
        # 4.8 . 3 . 0.05 s in smooth air, 2.5 . 3 . 0.05 s in gusts, and half way between them.
        (4.8, 0.0, 0.72),
        (4.8, 1.0, 0.375),
        (4.8, 0.5, 0.5475),
        # One that is narrower already stays so.
        (2.1, 1.0, 2.1 * 3.0 * 0.05),
    ],
)
def test_in_gusts_the_layer_is_as_narrow_as_the_sampled_loop_allows(factor, share, layer):
    sliding = replace(choices().sliding, boundary_layer_factor=factor)
    state = in_gusts(share)
    assert sliding.layer_in(state, Airframe(), 0.05) == pytest.approx(layer)
    # An autopilot that answers late has no quicker answer to give.
    late = sliding.layer_in(state, Airframe(course_lag=0.3), 0.05)
    assert late == pytest.approx(factor * 3.0 * 0.05)
