"""Orders through MAVLink bytes: over links that lose, with companions that die and pilots that take over."""

from typing import Any

import numpy as np
import pytest

from tests.kit.formation import LOITER, Formation
from tests.kit.missions import in_place, replaced
from vfguide.lab.rehearsal.aircraft import Aircraft

AT_S = 15.0

RATE_HZ = 10.0
"""Half the shipped rate: what is ordered is seen as well, in half the time."""


def ordered(*orders: dict[str, Any], **rehearsal: object) -> Formation:
    """A flight of the mission `shapes` with other orders, everybody in its slot at its beginning."""
    mission = in_place("shapes", rate_hz=RATE_HZ, **rehearsal)
    return Formation(replaced(mission, orders=list(orders)))


def test_a_shape_is_flown_over_a_link_that_loses_a_third_of_all():
    flight = ordered(
        {"at_s": AT_S, "shape": "trail", "spacing_m": 20}, link_loss=0.3, link_jitter_s=0.05
    )
    flown = flight.fly(60.0)
    assert flight.order_numbers() == [1, 1, 1, 1]
    assert sorted(forward for forward, _ in flown.places().values()) == pytest.approx(
        [-60.0, -40.0, -20.0], abs=0.5
    )
    assert flown.nearest(10.0) >= 7.0


def test_two_that_change_places_pass_each_other_in_layers():
    flight = ordered({"at_s": AT_S, "swap": ["f1", "f2"]})
    flown = flight.fly(70.0)
    found = flown.places()
    assert found["f1"] == pytest.approx((-20.0, -20.0), abs=0.8)
    assert found["f2"] == pytest.approx((-20.0, 20.0), abs=0.5)
    assert flown.nearest(10.0) >= 10.0
    highest = max(flown.height("f1").max(), flown.height("f2").max())
    assert highest == pytest.approx(12.0, abs=1.0)
    assert flown.height("f1")[-1] == pytest.approx(0.0, abs=1.0)


def test_an_order_that_one_does_not_hear_is_void_and_all_fly_on_as_before():
    flight = ordered({"at_s": AT_S, "shape": "trail", "spacing_m": 20})
    # Nothing of the operator's reaches it.
    flight.add("f2", Aircraft(flight.mission, "f2", orders=()))
    flight.fly(45.0)
    assert flight.order_numbers() == [0, 0, 0, 0]
    assert "order 1 is void: f2 does not answer; all fly on as before" in flight.flown().words(
        "leader"
    )
    assert flight.flown().places()["f3"] == pytest.approx((-40.0, 40.0), abs=0.5)


@pytest.mark.parametrize("restarted", ["leader", "f2"])
def test_a_companion_that_dies_in_the_middle_of_a_transition_finds_its_slot_again(restarted):
    flight = ordered({"at_s": AT_S, "shape": "line-abreast", "spacing_m": 20})
    flight.fly(22.0)
    flight.restart(restarted)
    flown = flight.fly(70.0)
    assert flight.order_numbers() == [1, 1, 1, 1]
    assert [right for _, right in flown.places().values()] == pytest.approx(
        [20.0, -20.0, 40.0], abs=1.0
    )
    assert flown.nearest(10.0) >= 7.0


def test_a_pilot_who_takes_over_in_a_transition_wins_and_is_kept_clear_of():
    flight = ordered({"at_s": AT_S, "shape": "echelon-left", "spacing_m": 15})
    flight.fly(23.0)
    flight.emulators["f1"].select(LOITER)
    flown = flight.fly(65.0)
    assert flight.emulators["f1"].truth().mode == "LOITER"
    assert flown.nearest(10.0) >= 5.0
    # The others are where they were ordered to, a step of 15 m at 45 degrees each.
    found = flown.places()
    step = 15.0 / np.sqrt(2.0)
    for name in ("f2", "f3"):
        forward, right = found[name]
        assert forward == pytest.approx(right, abs=1.0)
        assert forward / step == pytest.approx(round(forward / step), abs=0.1)


def test_who_leaves_loiters_and_who_is_ordered_back_joins_again():
    flight = ordered({"at_s": AT_S, "leave": ["f3"]}, {"at_s": 30, "join": ["f3"]})
    flight.fly(28.0)
    assert flight.aircraft["f3"].companion.flight_mode == "LOITER"
    left = flight.flown()
    gone = left.record.time_s[~left.vehicle("f3").in_formation]
    assert (gone[0], gone[-1]) == pytest.approx((AT_S, 28.0), abs=0.1)
    # It is hundreds of metres away; the others keep their slots.
    assert left.mean_m < 0.3
    flown = flight.fly(130.0)
    assert flight.aircraft["f3"].companion.flight_mode == "GUIDED"
    assert flown.places()["f3"] == pytest.approx((-40.0, 40.0), abs=1.0)
    assert flown.nearest(10.0) >= 7.0


def test_who_comes_back_while_another_shape_is_flown_joins_that():
    flight = ordered(
        {"at_s": 15.0, "leave": ["f3"]},
        {"at_s": 21.0, "shape": "trail", "spacing_m": 20},
        {"at_s": 42.0, "join": ["f3"]},
    )
    flown = flight.fly(160.0)
    assert flight.order_numbers() == [3, 3, 3, 3]
    # Behind the two others; its place in the mission would be 40 m to the right.
    assert flown.places()["f3"] == pytest.approx((-60.0, 0.0), abs=1.0)
    assert flown.nearest(10.0) >= 7.0


def test_those_who_leave_one_after_another_loiter_at_heights_of_their_own():
    flight = ordered({"at_s": AT_S, "leave": ["f3"]}, {"at_s": 35, "leave": ["f2"]})
    flown = flight.fly(65.0)
    # As after an abort: 15 m for each rank above the leader, for nobody steers them there.
    heights = [float(flown.height(name)[-1]) for name in ("f1", "f2", "f3")]
    assert heights == pytest.approx([0.0, 30.0, 45.0], abs=2.0)
    assert flown.nearest(10.0) >= 7.0


def test_slots_come_near_the_one_of_a_vehicle_only_once_it_has_joined():
    flight = ordered(
        {"at_s": AT_S, "leave": ["f3"]},
        {"at_s": 35.0, "join": ["f3"]},
        {"at_s": 45.0, "spacing_m": 10.0},
    )
    flight.fly(50.0)
    assert flight.order_numbers() == [2, 2, 2, 2]
    assert "m from its slot, and" in flight.flown().words("f3")
    assert "order 3 is void: f3: f3 is still" in flight.flown().words("leader")


def test_a_hold_circles_in_stacked_heights_and_an_abort_ends_everything():
    flight = ordered({"at_s": AT_S, "action": "hold"}, {"at_s": 80, "action": "abort"})
    flown = flight.fly(79.0)
    heights = [float(flown.height(name)[-1]) for name in ("f1", "f2", "f3")]
    assert heights == pytest.approx([15.0, 30.0, 45.0], abs=1.0)
    # 63 s at about 20 m/s round a circle of 200 m, ground speed varies with the wind: a full turn.
    turned = np.unwrap(flown.record.leader.course_rad)
    assert turned[-1] - turned[round(AT_S * RATE_HZ)] > np.radians(270.0)
    flight.fly(84.0)
    modes = {one.companion.flight_mode for one in flight.aircraft.values()}
    assert modes == {"LOITER"}
    assert flight.flown().nearest(10.0) >= 7.0


def test_the_leader_goes_to_another_path_and_nobody_is_lost_on_the_turn():
    # The first leads north-east; after 20 s it is left for one that leads north, 170 m to the east.
    north = {"type": "line", "point": {"north_m": 0, "east_m": 400}, "course_deg": 0}
    changes = {"paths": {"north": north}, "orders": [{"at_s": 20.0, "path": "north"}]}
    flight = Formation(replaced(in_place("shapes", rate_hz=RATE_HZ), **changes))
    flown = flight.fly(55.0)
    assert flight.order_numbers() == [1, 1, 1, 1]
    later = flown.record.time_s >= 50.0
    assert np.abs(flown.record.leader.east_m[later] - 400.0).max() < 8.0
    assert np.abs(flown.record.leader.course_rad[later]).max() < 0.1
    # By its own field: it is told beside which path it was all the time.
    assert np.abs(flown.record.leader.path_cross_track_error_m[later]).max() < 8.0
    assert flown.nearest(10.0) >= 20.0
    assert flown.errors(15.0).max() < 6.0


def test_the_lead_goes_to_a_deputy_and_back_on_a_circle_and_nobody_leaves_its_slot():
    circle = {"type": "circle", "centre": {"north_m": 0, "east_m": 250}, "radius_m": 250}
    orders = [{"at_s": 15.0, "lead": "f1"}, {"at_s": 28.0, "lead": "leader"}]
    changes = {"path": circle, "deputies": ["f1"], "orders": orders}
    flight = Formation(replaced(in_place("shapes", rate_hz=RATE_HZ), **changes))
    flight.fly(27.0)
    assert flight.order_numbers() == [1, 1, 1, 1]
    assert flight.leaders() == ["f1"]
    flown = flight.fly(40.0)
    assert flight.order_numbers() == [2, 2, 2, 2]
    assert flight.leaders() == ["leader"]
    assert flown.nearest(10.0) >= 20.0
    assert flown.errors(10.0).max() < 1.0


def led_by_order(**rehearsal: object) -> Formation:
    """A circle on which f2 is ordered to lead: given 4 s before it begins."""
    circle = {"type": "circle", "centre": {"north_m": 0, "east_m": 250}, "radius_m": 250}
    changes = {"path": circle, "paths": {}, "deputies": ["f1", "f2"]}
    mission = in_place("shapes", rate_hz=RATE_HZ, **rehearsal)
    return Formation(replaced(mission, **changes, orders=[{"at_s": AT_S, "lead": "f2"}]))


@pytest.mark.parametrize("at_s", [AT_S - 0.2, AT_S + 0.1])
@pytest.mark.parametrize("lost", ["leader", "f2"])
def test_whoever_is_lost_while_the_lead_goes_over_another_leads_on(lost, at_s):
    flight = led_by_order()
    flight.fly(at_s)
    flight.kill(lost)
    flown = flight.fly(32.0)
    # A dead companion's last word about itself is no word.
    leads = "f2" if lost == "leader" else "leader"
    assert [name for name in flight.leaders() if name != lost] == [leads]
    alive = [name for name in flight.names if name != lost]
    assert {flight.aircraft[name].companion.snapshot.mode.value for name in alive} == {"tracking"}
    # The aircraft whose companion is gone flies straight on, and is kept clear of.
    assert flown.nearest(10.0) >= 15.0
    if lost == "f2":
        f1, _, f3 = flown.errors(30.0)
        assert max(f1.max(), f3.max()) < 0.5
    if lost == "f2" and at_s > AT_S:
        assert "leads the formation again" in flown.words("leader")


@pytest.mark.parametrize(
    ("flown", "reason"), [(True, "its companion does not steer it"), (False, "is not heard")]
)
def test_nobody_leads_by_order_that_its_pilot_flies_or_that_is_not_heard(flown, reason):
    lost = [] if flown else [{"vehicle": "f2", "at_s": 5.0, "what": "link"}]
    flight = led_by_order(losses=lost)
    flight.fly(5.0)
    if flown:
        flight.emulators["f2"].select(LOITER)
    found = flight.fly(18.0)
    assert flight.order_numbers() == [0, 0, 0, 0]
    assert flight.leaders()[0] == "leader"
    for name in ("leader", "f1", "f3"):
        assert f"order 1 is refused: f2 is to lead, and {reason}" in found.words(name)
    assert found.nearest(10.0) >= 15.0


def test_one_that_its_pilot_takes_after_all_have_agreed_does_not_lead_and_that_is_told():
    flight = led_by_order()
    flight.fly(13.0)
    flight.emulators["f2"].select(LOITER)
    flown = flight.fly(30.0)
    assert flight.leaders() == ["leader"]
    for name in flight.names:
        assert "f2 does not lead: leader leads" in flown.words(name)
    f1, _, f3 = flown.errors(28.0)
    assert max(f1.max(), f3.max()) < 0.5
    assert flown.nearest(10.0) >= 10.0


def test_a_leader_that_its_pilot_takes_once_it_has_handed_over_leaves_and_all_fly_on():
    flight = led_by_order()
    flight.fly(20.0)
    flight.emulators["leader"].select(LOITER)
    flown = flight.fly(40.0)
    assert flight.leaders() == ["f2"]
    modes = {one.companion.snapshot.mode.value for one in list(flight.aircraft.values())[1:]}
    assert modes == {"tracking"}
    assert flown.nearest(10.0) >= 10.0


def test_a_deputy_that_leads_goes_into_a_hold_and_out_of_it_in_turns_that_an_aircraft_can_fly():
    lost = {"vehicle": "leader", "at_s": 15.0, "what": "companion"}
    # A circle of 200 m: half way round it, after some 30 s, the path leads the other way.
    orders = [{"at_s": 30.0, "action": "hold"}, {"at_s": 64.0, "action": "resume"}]
    changes = {"deputies": ["f1", "f2"], "orders": orders}
    flight = Formation(replaced(in_place("shapes", rate_hz=RATE_HZ, losses=[lost]), **changes))
    for until_s, number in ((45.0, 1), (78.0, 2)):
        flight.fly(until_s)
        assert flight.order_numbers()[1:] == [number] * 3
        assert flight.leaders() == ["f1"]
    # Who hears a leader that turns at once takes it for one that cannot be.
    assert not any("what cannot be" in flight.flown().words(name) for name in ("f2", "f3"))
    flown = flight.flown()
    assert flown.errors(40.0).max() < 10.0


@pytest.mark.parametrize("deputies", [[], ["f1"]])
def test_at_the_end_of_a_route_all_go_back_to_their_autopilots_together(deputies):
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 450, "east_m": 0}]
    route = {"type": "waypoints", "waypoints": corners, "end": "hand-back", "radius_m": 150}
    changes = {"path": route, "orders": [], "paths": {}, "deputies": deputies}
    flight = Formation(replaced(in_place("shapes", rate_hz=RATE_HZ), **changes))
    flight.fly(12.0)
    assert {one.companion.flight_mode for one in flight.aircraft.values()} == {"GUIDED"}
    flight.fly(45.0)
    assert {one.companion.flight_mode for one in flight.aircraft.values()} == {"LOITER"}
    said = {
        name: [event.time_s for event in one.events if "route is at its end" in event.text]
        for name, one in flight.aircraft.items()
    }
    # Each says so once, and all of them within a quarter of a second.
    assert [len(times) for times in said.values()] == [1, 1, 1, 1]
    moments = [times[0] for times in said.values()]
    assert max(moments) - min(moments) <= 0.25
    flown = flight.flown()
    assert flown.nearest(10.0) >= 7.0
    f1, f2, f3 = (float(flown.height(name)[-1]) for name in ("f1", "f2", "f3"))
    # There, and on their way to 30 and 45 m above the leader.
    assert f1 == pytest.approx(15.0, abs=3.0)
    assert min(f2, f3) >= f1 + 8.0
    assert all("leads" not in flight.flown().words(name) for name in deputies)
