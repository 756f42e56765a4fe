"""How real autopilots flew in truth: their tracks, logs held against them, and missions changed for it."""

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.autopilots.analysed import Compared, clocks_of, compared
from tests.autopilots.fly_sitl import arguments, changes_of
from tests.autopilots.formation import load, merged
from tests.autopilots.ground_station import GroundStation, wanted_frames
from tests.autopilots.table import ROWS, told
from tests.autopilots.true_tracks import TrueTrack, true_track
from tests.autopilots.verdict import back_after, flight_record
from tests.kit.missions import MISSIONS
from vfguide.elementwise import FloatArray
from vfguide.frames import LocalFrame
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


SPEED_M_S = 20.0
FRAME = LocalFrame(-35.0, 149.0, 500.0)
TIMES_S = np.arange(105.0, 145.0, 0.04)


def station_of(
    *, delay_s: float, lost_s: float = 0.0, lost_at_s: float = 120.0, pace: float = 1.0
) -> GroundStation:
    """Fixes of an aircraft that flies north at 20 m/s from 100 s on, whose simulator stops once.

    Its clock, and what it flies by it, run at a pace.
    """
    n = np.arange(2500)
    true_s = 100.0 + 0.02 * n / pace
    true_s[true_s >= lost_at_s] += lost_s
    # Every fifth report comes without a delay.
    late_s = np.where(n % 5, np.random.default_rng(1).uniform(0.0, delay_s, n.size), 0.0)
    places = [FRAME.to_geodetic(SPEED_M_S * 0.02 * each, 0.0) for each in n]
    same = {"altitude_amsl_m": 600.0, "north_m_s": SPEED_M_S, "east_m_s": 0.0, "bank_rad": 0.0}
    fields = {name: np.full(n.size, value) for name, value in same.items()} | {
        "clock_s": 7.0 + 0.02 * n,
        "clock_arrival_s": true_s + late_s,
        # Sent 4 ms after the clock was.
        "arrival_s": true_s + 0.004 + late_s,
        "latitude_deg": np.array([latitude for latitude, _ in places]),
        "longitude_deg": np.array([longitude for _, longitude in places]),
    }
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


@pytest.mark.parametrize("row", ROWS)
def test_every_row_is_a_mission_that_can_be_flown(row):
    options = arguments().parse_args(told(row))
    mission = load(options.mission, changes_of(options.changes))
    assert len(mission.followers) == 3
    if row == "arduplane-auto":
        assert {(one.slips, one.alpha_1_s) for one in mission.vehicles.values()} == {("auto", 1.2)}


WRITER = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)
CLOCK = mavlink.MAVLink_system_time_message(0, 1234).pack(WRITER)
ATTITUDE = mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0).pack(WRITER)


def test_frames_come_whole_wherever_the_stream_is_cut():
    stream = CLOCK + ATTITUDE + CLOCK
    for cut in range(1, len(stream)):
        first, waiting = wanted_frames(stream[:cut])
        second, left = wanted_frames(waiting + stream[cut:])
        assert [frame.content for frame in (*first, *second)] == [CLOCK, CLOCK]
        assert left == b""


def test_noise_before_a_frame_is_passed_over():
    frames, left = wanted_frames(b"boot: ok\n" + CLOCK)
    assert [(frame.message_id, frame.system_id) for frame in frames] == [(2, 3)]
    assert left == b""


CONTENT = {
    "path": {"type": "circle", "radius_m": 250},
    "vehicles": {"f1": {"slips": True}, "f2": {}},
}


def test_fields_change_a_group_of_another_type_takes_nothing_over_and_null_removes():
    changed = merged(CONTENT, {"path": {"radius_m": 150}, "vehicles": {"f2": None}})
    assert changed["path"] == {"type": "circle", "radius_m": 150}
    assert changed["vehicles"] == {"f1": {"slips": True}}
    line = {"type": "line", "course_deg": 45}
    assert merged(CONTENT, {"path": line}) == {**CONTENT, "path": line}
