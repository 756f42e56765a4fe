"""What the report tells the replay: small, exact to what is seen, and no way out of the page."""

import json
import math
from base64 import b64decode, b64encode
from hashlib import sha256

import numpy as np
import pytest

from tests.kit.records import still_flight, still_leader, still_vehicle, with_vehicle
from vfguide.lab.report.replay import (
    ANGLE,
    MILLIMETRES,
    NOTHING,
    NUMBER,
    choose_stride,
    describe_flight,
    encode,
    hash_source,
    program,
    replay_json,
    replay_of,
    series_of,
)
from vfguide.record.flight import FlightRecord, Outline


def numbers(series: dict[str, object], kind: str) -> list[int]:
    return np.frombuffer(b64decode(str(series["data"])), dtype=kind).tolist()


def test_places_are_whole_millimetres_in_four_bytes():
    series = encode(np.array([1.2344, -0.0006, 2000.0]), MILLIMETRES)
    assert numbers(series, "<i4") == [1234, -1, 2_000_000]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9])
def test_what_no_number_can_hold_is_not_known(value):
    assert numbers(encode(np.array([value]), MILLIMETRES), "<i4") == [-(2**31)]
    assert numbers(encode(np.array([value]), NUMBER), "u1") == [255]


def test_angles_are_within_half_a_turn():
    time_s = np.arange(3.0)
    leader = still_leader(time_s, course_rad=np.radians([359.0, 180.5, 725.0]))
    course = series_of(still_flight(time_s, leader), leader)["course_deg"]
    assert numbers(encode(course, ANGLE), "<i2") == [-100, -17950, 500]


def test_slot_errors_are_those_of_the_figures(circle_flight):
    follower = circle_flight.followers[0]
    series = series_of(circle_flight, follower)
    # 60 m behind and 30 m left of the slot's place at the start, by the flight's own formula.
    assert series["along_m"][0] == pytest.approx(40.0, abs=0.2)
    assert series["across_m"][0] == pytest.approx(30.0, abs=0.2)


def still(time_s: np.ndarray, vehicles: int) -> FlightRecord:
    others = [still_vehicle(f"f{n}", "follower", time_s) for n in range(1, vehicles)]
    return still_flight(time_s, still_leader(time_s), *others)


@pytest.mark.parametrize(
    ("seconds", "vehicles", "stride"),
    [
        # 20 samples a second: 0.2 s between two are every 4th.
        (300.0, 4, 4),
        # 42 bytes of each of 4 vehicles: 600 kB are 3571 samples, 1.008 s of an hour, more than the coarsest.
        (3600.0, 4, 20),
        (1.0, 1, 4),
    ],
)
def test_long_flights_are_shown_in_coarser_steps(seconds, vehicles, stride):
    time_s = np.arange(0.0, seconds + 0.01, 0.05)
    assert choose_stride(still(time_s, vehicles)) == stride


def test_a_day_of_many_aircraft_stays_below_what_a_page_may_hold():
    time_s = np.arange(0.0, 86_400.0, 1.0)
    record = still(time_s, 12)
    samples = time_s.size / choose_stride(record)
    assert samples * 12 * 42 <= 12_000_000


def test_names_cannot_end_the_data():
    name = '</script><script>alert(1)</script><!--\u2028&"'
    time_s = np.arange(3.0)
    text = replay_json(still_flight(time_s, still_vehicle(name, "leader", time_s)))
    assert not set("<>&\u2028") & set(text)
    assert json.loads(text)["vehicles"][0]["name"] == name


def test_a_path_that_is_not_known_everywhere_keeps_its_points_together():
    record = still_flight(
        np.arange(3.0),
        path_north_m=np.array([0.0, math.nan, 2.0]),
        path_east_m=np.array([1.0, 5.0, 3.0]),
    )
    assert describe_flight(record)["path"] == {"north_m": [0.0, 2.0], "east_m": [1.0, 3.0]}


def test_a_flight_that_broke_at_once_has_no_replay():
    assert replay_of(still_flight(np.array([]))) == NOTHING


def test_the_program_cannot_end_its_own_element():
    assert "</script" not in program()
    assert "<!--" not in program()


def test_a_script_is_called_by_the_hash_of_its_bytes():
    expected = b64encode(sha256("höhe".encode()).digest()).decode()
    assert hash_source("höhe") == f"'sha256-{expected}'"


def test_heights_of_slots_are_told(circle_flight):
    vehicles = describe_flight(with_vehicle(circle_flight, "f1", slot_up_m=5.0))["vehicles"]
    assert isinstance(vehicles, list)
    assert vehicles[1]["slot"] == [-20.0, -20.0, 5.0]


def test_the_page_gets_the_places_of_a_slot_that_was_changed_in_flight(circle_flight):
    follower = circle_flight.followers[0]
    assert "slot_north_m" not in series_of(circle_flight, follower)
    # From 20 m behind to 30 m to the right of it: where the error says that it was.
    count = circle_flight.time_s.size
    flight = with_vehicle(
        circle_flight,
        "f1",
        slot_forward_series_m=np.linspace(-20.0, 0.0, count),
        slot_right_series_m=np.linspace(0.0, 30.0, count),
    )
    moved, course = flight.followers[0], flight.leader.course_rad
    series = series_of(flight, moved)
    north = moved.north_m + series["along_m"] * np.cos(course) - series["across_m"] * np.sin(course)
    assert np.allclose(series["slot_north_m"], north)
    east = circle_flight.leader.east_m[-1] + 30.0 * np.cos(course[-1])
    assert series["slot_east_m"][-1] == pytest.approx(east)


def test_the_replay_draws_the_fence_to_its_last_corner():
    edge = Outline(kind="fence", north_m=np.arange(5001.0), east_m=np.zeros(5001))
    described = describe_flight(still_flight(np.arange(3.0), outlines=(edge,)))
    outlines = described["outlines"]
    assert isinstance(outlines, list)
    # Every third of 5001 points, and the last: 1667 + 1.
    assert outlines[0]["kind"] == "fence"
    assert len(outlines[0]["north_m"]) == 1668
    assert outlines[0]["north_m"][-2:] == [4998.0, 5000.0]
