"""What calls everything off is flown at once, and nothing brings the formation back."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from tests.kit.orders import (
    NAMES,
    SLOTS,
    abort,
    answered,
    begun,
    called_off,
    further,
    heard,
    member_of,
    order_of,
)
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.timing import SharedClock
from vfguide.formation.arrangement import Point, SlotMove
from vfguide.link.order_codec import Verdict, check_of, encode_order


def test_an_abort_is_flown_at_once_without_answers():
    formation = begun()
    formation.give(abort(time_s=0.0))
    assert formation.flown == dict.fromkeys(NAMES, 4)
    assert all(member.flight.has_left for member in formation.members.values())


@pytest.mark.parametrize(("given_s", "flown"), [(69.0, False), (71.0, True), (131.0, False)])
def test_an_abort_is_of_now(given_s, flown):
    member = member_of()
    member.receive_order(called_off(number=4, time_s=given_s), b"", 100.0)
    assert member.flight.has_left is flown
    (reply,) = answered(member)
    assert reply.verdict is (Verdict.FLOWN if flown else Verdict.REFUSED)


def test_an_abort_is_flown_where_no_time_is_known():
    unknown = SharedClock(from_own=lambda _: math.nan)
    member = Arrangements(plan_of(vehicle="f1"), unknown)
    member.receive_order(called_off(number=4, time_s=1e6), b"", 100.0)
    assert member.flight.has_left


@pytest.mark.parametrize("number", [3, 4])
@pytest.mark.parametrize("now", [5.5, 11.0])
def test_an_abort_is_flown_whatever_its_number(number, now):
    formation = begun()
    formation.give(further(SLOTS, number=4, time_s=10.0))
    if now > 10.0:
        formation.run(now)
        assert formation.flown == dict.fromkeys(NAMES, 4)
    for member in formation.members.values():
        member.to_say()
        data = called_off(number=number, time_s=formation.now)
        member.receive_order(data, data, formation.now)
        member.receive_order(data, data, formation.now)
        assert member.flight.has_left
        expected = (number, Verdict.FLOWN, check_of(data))
        replies = [(one.number, one.verdict, one.check) for one in answered(member)]
        assert replies == [expected] * 2
    # The greater number decides, and nobody flies the pending order.
    formation.run(20.0)
    assert set(formation.flown.values()) == {4 if now > 10.0 else number}
    assert all(member.flight.has_left for member in formation.members.values())


def test_after_an_abort_the_height_of_the_slot_is_the_one_that_it_had():
    begin = SLOTS["f1"]
    end = Point(begin.forward, begin.right, 6.0)
    place = SlotMove(vehicle="f1", begin=begin, end=begin, layer=20.0)
    order = order_of(replace(place, end=end), climb_s=20.0)
    member = member_of()
    member.hear("leader", heard(10.0, 1), 10.0)
    member.receive_order(encode_order(order), b"", 10.0)
    # Half of its way into the layer, and the abort tells the mission's slot.
    back = abort(SlotMove(vehicle="f1", begin=begin, end=begin), number=2, time_s=20.0)
    assert member.own_up(20.0) == pytest.approx(10.0)
    member.receive_order(encode_order(back), b"", 20.0)
    assert member.own_up(60.0) == pytest.approx(10.0)


def test_an_old_abort_of_a_lower_number_is_not_flown():
    formation = begun()
    formation.give(further(SLOTS, number=4, time_s=10.0))
    formation.run(40.0)
    formation.give(abort(number=3, time_s=9.0))
    assert not any(member.flight.has_left for member in formation.members.values())


def test_no_order_brings_a_formation_back_after_an_abort():
    formation = begun()
    formation.give(abort())
    formation.run(6.0)
    formation.give(further(SLOTS, number=5, time_s=12.0))
    formation.run(15.0)
    assert formation.flown == dict.fromkeys(NAMES, 4)
    assert not any(member.returns_to_formation() for member in formation.members.values())
    refused = {reply.text for _, reply in formation.said if reply.verdict is Verdict.REFUSED}
    assert refused == {
        "everything was called off: no order brings the formation back, restart all companions"
    }
    # Nor does one that others are said to fly.
    member, order = formation.members["f1"], encode_order(further(SLOTS, number=6, time_s=14.0))
    member.hear("leader", heard(15.0, 6), 15.0)
    for repeated in (True, False):
        member.receive_order(order, order, 15.1, repeated=repeated)
        assert member.flight.called_off == 4
    # The same abort is answered as before, and a further one is flown.
    formation.give(abort(number=7, time_s=15.0))
    assert formation.flown == dict.fromkeys(NAMES, 7)


def test_after_an_abort_a_restarted_companion_hears_of_it_again():
    formation = begun()
    formation.give(abort())
    formation.run(60.0)
    formation.start("f2")
    formation.run(64.0)
    assert formation.members["f2"].flight.has_left
