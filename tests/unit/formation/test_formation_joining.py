"""Who joins is given a slot of the formation as it is then."""

import pytest

from tests.kit.orders import CIRCLE, MOTION, VEE
from vfguide.formation.arrangement import Point
from vfguide.formation.orders import Formation, Order, arrangement_of
from vfguide.formation.transition import RefusedOrderError

FORMATION = Formation(leader="leader", home=VEE, slots=VEE)


def after(*orders: Order, formation: Formation = FORMATION) -> Formation:
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


def test_between_the_leader_and_the_last_of_a_trail_there_is_room_first():
    shaped = after(Order(shape="trail", spacing=20.0))
    # Whose spacing may have been 60 m or 30 m, as far as the last one tells: 20 m was of three.
    (last,) = [name for name, slot in shaped.slots.items() if slot.forward == -60.0]
    others = tuple(name for name in VEE if name != last)
    slots = after(Order(leave=others), Order(join=(others[0],)), formation=shaped).slots
    assert slots[others[0]].forward == -30.0


def test_two_that_join_at_once_come_to_two_places():
    gone = after(Order(leave=("f2", "f3")), Order(shape="trail", spacing=20.0))
    slots = after(Order(join=("f2", "f3")), formation=gone).slots
    assert sorted(slot.forward for slot in slots.values()) == [-60.0, -40.0, -20.0]


def test_among_slots_by_name_it_comes_to_its_slot_in_the_mission_or_is_refused():
    odd = Order(slots={"f1": Point(-33.0, 7.0), "f2": Point(5.0, -30.0)})
    assert joined("f3", LEFT, odd) == (-40.0, 40.0, 5.0)
    there = Order(slots={"f1": Point(-33.0, 37.0), "f2": Point(5.0, -30.0)})
    with pytest.raises(RefusedOrderError, match=r"f3 would join 9\.1 m from f1, less than 15 m"):
        joined("f3", LEFT, there)


def test_an_order_to_join_and_of_a_spacing_counts_from_the_present_shape():
    gone = after(LEFT, Order(shape="trail", spacing=20.0))
    slots = after(Order(join=("f3",), spacing=30.0), formation=gone).slots
    assert sorted(slot.forward for slot in slots.values()) == [-90.0, -60.0, -30.0]
