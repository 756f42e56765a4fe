"""A live flight as `vfguide.fly` gives it to a program."""

import pytest

import vfguide
from tests.kit.missions import MISSIONS
from vfguide.errors import InputError

MISSION = MISSIONS / "line-calm.yaml"


def test_a_live_flight_is_flown_from_python_with_real_programs():
    mission = vfguide.load_mission(MISSION)
    flight = vfguide.fly(mission, live=True, speedup=2.0, duration_s=6.0)
    assert (flight.summary.mode, list(flight.tracks)) == ("live", ["leader", "f1", "f2", "f3"])
    assert flight.summary.duration_s == pytest.approx(6.0, abs=1.0)
    with pytest.raises(InputError, match="speedup: 0 is not above 0"):
        vfguide.fly(mission, live=True, speedup=0.0)
