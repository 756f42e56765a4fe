"""A flight as a plan of QGroundControl, read back as a mission reads one."""

import math
from itertools import pairwise

import numpy as np
import pytest

from tests.kit.records import with_vehicle
from tests.kit.short_flights import short_flight
from vfguide.errors import InputError
from vfguide.frames import LocalFrame
from vfguide.lab.export.plan import MOST_WAYPOINTS, chosen, distances, write_plan
from vfguide.mission.plan_file import read_plan
from vfguide.record.flight import FlightRecord
from vfguide.record.outline import Outline

FRAME = LocalFrame(47.0, 8.0, 488.0)


def with_track(record: FlightRecord, track: np.ndarray) -> FlightRecord:
    """The same with another track of the leader: north, east and altitude of each sample, m."""
    north, east, altitude = track.T
    return with_vehicle(record, "lead", north_m=north, east_m=east, altitude_amsl_m=altitude)


def test_a_straight_flight_is_a_route_of_its_two_ends(tmp_path):
    """40 m north of the origin, 588 m above sea level; the plan has altitudes above the home's 488 m."""
    write_plan(short_flight(), tmp_path / "a.plan")
    found = read_plan(tmp_path / "a.plan")
    first, last = found["waypoints"]
    north, east = FRAME.to_local(last["latitude_deg"], last["longitude_deg"])
    assert (north, east) == pytest.approx((40.0, 0.0), abs=0.01)
    assert (first["latitude_deg"], first["longitude_deg"]) == pytest.approx((47.0, 8.0), abs=1e-7)
    assert [one["altitude_amsl_m"] for one in (first, last)] == [588.0, 588.0]


def test_a_climbing_turn_is_followed_to_within_a_metre(tmp_path):
    angle = np.linspace(0.0, 2.0 * math.pi, 21)
    track = np.column_stack([10.0 * np.sin(angle), 10.0 * np.cos(angle), 588.0 + 5.0 * angle])
    write_plan(with_track(short_flight(), track), tmp_path / "a.plan")
    route = np.array(
        [
            (*FRAME.to_local(one["latitude_deg"], one["longitude_deg"]), one["altitude_amsl_m"])
            for one in read_plan(tmp_path / "a.plan")["waypoints"]
        ]
    )
    away = np.min([distances(track, *ends) for ends in pairwise(route)], 0)
    assert away.max() < 1.05
    assert len(route) < len(track)


def test_a_long_flight_has_as_many_waypoints_as_an_autopilot_keeps():
    angle = np.linspace(0.0, 600.0, 20_000)
    track = np.column_stack([300.0 * np.sin(angle), 200.0 * np.cos(0.7 * angle), 0.0 * angle])
    kept = chosen(track)
    assert 2 < np.count_nonzero(kept) <= MOST_WAYPOINTS
    assert kept[0]
    assert kept[-1]


def test_rally_points_are_in_the_plan(tmp_path):
    rally = Outline(kind="rally", north_m=np.array([100.0]), east_m=np.array([-50.0]))
    write_plan(short_flight(outlines=(rally,)), tmp_path / "a.plan")
    (point,) = read_plan(tmp_path / "a.plan")["rally_points"]
    found = FRAME.to_local(point["latitude_deg"], point["longitude_deg"])
    assert found == pytest.approx((100.0, -50.0), abs=0.01)


def test_a_leader_of_whom_nothing_was_recorded_is_one_line(tmp_path):
    record = with_track(short_flight(), np.full((21, 3), math.nan))
    with pytest.raises(InputError, match="there is nothing to plan; give another flight"):
        write_plan(record, tmp_path / "a.plan")
