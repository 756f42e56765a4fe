"""What orders come to: an arrangement or a sentence why not; who joins has a slot of the newest."""

import pytest
from msgspec.structs import replace

from tests.kit.orders import CIRCLE, MOTION, VEE
from vfguide.formation.arrangement import Arrangement, HoldCircle, Manoeuvre, Point
from vfguide.formation.orders import Formation, Order, arrangement_of
from vfguide.formation.transition import RefusedOrderError

HOME = {**VEE, "f3": Point(-40.0, 40.0)}
FORMATION = Formation(leader="leader", home=HOME, slots=HOME)


def ordered(
    order: Order, formation: Formation = FORMATION, circle: HoldCircle | None = None
) -> Arrangement:
    """The arrangement alone."""
    found, _ = arrangement_of(order, formation, MOTION, number=7, time_s=100.0, circle=circle)
    return found


def ends_of(arrangement: Arrangement) -> dict[str, tuple[float, float]]:
    """(forward, right) of each follower afterwards."""
    return {one.vehicle: (one.end.forward, one.end.right) for one in arrangement.places}


@pytest.mark.parametrize(
    ("order", "places"),
    [
        # Each has the place with the least way.
        (Order(shape="line-abreast", spacing=25.0), [(0.0, 25.0), (0.0, -25.0), (0.0, 50.0)]),
        # The nearest two are 28.3 m apart: f1 and f3, or f1 and the leader.
        (Order(spacing=14.142), [(-10.0, 10.0), (-10.0, -10.0), (-20.0, 20.0)]),
        (Order(swap=("f2", "f3")), [(-20.0, 20.0), (-40.0, 40.0), (-20.0, -20.0)]),
    ],
)
def test_an_order_gives_each_a_place(order, places):
    assert ends_of(ordered(order)) == dict(zip(HOME, places, strict=True))


def test_who_leaves_has_no_place_and_gets_one_by_joining_alone():
    left = ordered(Order(leave=("f2",)))
    assert left.vehicles == {"f1", "f3"}
    gone = FORMATION.after(left)
    # It has no slot to move from: it comes to the one that waits for it.
    place = ordered(Order(join=("f2",)), gone).place_of("f2")
    assert place.begin == place.end == HOME["f2"]
    with pytest.raises(RefusedOrderError, match="f2 is not in the formation: let it join first"):
        ordered(Order(slots={"f2": Point(-60.0, 0.0)}), gone)
    back = ordered(Order(join=("f2",), slots={"f2": Point(-60.0, 0.0)}), gone)
    assert back.place_of("f2").end == Point(-60.0, 0.0)


def test_a_hold_stacks_heights_on_a_circle_and_resume_takes_them_back():
    held = ordered(Order(action="hold"), circle=CIRCLE)
    assert held.flown is Manoeuvre.HOLD
    assert [one.end.up for one in held.places] == [15.0, 30.0, 45.0]
    resumed = ordered(Order(action="resume"), FORMATION.after(held))
    assert (resumed.flown, resumed.circle) == (Manoeuvre.FORMATION, None)
    assert {one.end.up for one in resumed.places} == {0.0}


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        (Order(leave=("f9",)), "no follower is called 'f9': there are f1, f2, f3"),
        (Order(swap=("leader", "f1")), "leader leads: it has no slot"),
        (Order(join=("f1",)), "f1 is in the formation already"),
        (Order(swap=("f1", "f1")), "f1 cannot change places with itself"),
        (Order(shape="trail", spacing=4.0), r"would be 4\.0 m apart, less than 7\.5 m"),
        (Order(slots={"f1": Point(-40.0, 36.0)}), r"slots of f1 and f3 would be 4\.0 m apart"),
        (Order(swap=("f1", "f2"), leave=("f1",)), "f1 cannot leave and have a slot by one order"),
        (Order(slots={"f1": Point(-40.0, 0.0)}, leave=("f1",)), "f1 cannot leave and have a slot"),
        (Order(action="hold"), "where to hold is not known"),
        (Order(action="resume"), "nothing is held"),
    ],
)
def test_an_order_that_cannot_be_carried_out_is_refused_in_a_sentence(order, sentence):
    with pytest.raises(RefusedOrderError, match=sentence):
        ordered(order)


def test_after_an_abort_nothing_but_an_abort_can_be_ordered():
    aborted = replace(FORMATION, flown=Manoeuvre.ABORT)
    with pytest.raises(RefusedOrderError, match="called off"):
        ordered(Order(shape="vee", spacing=20.0), aborted)
    assert ordered(Order(action="abort"), aborted).flown is Manoeuvre.ABORT


@pytest.mark.parametrize(
    "order",
    [Order(leave=("f2",)), Order(shape="vee"), Order(spacing=30.0), Order(swap=("f1", "f2"))],
)
def test_any_order_but_resume_keeps_a_hold_its_circle_and_its_stack(order):
    held = FORMATION.after(ordered(Order(action="hold"), circle=CIRCLE))
    # The stack does not count for the spacing: f1 is 20 m behind and 20 m to the right, 28.28 m; with 15 m
    # above it would be 32.02 m.
    assert held.spacing == pytest.approx(28.284, abs=0.001)
    # Another circle is not what was asked for.
    found = ordered(order, held, replace(CIRCLE, radius_m=900.0))
    assert found.flown is Manoeuvre.HOLD
    assert found.circle == CIRCLE
    heights = {"f1": 15.0, "f2": 30.0, "f3": 45.0}
    kept = {name: heights[name] for name in found.vehicles}
    assert {one.vehicle: one.end.up for one in found.places} == kept


def test_who_joins_has_15_m_beside_its_slot_or_is_refused():
    formation = FORMATION.after(ordered(Order(leave=("f2",))))
    with pytest.raises(RefusedOrderError, match="less than 15 m: order a greater spacing"):
        ordered(Order(join=("f2",), shape="line-abreast", spacing=14.0), formation)
    # In an echelon 15 m are 10.6 and 10.6 m, in steps of 0.1 m, which makes 14.99 m.
    for shape in ("line-abreast", "echelon-left"):
        found = ordered(Order(join=("f2",), shape=shape, spacing=15.0), formation)
        assert found.vehicles == set(HOME)


def test_another_path_is_flown_until_a_third_is_ordered_whatever_comes_in_between():
    formation = replace(FORMATION, paths={"main": 5, "survey": 6})
    found, _ = arrangement_of(
        Order(path="survey"), formation, MOTION, number=7, time_s=100.0, turn_radius_m=120.0
    )
    assert (found.path, found.path_check, found.turn_radius_m) == ("survey", 6, 120.0)
    later = ordered(Order(shape="trail"), formation.after(found))
    assert (later.path, later.path_check, later.turn_radius_m) == ("survey", 6, 120.0)
    # Nobody's slot changes by the path alone.
    assert ends_of(found) == {name: (at.forward, at.right) for name, at in HOME.items()}


def test_who_leads_by_an_order_leads_in_it_alone():
    formation = replace(FORMATION, may_lead=("leader", "f1"))
    found = ordered(Order(lead="f1"), formation)
    assert found.lead == "f1"
    after = formation.after(found)
    assert after.leads == "f1"
    # A later order does not say it again: the lead may have gone elsewhere by itself.
    assert ordered(Order(shape="trail"), after).lead == ""
    with pytest.raises(RefusedOrderError, match="leader flies where slots count from: it has no"):
        ordered(Order(swap=("leader", "f1")), after)


@pytest.mark.parametrize(
    ("order", "may_lead", "sentence"),
    [
        (Order(path="home"), (), "no path is called 'home': the mission has main, survey"),
        (Order(path="main"), (), "the path 'main' is followed already"),
        (Order(lead="f1"), (), "f1 cannot lead: the mission names no deputies"),
        (Order(lead="f3"), ("leader", "f1"), "f3 may not lead: leader and deputies are leader, f1"),
        (Order(lead="leader"), ("leader", "f1"), "leader leads already"),
        (Order(lead="f1", leave=("f1",)), ("leader", "f1"), "f1 is not in the formation"),
    ],
)
def test_a_path_that_there_is_not_and_a_leader_that_may_not_lead_are_refused(
    order, may_lead, sentence
):
    formation = replace(FORMATION, paths={"main": 5, "survey": 6}, may_lead=may_lead)
    with pytest.raises(RefusedOrderError, match=sentence):
        ordered(order, formation)


JOINED = Formation(leader="leader", home=VEE, slots=VEE)


def after(*orders: Order, formation: Formation = JOINED) -> Formation:
    """The formation once orders are flown, one after the other."""
    options = {"time_s": 100.0, "circle": CIRCLE}
    for number, order in enumerate(orders, 1):
        found, _ = arrangement_of(order, formation, MOTION, number=number, **options)
        formation = formation.after(found)
    return formation


def joined(name: str, *orders: Order) -> tuple[float, float, float]:
    """The slot of a vehicle that joins after these orders, m."""
    slot = after(*orders, Order(join=(name,))).slots[name]
    return slot.forward, slot.right, slot.up


LEFT = Order(leave=("f3",))
WIDER = Order(spacing=42.426)
"""28.3 m between neighbours in the mission: half as much again."""

SHAPED = {
    "trail": (-60.0, 0.0),
    "line-abreast": (0.0, 40.0),
    "echelon-left": (-42.4, -42.4),
    "finger-four": (-28.3, 28.3),
}
"""Where the third has its place, m, at a spacing of 20 m."""


@pytest.mark.parametrize(
    ("orders", "place"),
    [
        ([LEFT], (-40.0, 40.0, 5.0)),
        ([LEFT, WIDER], (-60.0, 60.0, 5.0)),
        ([WIDER, LEFT], (-60.0, 60.0, 5.0)),
        # f1 flies where f3 did, f3 left from the place of f1.
        ([Order(swap=("f1", "f3")), LEFT], (-20.0, 20.0, 5.0)),
        # In a hold it has a height of its own.
        ([LEFT, Order(shape="trail", spacing=20.0), Order(action="hold")], (-60.0, 0.0, 45.0)),
        ([Order(leave=("f1", "f2", "f3"))], (-40.0, 40.0, 5.0)),
    ],
)
def test_it_comes_to_the_place_that_was_left(orders, place):
    assert joined("f3", *orders) == pytest.approx(place)


@pytest.mark.parametrize(("shape", "place"), SHAPED.items())
def test_of_a_shape_that_two_fly_it_comes_to_the_third_place(shape, place):
    # In steps of 0.1 m each.
    order = Order(shape=shape, spacing=20.0)
    assert joined("f3", LEFT, order)[:2] == pytest.approx(place, abs=0.15)


def test_it_comes_to_the_gap_of_a_shape_that_it_has_left():
    shaped = after(Order(shape="trail", spacing=20.0))
    for name, place in shaped.slots.items():
        gap = after(Order(leave=(name,)), Order(join=(name,)), formation=shaped).slots[name]
        assert (gap.forward, gap.right) == (place.forward, place.right)
    # Between the leader and the last of a trail, whose spacing may have been 60 m or 30 m as far as the
    # last one tells, there is room first: 20 m was of three.
    first, *_ = others = tuple(name for name, slot in shaped.slots.items() if slot.forward > -60.0)
    slots = after(Order(leave=others), Order(join=(first,)), formation=shaped).slots
    assert slots[first].forward == -30.0


@pytest.mark.parametrize(
    ("left", "spacing", "forward"),
    [
        (("f2", "f3"), {}, [-60.0, -40.0, -20.0]),
        # With a spacing it counts from the present shape.
        (("f3",), {"spacing": 30.0}, [-90.0, -60.0, -30.0]),
    ],
)
def test_two_that_join_at_once_come_to_two_places(left, spacing, forward):
    gone = after(Order(leave=left), Order(shape="trail", spacing=20.0))
    slots = after(Order(join=left, **spacing), formation=gone).slots
    assert sorted(slot.forward for slot in slots.values()) == forward


def test_among_slots_by_name_it_comes_to_its_slot_in_the_mission_or_is_refused():
    odd = Order(slots={"f1": Point(-33.0, 7.0), "f2": Point(5.0, -30.0)})
    assert joined("f3", LEFT, odd) == (-40.0, 40.0, 5.0)
    there = Order(slots={"f1": Point(-33.0, 37.0), "f2": Point(5.0, -30.0)})
    with pytest.raises(RefusedOrderError, match=r"f3 would join 9\.1 m from f1, less than 15 m"):
        joined("f3", LEFT, there)
