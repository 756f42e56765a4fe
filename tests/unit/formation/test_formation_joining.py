"""Who joins is given a slot of the formation as it is then."""

import pytest

from vfguide.formation.arrangement import HoldCircle, Point
from vfguide.formation.orders import Formation, Order, arrangement_of
from vfguide.formation.transition import MotionLimits, RefusedOrderError

HOME = {"f1": Point(-20.0, 20.0), "f2": Point(-20.0, -20.0), "f3": Point(-40.0, 40.0, 5.0)}
"""The vee of the mission: its second place on the left is nobody's."""

FORMATION = Formation(leader="leader", home=HOME, slots=HOME)
LIMITS = MotionLimits(forward=5.0, back=4.0, aside=6.0, acceleration=1.0)
CIRCLE = HoldCircle(latitude_deg=47.0, longitude_deg=8.0, radius_m=200.0)


def after(*orders: Order, formation: Formation = FORMATION) -> Formation:
    """The formation once orders are flown, one after the other."""
    for number, order in enumerate(orders, 1):
        found, _ = arrangement_of(
            order, formation, LIMITS, number=number, time_s=100.0, circle=CIRCLE
        )
        formation = formation.after(found)
    return formation


def joined(name: str, *orders: Order) -> tuple[float, float, float]:
    """The slot of a vehicle that joins after these orders, m."""
    slot = after(*orders, Order(join=(name,))).slots[name]
    return slot.forward, slot.right, slot.up


LEFT = Order(leave=("f3",))


def test_in_the_missions_shape_it_comes_to_its_own_slot():
    assert joined("f3", LEFT) == (-40.0, 40.0, 5.0)


def test_after_another_spacing_its_own_slot_is_further_away():
    # 28.3 m between neighbours in the mission: half as much again.
    assert joined("f3", LEFT, Order(spacing=42.426)) == pytest.approx((-60.0, 60.0, 5.0))
    assert joined("f3", Order(spacing=42.426), LEFT) == pytest.approx((-60.0, 60.0, 5.0))


def test_where_two_have_changed_places_it_comes_to_the_one_that_was_left():
    # f1 flies where f3 did, f3 left from the place of f1.
    assert joined("f3", Order(swap=("f1", "f3")), LEFT) == (-20.0, 20.0, 5.0)


@pytest.mark.parametrize(
    ("shape", "place"),
    [
        ("trail", (-60.0, 0.0)),
        ("line-abreast", (0.0, 40.0)),
        ("echelon-left", (-42.4, -42.4)),
        ("finger-four", (-28.3, 28.3)),
    ],
)
def test_of_a_shape_that_two_fly_it_comes_to_the_third_place(shape, place):
    order = Order(shape=shape, spacing=20.0)
    # In steps of 0.1 m each.
    assert joined("f3", LEFT, order)[:2] == pytest.approx(place, abs=0.15)


def test_it_comes_to_the_gap_of_a_shape_that_it_has_left():
    shaped = after(Order(shape="trail", spacing=20.0))
    for name, place in shaped.slots.items():
        gap = after(Order(leave=(name,)), Order(join=(name,)), formation=shaped).slots[name]
        assert (gap.forward, gap.right) == (place.forward, place.right)


def test_between_the_leader_and_the_last_of_a_trail_there_is_room_first():
    shaped = after(Order(shape="trail", spacing=20.0))
    # Whose spacing may have been 60 m or 30 m, as far as the last one tells: 20 m was of three.
    (last,) = [name for name, slot in shaped.slots.items() if slot.forward == -60.0]
    others = tuple(name for name in HOME if name != last)
    slots = after(Order(leave=others), Order(join=(others[0],)), formation=shaped).slots
    assert slots[others[0]].forward == -30.0


def test_two_that_join_at_once_come_to_two_places():
    gone = after(Order(leave=("f2", "f3")), Order(shape="trail", spacing=20.0))
    slots = after(Order(join=("f2", "f3")), formation=gone).slots
    assert sorted(slot.forward for slot in slots.values()) == [-60.0, -40.0, -20.0]


def test_who_joins_a_leader_that_flies_alone_comes_to_its_slot_in_the_mission():
    gone = Order(leave=("f1", "f2", "f3"))
    assert joined("f2", gone) == (-20.0, -20.0, 0.0)


def test_among_slots_by_name_it_comes_to_its_slot_in_the_mission_or_is_refused():
    odd = Order(slots={"f1": Point(-33.0, 7.0), "f2": Point(5.0, -30.0)})
    assert joined("f3", LEFT, odd) == (-40.0, 40.0, 5.0)
    there = Order(slots={"f1": Point(-33.0, 37.0), "f2": Point(5.0, -30.0)})
    with pytest.raises(RefusedOrderError, match=r"f3 would join 9\.1 m from f1, less than 15 m"):
        joined("f3", LEFT, there)


def test_in_a_hold_it_comes_to_the_place_of_the_shape_at_a_height_of_its_own():
    held = Order(action="hold")
    assert joined("f3", LEFT, Order(shape="trail", spacing=20.0), held) == (-60.0, 0.0, 45.0)


def test_an_order_to_join_and_of_a_spacing_counts_from_the_present_shape():
    gone = after(LEFT, Order(shape="trail", spacing=20.0))
    slots = after(Order(join=("f3",), spacing=30.0), formation=gone).slots
    assert sorted(slot.forward for slot in slots.values()) == [-90.0, -60.0, -30.0]
