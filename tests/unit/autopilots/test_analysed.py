"""A log held against the truth: a shifted clock changes no distance, a shifted place is reported."""

import numpy as np
import pytest

from tests.autopilots.analysed import Compared, clocks_of, compared
from tests.autopilots.formation import load
from tests.autopilots.true_tracks import TrueTrack
from tests.autopilots.verdict import flight_record
from tests.kit.missions import MISSIONS
from vfguide.elementwise import FloatArray
from vfguide.record.flight import FlightRecord

MISSION = load(
    MISSIONS / "ardupilot-sitl.yaml",
    {
        "followers": [{"vehicle": "f1", "slot": {"forward_m": 0, "right_m": 50}}],
        "vehicles": {"f2": None, "f3": None},
    },
)


def circle(angle: FloatArray, radius_m: float, north_m: float) -> TrueTrack:
    """Clockwise about a point north of the origin, 20 m/s at 250 m."""
    nothing = np.zeros_like(angle)
    return TrueTrack(
        north_m=north_m + radius_m * np.sin(angle),
        east_m=-radius_m * np.cos(angle),
        altitude_amsl_m=nothing,
        north_m_s=0.08 * radius_m * np.cos(angle),
        east_m_s=0.08 * radius_m * np.sin(angle),
        bank_rad=nothing,
        pace=1.0,
        lost_s=0.0,
        late_s=0.0,
    )


def flight(own_s: FloatArray, at_s: FloatArray, off_m: float = 0.0) -> FlightRecord:
    """A leader and a follower exactly in its slot 50 m to the right, as a clock tells it.

    Args:
        own_s: times of the clock.
        at_s: when that truly was.
        off_m: how far north the follower is said to be of where it is.
    """
    tracks = {
        "leader": circle(0.08 * at_s, 250.0, 300.0),
        "f1": circle(0.08 * at_s, 200.0, 300.0 + off_m),
    }
    return flight_record(MISSION, own_s, tracks, {})


TRUE_S = np.arange(0.0, 160.0, 0.04)
OWN_S = np.arange(0.0, 165.0, 0.04)


def test_a_clock_that_is_ahead_and_slow_is_found():
    # 5 s ahead at the beginning, and 0.99 s for each second.
    logged = flight(OWN_S, (OWN_S - 5.0) / 0.99)
    clocks = clocks_of(logged, flight(TRUE_S, TRUE_S))
    assert clocks.ahead_s == pytest.approx(5.0, abs=0.01)
    assert clocks.rate == pytest.approx(0.99, abs=1e-4)


def test_a_follower_that_its_log_has_beside_its_place_is_as_far_off_its_slot():
    logged = flight(OWN_S, OWN_S - 5.0, off_m=0.5)
    leader, follower = compared(logged, flight(TRUE_S, TRUE_S))
    assert leader.agrees
    assert follower.true_m == pytest.approx(0.0, abs=0.01)
    assert follower.logged_m == pytest.approx(0.5, abs=0.02)


def test_a_mean_that_is_farther_off_than_the_place_and_a_tenth_of_a_metre_does_not_agree():
    assert Compared(vehicle="f1", place_m=0.05, logged_m=0.34, true_m=0.25).agrees
    assert not Compared(vehicle="f1", place_m=0.05, logged_m=0.36, true_m=0.25).agrees
    assert Compared(vehicle="f1", place_m=0.2, logged_m=0.4, true_m=0.25).agrees
