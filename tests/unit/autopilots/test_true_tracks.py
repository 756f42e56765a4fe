"""The common time base of several simulators, from reports that come late and clocks that lose time."""

from random import Random
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from tests.autopilots.ground_station import GroundStation
from tests.autopilots.true_tracks import TrueTrack, true_track
from tests.autopilots.verdict import back_after
from vfguide.frames import LocalFrame

SPEED_M_S = 20.0
FRAME = LocalFrame(-35.0, 149.0, 500.0)
TIMES_S = np.arange(105.0, 145.0, 0.04)


def station_of(
    *, delay_s: float, lost_s: float = 0.0, lost_at_s: float = 120.0, pace: float = 1.0
) -> GroundStation:
    """Fixes of an aircraft that flies north at 20 m/s from 100 s on, whose simulator stops once.

    Its clock, and what it flies by it, run at a pace.
    """
    random = Random(1)
    rows = []
    for n in range(2500):
        clock_s = 7.0 + 0.02 * n
        true_s = 100.0 + 0.02 * n / pace
        true_s += lost_s if true_s >= lost_at_s else 0.0
        # Every fifth report comes without a delay.
        late_s = random.uniform(0.0, delay_s) if n % 5 else 0.0
        latitude, longitude = FRAME.to_geodetic(SPEED_M_S * 0.02 * n, 0.0)
        rows.append(
            {
                "clock_s": clock_s,
                "clock_arrival_s": true_s + late_s,
                # Sent 4 ms after the clock was.
                "arrival_s": true_s + 0.004 + late_s,
                "latitude_deg": latitude,
                "longitude_deg": longitude,
                "altitude_amsl_m": 600.0,
                "north_m_s": SPEED_M_S,
                "east_m_s": 0.0,
                "bank_rad": 0.0,
            }
        )
    fields = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    return cast("GroundStation", SimpleNamespace(track=lambda: fields))


def track_of(*, has_own_pace: bool = False, **options: float) -> TrueTrack:
    return true_track(station_of(**options), FRAME, TIMES_S, has_own_pace=has_own_pace)


@pytest.mark.parametrize(
    ("delay_s", "north_m", "lost_s", "late_s"), [(0.05, 0.02, 1e-3, 0.047), (0.0, 0.01, 1e-6, 0.0)]
)
def test_delays_of_reports_do_not_move_an_aircraft(delay_s, north_m, lost_s, late_s):
    track = track_of(delay_s=delay_s)
    assert track.north_m == pytest.approx(SPEED_M_S * (TIMES_S - 100.004), abs=north_m)
    assert track.lost_s == pytest.approx(0.0, abs=lost_s)
    assert track.late_s == pytest.approx(late_s, abs=0.002)


def test_simulator_that_stops_leaves_its_aircraft_where_it_was():
    track = track_of(delay_s=0.0, lost_s=2.0)
    assert track.lost_s == pytest.approx(2.0, abs=1e-3)
    still = (TIMES_S > 120.1) & (TIMES_S < 121.9)
    assert np.ptp(track.north_m[still]) < 0.5
    late = TIMES_S > 122.1
    assert track.north_m[late] == pytest.approx(SPEED_M_S * (TIMES_S[late] - 102.004), abs=0.01)


def test_a_steady_pace_is_no_time_lost_where_the_simulator_has_one():
    track = track_of(delay_s=0.05, pace=0.98, has_own_pace=True)
    assert track.pace == pytest.approx(0.98, abs=1e-3)
    assert track.lost_s == pytest.approx(0.0, abs=0.02)
    assert track_of(delay_s=0.05, pace=0.98).lost_s == pytest.approx(0.02 * 40.0, abs=0.02)


def test_what_is_lost_beside_a_steady_pace_is_lost():
    track = track_of(delay_s=0.0, lost_s=2.0, pace=0.98, has_own_pace=True)
    assert track.lost_s == pytest.approx(2.0, abs=0.02)


def test_back_is_when_the_last_distance_has_become_small_for_good():
    times = np.arange(0.0, 10.0, 1.0)
    near, away = np.zeros(10), np.array([0.0, 0, 0, 9, 9, 0, 9, 0, 0, 0])
    assert back_after(times, np.array([near, away]), 3.0, 3.0) == 3.0
    assert back_after(times, np.array([near, near]), 3.0, 3.0) == 0.0
    assert back_after(times, np.array([near, near + 9.0]), 3.0, 3.0) is None
