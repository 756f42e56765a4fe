"""Orders through MAVLink bytes: over links that lose, with companions that die and pilots that take over."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import sitl_stub
import vfguide.lab.rehearsal.aircraft
from tests.closed_loop.formation.ordered_flights import (
    LOITER,
    Flown,
    height,
    leaders,
    nearest,
    places,
    select,
)
from vfguide.lab.rehearsal.aircraft import Aircraft
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.report.geometry import slot_error
from vfguide.lab.report.metrics import summarise
from vfguide.mission import Mission

MissionWith = Callable[..., Mission]

AT_S = 25.0

RATE_HZ = 10.0
"""Half the shipped rate: what is ordered is seen as well, in half the time."""


@pytest.fixture
def ordered(mission_with: MissionWith) -> Callable[..., Flown]:
    """A flight of the mission `shapes` with other orders, everybody in its slot at its beginning."""

    def make(*orders: dict[str, Any], **rehearsal: object) -> Flown:
        start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
        changes = {"start": start, "rate_hz": RATE_HZ, **rehearsal}
        mission = mission_with("shapes", rehearsal=changes)
        content = mission.model_dump(exclude_unset=True)
        content["orders"] = list(orders)
        return Flown(Mission.model_validate(content))

    return make


def test_a_shape_is_flown_over_a_link_that_loses_a_third_of_all(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered(
        {"at_s": AT_S, "shape": "trail", "spacing_m": 20}, link_loss=0.3, link_jitter_s=0.05
    )
    flight.until(70.0)
    assert flight.numbers() == [1, 1, 1, 1]
    record = flight.record()
    assert sorted(forward for forward, _ in places(record).values()) == pytest.approx(
        [-60.0, -40.0, -20.0], abs=0.5
    )
    assert nearest(record, 15.0) >= 7.0


def test_two_that_change_places_pass_each_other_in_layers(ordered: Callable[..., Flown]) -> None:
    flight = ordered({"at_s": AT_S, "swap": ["f1", "f2"]})
    flight.until(80.0)
    record = flight.record()
    found = places(record)
    assert found["f1"] == pytest.approx((-20.0, -20.0), abs=0.5)
    assert found["f2"] == pytest.approx((-20.0, 20.0), abs=0.5)
    assert nearest(record, 15.0) >= 10.0
    highest = max(height(record, "f1").max(), height(record, "f2").max())
    assert highest == pytest.approx(12.0, abs=1.0)
    assert height(record, "f1")[-1] == pytest.approx(0.0, abs=1.0)


def test_an_order_that_one_does_not_hear_is_void_and_all_fly_on_as_before(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered({"at_s": AT_S, "shape": "trail", "spacing_m": 20})
    # Nothing of the operator's reaches it.
    flight.aircraft["f2"] = Aircraft(flight.mission, "f2", orders=())
    flight.until(60.0)
    assert flight.numbers() == [0, 0, 0, 0]
    assert "order 1 is void: f2 does not answer; all fly on as before" in flight.words("leader")
    assert places(flight.record())["f3"] == pytest.approx((-40.0, 40.0), abs=0.5)


@pytest.mark.parametrize("restarted", ["leader", "f2"])
def test_a_companion_that_dies_in_the_middle_of_a_transition_finds_its_slot_again(
    ordered: Callable[..., Flown], restarted: str
) -> None:
    flight = ordered({"at_s": AT_S, "shape": "line-abreast", "spacing_m": 20})
    flight.until(32.0)
    flight.restart(restarted)
    flight.until(80.0)
    assert flight.numbers() == [1, 1, 1, 1]
    record = flight.record()
    assert [right for _, right in places(record).values()] == pytest.approx(
        [20.0, -20.0, 40.0], abs=1.0
    )
    assert nearest(record, 15.0) >= 7.0


def test_a_pilot_who_takes_over_in_a_transition_wins_and_is_kept_clear_of(
    ordered: Callable[..., Flown], monkeypatch: pytest.MonkeyPatch
) -> None:
    made: dict[str, sitl_stub.Autopilot] = {}

    def note(mission: Mission, name: str) -> sitl_stub.Autopilot:
        return made.setdefault(name, emulator_of(mission, name))

    monkeypatch.setattr(vfguide.lab.rehearsal.aircraft, "emulator_of", note)
    flight = ordered({"at_s": AT_S, "shape": "echelon-left", "spacing_m": 15})
    flight.until(33.0)
    select(made["f1"], LOITER, system=2)
    flight.until(75.0)
    assert made["f1"].truth().mode == "LOITER"
    record = flight.record()
    assert nearest(record, 15.0) >= 5.0
    # The others are where they were ordered to, a step of 15 m at 45 degrees each.
    found = places(record)
    step = 15.0 / np.sqrt(2.0)
    for name in ("f2", "f3"):
        forward, right = found[name]
        assert forward == pytest.approx(right, abs=1.0)
        assert forward / step == pytest.approx(round(forward / step), abs=0.1)


def test_who_leaves_loiters_and_who_is_ordered_back_joins_again(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered({"at_s": AT_S, "leave": ["f3"]}, {"at_s": 40, "join": ["f3"]})
    flight.until(38.0)
    assert flight.aircraft["f3"].companion.flight_mode == "LOITER"
    left = flight.record()
    f3 = left.followers[-1]
    gone = left.time_s[~f3.in_formation]
    assert (gone[0], gone[-1]) == pytest.approx((AT_S, 38.0), abs=0.1)
    # It is hundreds of metres away; the others keep their slots.
    mean = summarise(left).formation.mean_error_m
    assert mean is not None
    assert mean < 0.2
    flight.until(140.0)
    assert flight.aircraft["f3"].companion.flight_mode == "GUIDED"
    record = flight.record()
    assert places(record)["f3"] == pytest.approx((-40.0, 40.0), abs=1.0)
    assert nearest(record, 15.0) >= 7.0


def test_who_comes_back_while_another_shape_is_flown_joins_that(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered(
        {"at_s": 15.0, "leave": ["f3"]},
        {"at_s": 21.0, "shape": "trail", "spacing_m": 20},
        {"at_s": 42.0, "join": ["f3"]},
    )
    flight.until(160.0)
    assert flight.numbers() == [3, 3, 3, 3]
    record = flight.record()
    # Behind the two others; its place in the mission would be 40 m to the right.
    assert places(record)["f3"] == pytest.approx((-60.0, 0.0), abs=1.0)
    assert nearest(record, 10.0) >= 7.0


def test_those_who_leave_one_after_another_loiter_at_heights_of_their_own(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered({"at_s": AT_S, "leave": ["f3"]}, {"at_s": 45, "leave": ["f2"]})
    flight.until(75.0)
    record = flight.record()
    # As after an abort: 15 m for each rank above the leader, for nobody steers them there.
    heights = [float(height(record, name)[-1]) for name in ("f1", "f2", "f3")]
    assert heights == pytest.approx([0.0, 30.0, 45.0], abs=2.0)
    assert nearest(record, 15.0) >= 7.0


def test_slots_come_near_the_one_of_a_vehicle_only_once_it_has_joined(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered(
        {"at_s": 20.0, "leave": ["f3"]},
        {"at_s": 40.0, "join": ["f3"]},
        {"at_s": 50.0, "spacing_m": 10.0},
    )
    flight.until(60.0)
    assert flight.numbers() == [2, 2, 2, 2]
    assert "m from its slot, and" in flight.words("f3")
    assert "order 3 is void: f3: f3 is still" in flight.words("leader")


def test_a_hold_circles_in_stacked_heights_and_an_abort_ends_everything(
    ordered: Callable[..., Flown],
) -> None:
    flight = ordered({"at_s": AT_S, "action": "hold"}, {"at_s": 90, "action": "abort"})
    flight.until(89.0)
    record = flight.record()
    heights = [float(height(record, name)[-1]) for name in ("f1", "f2", "f3")]
    assert heights == pytest.approx([15.0, 30.0, 45.0], abs=1.0)
    # 63 s at about 20 m/s round a circle of 200 m, ground speed varies with the wind: a full turn.
    turned = np.unwrap(record.leader.course_rad)
    assert turned[-1] - turned[round(AT_S * RATE_HZ)] > np.radians(270.0)
    flight.until(94.0)
    modes = {one.companion.flight_mode for one in flight.aircraft.values()}
    assert modes == {"LOITER"}
    assert nearest(flight.record(), 15.0) >= 7.0


def test_the_leader_goes_to_another_path_and_nobody_is_lost_on_the_turn(
    mission_with: MissionWith,
) -> None:
    start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
    content = mission_with("shapes", rehearsal={"start": start}).model_dump(exclude_unset=True)
    # The first leads north-east; after 20 s it is left for one that leads north, 170 m to the east.
    north = {"type": "line", "point": {"north_m": 0, "east_m": 400}, "course_deg": 0}
    content |= {"paths": {"north": north}, "orders": [{"at_s": 20.0, "path": "north"}]}
    flight = Flown(Mission.model_validate(content))
    flight.until(55.0)
    assert flight.numbers() == [1, 1, 1, 1]
    record = flight.record()
    later = record.time_s >= 50.0
    assert np.abs(record.leader.east_m[later] - 400.0).max() < 8.0
    assert np.abs(record.leader.course_rad[later]).max() < 0.1
    # By its own field: it is told beside which path it was all the time.
    assert np.abs(record.leader.path_cross_track_error_m[later]).max() < 8.0
    assert nearest(record, 10.0) >= 20.0
    moved = record.time_s >= 15.0
    errors = [slot_error(record.leader, one).distance_m[moved] for one in record.followers]
    assert max(float(one.max()) for one in errors) < 6.0


def test_the_lead_goes_to_a_deputy_and_back_on_a_circle_and_nobody_leaves_its_slot(
    mission_with: MissionWith,
) -> None:
    start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
    content = mission_with("shapes", rehearsal={"start": start}).model_dump(exclude_unset=True)
    circle = {"type": "circle", "centre": {"north_m": 0, "east_m": 250}, "radius_m": 250}
    orders = [{"at_s": 15.0, "lead": "f1"}, {"at_s": 28.0, "lead": "leader"}]
    content |= {"path": circle, "deputies": ["f1"], "orders": orders}
    flight = Flown(Mission.model_validate(content))
    flight.until(27.0)
    assert flight.numbers() == [1, 1, 1, 1]
    assert leaders(flight) == ["f1"]
    flight.until(40.0)
    assert flight.numbers() == [2, 2, 2, 2]
    assert leaders(flight) == ["leader"]
    record = flight.record()
    assert nearest(record, 10.0) >= 20.0
    moved = record.time_s >= 10.0
    errors = [slot_error(record.reference, one).distance_m[moved] for one in record.followers]
    assert max(float(one.max()) for one in errors) < 1.0


def test_a_deputy_that_leads_goes_into_a_hold_and_out_of_it_in_turns_that_an_aircraft_can_fly(
    mission_with: MissionWith,
) -> None:
    start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
    lost = {"vehicle": "leader", "at_s": 15.0, "what": "companion"}
    content = mission_with("shapes", rehearsal={"start": start, "losses": [lost]}).model_dump(
        exclude_unset=True
    )
    # A circle of 200 m: half way round it, after some 30 s, the path leads the other way.
    orders = [{"at_s": 30.0, "action": "hold"}, {"at_s": 64.0, "action": "resume"}]
    content |= {"deputies": ["f1", "f2"], "orders": orders}
    flight = Flown(Mission.model_validate(content))
    for until_s, number in ((45.0, 1), (78.0, 2)):
        flight.until(until_s)
        assert flight.numbers()[1:] == [number] * 3
        assert leaders(flight) == ["f1"]
    # Who hears a leader that turns at once takes it for one that cannot be.
    assert not any("what cannot be" in flight.words(name) for name in ("f2", "f3"))
    record = flight.record()
    moved = record.time_s >= 40.0
    errors = [slot_error(record.reference, one).distance_m[moved] for one in record.followers]
    assert max(float(one.max()) for one in errors) < 10.0


@pytest.mark.parametrize("deputies", [[], ["f1"]])
def test_at_the_end_of_a_route_all_go_back_to_their_autopilots_together(
    mission_with: MissionWith, deputies: list[str]
) -> None:
    start = {"leader": {"north_m": 0, "east_m": 0}, "f1": {}, "f2": {}, "f3": {}}
    content = mission_with("shapes", rehearsal={"start": start}).model_dump(exclude_unset=True)
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 450, "east_m": 0}]
    route = {"type": "waypoints", "waypoints": corners, "end": "hand-back", "radius_m": 150}
    content |= {"path": route, "orders": [], "paths": {}, "deputies": deputies}
    flight = Flown(Mission.model_validate(content))
    flight.until(12.0)
    assert {one.companion.flight_mode for one in flight.aircraft.values()} == {"GUIDED"}
    flight.until(45.0)
    assert {one.companion.flight_mode for one in flight.aircraft.values()} == {"LOITER"}
    said = {
        name: [event.time_s for event in one.events if "route is at its end" in event.text]
        for name, one in flight.aircraft.items()
    }
    # Each says so once, and all of them within a quarter of a second.
    assert [len(times) for times in said.values()] == [1, 1, 1, 1]
    moments = [times[0] for times in said.values()]
    assert max(moments) - min(moments) <= 0.25
    record = flight.record()
    assert nearest(record, 15.0) >= 7.0
    f1, f2, f3 = (float(height(record, name)[-1]) for name in ("f1", "f2", "f3"))
    # There, and on their way to 30 and 45 m above the leader.
    assert f1 == pytest.approx(15.0, abs=3.0)
    assert min(f2, f3) >= f1 + 8.0
    assert all("leads" not in flight.words(name) for name in deputies)
