"""A vehicle that is far from its path, its slot or the mission's origin is not taken up, and told why."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.companion import (
    HEADING,
    SET_MODE,
    Flight,
    companion_of,
    emulator,
    leader_bytes,
    new_flight,
)
from tests.kit.missions import mission_with, plan_of
from tests.kit.states import FRAME, reported
from tests.kit.wire import packed, position_report
from vfguide.companion.reach import EngageRange
from vfguide.companion.supervisor import Mode
from vfguide.frames import way_m
from vfguide.link.presence import LONGEST_TEXT


def far_flight(north: float, *, leader_north: float = 0.0) -> Flight:
    """f1 so far north of the origin, and a leader that is elsewhere."""
    flown = new_flight(link=lambda now: [leader_bytes(now, north=leader_north + 20.0 * now)])
    flown.autopilot = emulator(north=north, east=0.0)
    return flown


@pytest.mark.parametrize(("vehicle_m", "leader_m"), [(30e3, 0.0), (0.0, 30e3), (-5.2e3, 0.0)])
def test_a_slot_that_is_far_away_is_not_flown_to(vehicle_m, leader_m):
    flown = far_flight(vehicle_m, leader_north=leader_m)
    flown.run(8.0)
    assert flown.times(SET_MODE) == []
    (told,) = [text for _, text in flown.events if "from its slot" in text]
    assert f"{abs(vehicle_m - leader_m) / 1e3:.1f} km from its slot"[:2] in told
    assert "engaged within 5.0 km" in told
    # A pilot's GUIDED does not make it nearer.
    flown.pilot("GUIDED", until_s=12.0)
    assert flown.times(HEADING) == []
    assert flown.mode_at(12.0) is Mode.WAITING


def test_a_slot_within_five_kilometres_is_flown_to():
    flown = far_flight(-4.8e3)
    flown.run(5.0)
    assert flown.mode_at(5.0) is Mode.JOINING


def test_it_is_taken_up_once_it_has_come_near_enough():
    flown = far_flight(-5.4e3)
    flown.link = lambda now: [leader_bytes(now, north=-20.0 * now, course=math.pi)]
    flown.run(4.0)
    assert flown.times(SET_MODE) == []
    flown.run(30.0)
    assert flown.times(SET_MODE) != []
    assert [text for _, text in flown.events if "may be steered again" in text] != []


def test_an_origin_with_latitude_and_longitude_exchanged_is_named():
    mission = mission_with(
        "line-calm", origin={"latitude_deg": 8.545594, "longitude_deg": 47.397742}
    )
    companion = companion_of("leader", mission=mission)
    report = position_report(time_boot_ms=1000, vx=2000)
    out = companion.receive_mavlink(packed(report, system_id=1, component_id=1), 0.1)
    (text,) = [event.text for event in out.events]
    assert text == (
        "not steered: 5,653 km from the mission's origin: exchange its latitude and longitude"
    )
    assert companion.obstacle(0.1) == text.removeprefix("not steered: ")


def test_who_has_been_there_has_another_trouble_than_the_origin():
    reach = EngageRange(plan_of())
    for latitude_deg in (47.4, 12.0):
        reach.note(replace(reported(), latitude_deg=latitude_deg))
    assert reach.objection(math.inf) is None


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.floats(0.0, 2e7))
def test_whatever_is_reported_it_is_within_reach_or_told_in_few_words(
    latitude, longitude, distance
):
    reach, place = EngageRange(plan_of()), (latitude, longitude)
    reach.note(replace(reported(), latitude_deg=latitude, longitude_deg=longitude))
    found = reach.objection(distance)
    near = way_m(FRAME.origin, place) <= 200e3 or place == (0.0, 0.0)
    assert (found is None) is (near and distance <= 5000.0)
    assert found is None or len(found.text) <= LONGEST_TEXT
