"""Gusts: the wind filter learns how gusty the air is, and what its rate is then good for."""

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.records import article_wind
from tests.kit.states import choices
from vfguide.elementwise import FloatArray
from vfguide.guidance.navigation import FilterTimes, Sample, first_state, gusts_after, navigate
from vfguide.guidance.sliding_laws import foretold_share
from vfguide.state import Airframe, VehicleState

TIMES = FilterTimes(position_s=2.0, wind_s=0.35)
PERIOD, AIRSPEED = 0.05, 20.0


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
        states.append(navigate(states[-1], sample, TIMES) if states else first_state(sample))
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
