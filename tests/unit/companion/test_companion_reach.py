"""A vehicle that is far from its path, its slot or the mission's origin is not taken up, and told why."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.autopilot import new_autopilot
from tests.kit.companion import FRAME, Flight, leader_bytes, new_flight
from tests.kit.missions import mission_with, plan_of
from tests.kit.wire import packed, position_report
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan
from vfguide.companion.reach import EngageRange
from vfguide.companion.supervisor import Mode
from vfguide.frames import way_m
from vfguide.link.presence import LONGEST_TEXT
from vfguide.mavlink.reports import PositionReport

SET_MODE, HEADING = 176, 43_002


def far_flight(north: float, *, leader_north: float = 0.0) -> Flight:
    """f1 so far north of the origin, and a leader that is elsewhere."""
    flown = new_flight(link=lambda now: [far_leader(now, leader_north)])
    latitude, longitude = FRAME.to_geodetic(north, 0.0)
    flown.autopilot = new_autopilot(
        system_id=2,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=588.0,
        home_altitude_amsl_m=488.0,
    )
    return flown


def far_leader(now: float, north: float) -> bytes:
    latitude, longitude = FRAME.to_geodetic(north + 20.0 * now, 0.0)
    return leader_bytes(now, latitude_deg=latitude, longitude_deg=longitude)


@pytest.mark.parametrize(("vehicle_m", "leader_m"), [(30e3, 0.0), (0.0, 30e3), (-5.2e3, 0.0)])
def test_a_slot_that_is_far_away_is_not_flown_to(vehicle_m, leader_m):
    flown = far_flight(vehicle_m, leader_north=leader_m)
    flown.run(8.0)
    assert flown.times(SET_MODE) == []
    (told,) = [text for _, text in flown.events if "from its slot" in text]
    assert f"{abs(vehicle_m - leader_m) / 1e3:.1f} km from its slot"[:2] in told
    assert "engaged within 5.0 km" in told
    # A pilot's GUIDED does not make it nearer.
    flown.pilot(15)
    flown.run(12.0)
    assert flown.times(HEADING) == []
    assert flown.mode_at(12.0) is Mode.WAITING


def test_a_slot_within_five_kilometres_is_flown_to():
    flown = far_flight(-4.8e3)
    flown.run(5.0)
    assert flown.mode_at(5.0) is Mode.JOINING


def test_it_is_taken_up_once_it_has_come_near_enough():
    flown = far_flight(-5.4e3)

    def southbound(now: float) -> list[bytes]:
        latitude, longitude = FRAME.to_geodetic(-20.0 * now, 0.0)
        return [leader_bytes(now, latitude_deg=latitude, longitude_deg=longitude, course=math.pi)]

    flown.link = southbound
    flown.run(4.0)
    assert flown.times(SET_MODE) == []
    flown.run(30.0)
    assert flown.times(SET_MODE) != []
    assert [text for _, text in flown.events if "may be steered again" in text] != []


def test_an_origin_with_latitude_and_longitude_exchanged_is_named():
    mission = mission_with(
        "line-calm", origin={"latitude_deg": 8.545594, "longitude_deg": 47.397742}
    )
    companion = Companion(
        flight_plan(mission, "leader"), adapter_of(mission.vehicles["leader"]), engage=True
    )
    report = position_report(time_boot_ms=1000, vx=2000)
    out = companion.receive_mavlink(packed(report, system_id=1, component_id=1), 0.1)
    (text,) = [event.text for event in out.events]
    assert text == (
        "not steered: 5,653 km from the mission's origin: exchange its latitude and longitude"
    )
    assert companion.obstacle(0.1) == text.removeprefix("not steered: ")


def test_who_has_been_there_has_another_trouble_than_the_origin():
    reach = EngageRange(plan_of("line-calm", "f1"))

    def at(latitude_deg: float) -> PositionReport:
        return PositionReport(
            boot_time_s=1.0,
            latitude_deg=latitude_deg,
            longitude_deg=8.545594,
            altitude_amsl=588.0,
            velocity_north=20.0,
            velocity_east=0.0,
            heading=0.0,
        )

    reach.note(at(47.4))
    reach.note(at(12.0))
    assert reach.objection(math.inf) is None


@given(st.floats(-90.0, 90.0), st.floats(-180.0, 180.0), st.floats(0.0, 2e7))
def test_whatever_is_reported_it_is_within_reach_or_told_in_few_words(
    latitude, longitude, distance
):
    reach = EngageRange(plan_of("line-calm", "f1"))
    reach.note(
        PositionReport(
            boot_time_s=1.0,
            latitude_deg=latitude,
            longitude_deg=longitude,
            altitude_amsl=588.0,
            velocity_north=20.0,
            velocity_east=0.0,
            heading=0.0,
        )
    )
    found = reach.objection(distance)
    near = way_m(FRAME.origin, (latitude, longitude)) <= 200e3 or (latitude, longitude) == (
        0.0,
        0.0,
    )
    assert (found is None) is (near and distance <= 5000.0)
    assert found is None or len(found.text) <= LONGEST_TEXT
