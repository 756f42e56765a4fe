"""Four rigid aircraft in moderate turbulence, with standalone receivers and a link that loses a tenth."""

import numpy as np
import pytest

import vfguide
from tests.kit.missions import content_of, shipped
from vfguide.mission import Mission

MISSION = shipped("aerosonde-gusts")


def roll_rate(flight: vfguide.Flight, name: str) -> float:
    """Root mean square over the last half of a flight, rad/s."""
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    rates = np.gradient(flight.tracks[name].bank_rad[settled], flight.time_s[settled])
    return float(np.sqrt(np.mean(rates**2)))


@pytest.fixture(scope="module")
def flight() -> vfguide.Flight:
    """The mission as it comes, half as long."""
    return vfguide.fly(MISSION, duration_s=120.0)


def test_followers_are_nearer_to_the_slots_as_meant_than_the_best_flown_figure_known(flight):
    # Wilson (ACFR) flew 1.2 m, with cameras.
    assert flight.summary.formation.intended_error_m < 1.2


def test_their_barometers_drift_apart_and_they_fly_at_one_height_all_the_same(flight):
    # Each barometer drifts by 2 m: followers that go by theirs are 3.5 m off (rms).
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    leader = flight.tracks["leader"].altitude_amsl_m
    above = [flight.tracks[name].altitude_amsl_m - leader for name in flight.errors]
    assert np.sqrt(np.mean(np.square(above)[:, settled])) < 1.0


def test_they_neither_work_at_their_limits_nor_roll_much_more_than_a_lone_aircraft(flight):
    settled = flight.time_s >= flight.time_s[-1] / 2.0
    limited = [flight.tracks[name].limited[settled].mean() for name in flight.errors]
    assert np.mean(limited) < 0.05
    alone = roll_rate(flight, "leader")
    rates = [roll_rate(flight, name) for name in flight.errors]
    assert np.sqrt(np.mean(np.square(rates))) < 1.3 * alone
    # The outer one flies fastest, and through a rougher ride.
    assert max(rates) < 1.6 * alone


def test_their_leader_flies_as_it_would_alone(flight):
    content = content_of(MISSION)
    leader = content["vehicles"]["leader"]
    alone = Mission.model_validate(content | {"followers": (), "vehicles": {"leader": leader}})
    by_itself = vfguide.fly(alone, duration_s=30.0).tracks["leader"].bank_rad
    banks = flight.tracks["leader"].bank_rad[: by_itself.size]
    assert np.array_equal(banks, by_itself)
