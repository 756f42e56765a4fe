"""A path that is ordered at another height: all climb to it together, as fast as all of them can."""

from typing import Any

import numpy as np
import pytest

import vfguide.lab.rehearsal.aircraft
import vfguide.lab.studies.order
from tests.kit.formation import GUIDED, LOITER, Formation
from tests.kit.missions import IN_PLACE, in_place, replaced
from vfguide.elementwise import FloatArray
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.studies.order import rehearsed
from vfguide.mission.order_plan import formation_of_mission, resolve
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

AT_S = 20.0
RATE_HZ = 10.0

CLIMB_M_S, SINK_M_S = 2.0, 1.5
"""Half of what the vehicles of a mission climb and descend by, that does not say otherwise."""

HOLD_M_S = 0.1
"""The height hold may be so much faster than the height that it is asked for."""

ACCELERATION_M_S2 = 0.7
"""0.5 m/s², and what the height hold adds to that."""


def beside_the_main_path(up_m: float) -> dict[str, Any]:
    """A path that leads north-east as the mission's does, 35 m to the right of it, and so much higher."""
    corners = [{"north_m": 0, "east_m": 50}, {"north_m": 4000, "east_m": 4050}]
    return {"type": "waypoints", "waypoints": [{**corner, "up_m": up_m} for corner in corners]}


def fly(other: dict[str, Any], /, *later: dict[str, Any], **changes: object) -> Formation:
    """A flight of the mission `shapes` that goes to another path, everybody in its slot at its beginning."""
    orders = [{"at_s": AT_S, "path": "other"}, *later]
    changes = {"paths": {"other": other}, "orders": orders, **changes}
    return Formation(replaced(in_place("shapes", rate_hz=RATE_HZ), **changes))


def up(flight: Formation, vehicle: VehicleRecord) -> FloatArray:
    """Height of a vehicle above the mission's flying height, m, from just before the order on."""
    origin = flight.mission.origin.altitude_amsl_m + flight.mission.height_above_origin_m
    return vehicle.altitude_amsl_m[round((AT_S - 2.0) * RATE_HZ) :] - origin


def climb_rates(flight: Formation, vehicle: VehicleRecord) -> FloatArray:
    """Climb rate of a vehicle, m/s, from just before the order on."""
    return np.diff(up(flight, vehicle)) * RATE_HZ


def slot_heights(flight: Formation) -> float:
    """How far any follower is from its slot in height at most, m, from just before the order on."""
    flown = flight.flown()
    leader = up(flight, flown.record.leader)
    # All slots of this mission are as high as the leader.
    return max(float(np.abs(up(flight, one) - leader).max()) for one in flown.record.followers)


@pytest.mark.parametrize(("change", "until_s"), [(60.0, 65.0), (-60.0, 75.0)])
def test_all_go_to_the_height_of_another_path_together_and_no_faster_than_all_can(change, until_s):
    flight = fly(beside_the_main_path(change))
    flown = flight.fly(until_s)
    assert flight.order_numbers() == [1, 1, 1, 1]
    fastest = CLIMB_M_S if change > 0.0 else SINK_M_S
    for vehicle in flown.record.vehicles:
        assert up(flight, vehicle)[-1] == pytest.approx(change, abs=0.1)
        rates = climb_rates(flight, vehicle)
        assert fastest - HOLD_M_S <= np.abs(rates).max() <= fastest + HOLD_M_S
        assert np.abs(np.diff(rates)).max() * RATE_HZ <= ACCELERATION_M_S2
    assert slot_heights(flight) < 0.3
    assert flown.nearest(15.0) >= 20.0


@pytest.mark.parametrize(("max_height_m", "refused"), [(165, False), (155, True)])
def test_a_rehearsal_is_flown_until_all_are_at_the_new_height_and_within_the_fence(
    monkeypatch, max_height_m, refused
):
    fence = {"max_height_m": max_height_m}
    if refused:
        with pytest.raises(RefusedOrderError, match="flies 160 m above the origin"):
            fly(beside_the_main_path(60.0), fence=fence)
        return
    mission = fly(beside_the_main_path(60.0), fence=fence).mission
    formation, records = formation_of_mission(mission), list[FlightRecord]()

    def note(*given: Any, wall_s: float) -> FlightRecord:
        records.append(flight_record(*given, wall_s=wall_s))
        return records[-1]

    monkeypatch.setattr(vfguide.lab.studies.order, "flight_record", note)
    order = Order(path="other")
    found, _ = resolve(mission, order, formation, number=1, time_s=8.0)
    rehearsed(mission, formation, found)
    (record,) = records
    for vehicle in record.vehicles:
        assert vehicle.altitude_amsl_m[-1] - 588.0 == pytest.approx(60.0, abs=0.1)


def test_the_rate_of_a_climb_goes_over_into_that_of_the_change():
    # At 20 s the leader climbs at 2.7 m/s, 44 m above the beginning: 16 m are left.
    climb = {"type": "line", "point": {"north_m": 0, "east_m": 0}, "course_deg": 45, "gain": 0.03}
    flight = fly(beside_the_main_path(60.0), path={**climb, "climb_deg": 8})
    flight.fly(55.0)
    leader = flight.flown().record.leader
    rates = climb_rates(flight, leader)
    assert rates[0] == pytest.approx(2.7, abs=0.3)
    assert rates.min() >= -HOLD_M_S
    assert np.abs(np.diff(rates)).max() * RATE_HZ <= ACCELERATION_M_S2
    assert up(flight, leader)[-1] == pytest.approx(60.0, abs=0.1)
    assert slot_heights(flight) < 0.3


def test_a_follower_that_is_restarted_in_the_middle_of_a_climb_climbs_on_with_its_leader():
    flight = fly(beside_the_main_path(60.0))
    # As it begins, half way, and as it ends.
    for restart_s in (22.0, 35.0, 46.0):
        flight.fly(restart_s)
        flight.restart("f1")
    flown = flight.fly(75.0)
    assert slot_heights(flight) < 0.7
    assert up(flight, flown.record.followers[0])[-1] == pytest.approx(60.0, abs=0.1)


@pytest.mark.parametrize("pilot", [False, True])
def test_who_takes_the_leader_up_again_goes_on_from_its_height(pilot):
    flight = fly(beside_the_main_path(60.0))
    flight.fly(35.0)
    if pilot:
        flight.emulators["leader"].select(LOITER)
        flight.fly(45.0)
        flight.emulators["leader"].select(GUIDED)
    else:
        flight.restart("leader")
    flown = flight.fly(100.0)
    for vehicle in flown.record.vehicles:
        assert up(flight, vehicle)[-1] == pytest.approx(60.0, abs=0.1)
        assert climb_rates(flight, vehicle).max() <= CLIMB_M_S + HOLD_M_S
    # A pilot's loiter stops the climb at once, and is heard of 0.1 s later.
    assert slot_heights(flight) < (2.5 if pilot else 0.3)
    assert flown.nearest(15.0) >= 10.0


def test_a_deputy_that_leads_on_takes_all_to_the_height_that_was_ordered():
    lost = {"vehicle": "leader", "at_s": 32.0, "what": "companion"}
    rehearsal = {"duration_s": 200, "rate_hz": RATE_HZ, "link_delay_s": 0.1, "losses": [lost]}
    flight = fly(
        beside_the_main_path(60.0), deputies=["f1"], rehearsal={**rehearsal, "start": IN_PLACE}
    )
    flown = flight.fly(75.0)
    assert flight.leaders() == ["f1"]
    ends = [float(up(flight, one)[-1]) for one in flown.record.followers]
    assert ends == pytest.approx([60.0] * 3, abs=0.5)
    apart = flown.height("f1") - flown.height("f3")
    assert np.abs(apart[round(AT_S * RATE_HZ) :]).max() < 0.5
    for vehicle in flown.record.followers:
        assert climb_rates(flight, vehicle).max() <= CLIMB_M_S + HOLD_M_S


def test_a_hold_in_the_middle_of_a_climb_ends_it_evenly():
    flight = fly(beside_the_main_path(60.0), {"at_s": 36.0, "action": "hold"})
    flight.fly(36.0)
    begin = up(flight, flight.flown().record.leader)[-1]
    flight.fly(70.0)
    leader = flight.flown().record.leader
    rates = climb_rates(flight, leader)
    assert np.abs(np.diff(rates)).max() * RATE_HZ <= ACCELERATION_M_S2
    # From 2 m/s at 0.4 m/s² and then exponentially: 2² / 0.8 + 0.3 m.
    assert up(flight, leader)[-1] == pytest.approx(begin + 5.3, abs=0.3)
    assert rates.min() > -HOLD_M_S
    assert slot_heights(flight) == pytest.approx(45.0, abs=0.5)


def test_after_a_hold_all_climb_back_to_the_path_together():
    # The hold begins in the middle of the climb, at 20 m or so, and ends there.
    flight = fly(
        beside_the_main_path(60.0),
        {"at_s": 36.0, "action": "hold"},
        {"at_s": 80.0, "action": "resume"},
    )
    flown = flight.fly(140.0)
    assert flight.order_numbers() == [3, 3, 3, 3]
    resumed = flown.record.time_s >= 80.0
    rates = np.diff(flown.record.leader.altitude_amsl_m[resumed]) * RATE_HZ
    assert rates.max() <= CLIMB_M_S + HOLD_M_S
    assert slot_heights(flight) == pytest.approx(45.0, abs=1.0)
    assert up(flight, flown.record.leader)[-1] == pytest.approx(60.0, abs=0.2)
    assert flown.nearest(15.0) >= 10.0
