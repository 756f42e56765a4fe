"""Sensors like real ones: how far off, for how long, and what neighbours share."""

import math

import numpy as np
import pytest
from numpy.random import default_rng

from sitl_stub.sensor_errors import GaussMarkov, SensorErrors, SensorGrade


def errors_of(seed: int, system_id: int, grade: SensorGrade = "standalone") -> SensorErrors:
    """The errors of one aircraft."""
    return SensorErrors(grade, seed=seed, system_id=system_id)


def norths(system_id: int, *, count: int = 400) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Errors of an aircraft's first position on many flights."""
    return np.array([errors_of(seed, system_id).position_m(0.0)[0] for seed in range(count)])


def test_ideal_sensors_have_no_errors():
    ideal = errors_of(1, 1, "ideal")
    assert ideal.position_m(3.0) == (0.0, 0.0)
    assert ideal.velocity_m_s() == (0.0, 0.0)
    assert (ideal.altitude_m(3.0), ideal.heading_rad(), ideal.airspeed_m_s()) == (0.0, 0.0, 0.0)
    assert (ideal.calibration, ideal.clock_rate) == (1.0, 0.0)


def test_a_gauss_markov_process_keeps_its_variance_and_forgets_with_its_time():
    process = GaussMarkov(2.0, 30.0, default_rng(1))
    values = np.array([process.at(float(second)) for second in range(60_000)])
    assert np.std(values) == pytest.approx(2.0, rel=0.05)
    later = float(np.corrcoef(values[:-30], values[30:])[0, 1])
    assert later == pytest.approx(math.exp(-1.0), abs=0.05)


def test_neighbours_share_the_metres_and_differ_by_decimetres():
    one, other = norths(1), norths(2)
    # 1.26 m shared and 0.2 m of its own, on one axis; 0.28 m apart on it, 0.4 m on both.
    assert np.std(one) == pytest.approx(math.hypot(1.26, 0.2), rel=0.1)
    assert np.std(one - other) == pytest.approx(math.sqrt(2.0) * 0.2, rel=0.1)


def test_positions_wander_and_do_not_jump():
    errors = errors_of(5, 3)
    path = np.array([errors.position_m(0.05 * step)[0] for step in range(2400)])
    assert np.std(np.diff(path)) < 0.05
    assert np.ptp(path) > 0.2


def test_the_same_seed_gives_the_same_errors_however_often_they_are_asked_for():
    often, seldom = errors_of(9, 4), errors_of(9, 4)
    for second in range(100):
        often.altitude_m(float(second))
    shared_often = often.position_m(100.0)
    shared_seldom = seldom.position_m(100.0)
    # The white part differs, the wandering one is the same to the centimetre.
    assert shared_often == pytest.approx(shared_seldom, abs=0.15)


def test_a_better_receiver_is_better():
    spreads = [
        float(np.std([errors_of(seed, 1, grade).position_m(0.0)[0] for seed in range(200)]))
        for grade in ("rtk", "sbas", "standalone")
    ]
    assert spreads[0] < 0.02 < spreads[1] < spreads[2]
