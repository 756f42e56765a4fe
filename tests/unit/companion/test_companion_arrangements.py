"""Orders are agreed on by all or change nobody, whatever is lost; an abort is flown at once by itself."""

import math
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.companion import new_flight
from tests.kit.missions import plan_of, replaced
from tests.kit.orders import (
    NAMES,
    SLOTS,
    Formation,
    abort,
    answered,
    begun,
    called_off,
    further,
    heard,
    member_of,
    moves,
    order_of,
    ordered,
)
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.ordered_flight import KnownOrder
from vfguide.companion.plan import FlightPlan
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.formation.arrangement import (
    Arrangement,
    HoldCircle,
    Manoeuvre,
    Point,
    SlotMove,
    missing_votes,
)
from vfguide.link.order_codec import Reply, Verdict, check_of, encode_order, encode_reply

AWAY = {name: Point(1.5 * slot.forward, 1.5 * slot.right) for name, slot in SLOTS.items()}
"""Where `further` leads to."""
STAYING = {name: SLOTS[name] for name in ("f2", "f3")}
LEFT, RIGHT = Point(-20, -10), Point(-20, 10)


def test_all_fly_an_order_from_its_time_on_once_all_have_agreed():
    formation = ordered(further(SLOTS), until_s=9.9)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    formation.run(10.05)
    assert formation.flown == dict.fromkeys(NAMES, 1)
    # Half of the way at half of the time.
    slot = formation.members["leader"].flight.slot("f1", 15.0)
    assert slot.forward == pytest.approx(1.25 * SLOTS["f1"].forward)
    assert {name for name, reply in formation.said if reply.verdict is Verdict.FLOWN} == set(NAMES)
    # The slots move from 10 to 20 s: each says once that they are at rest.
    done = "order 1 is carried out: all slots are at rest"
    formation.run(19.9)
    assert formation.words.count(done) == 0
    formation.run(25.0)
    assert formation.words.count(done) == len(NAMES)


def test_the_position_error_to_fly_by_is_a_quarter_of_the_spacing_that_is_flown():
    """40 m and 28.28 m in the mission: 7 m at most; narrowed to 0.7, 28 m and 19.80 m: 4.95 m."""
    ends = {name: Point(0.7 * slot.forward, 0.7 * slot.right) for name, slot in SLOTS.items()}
    flown = ordered(order_of(*moves(ends)), until_s=25.0).members["f1"].flight
    assert begun().members["f1"].flight.most_m(5.0) == 7.0
    assert flown.most_m(25.0) == pytest.approx(4.95, abs=0.01)


def test_a_narrower_slot_narrows_what_its_vehicle_is_steered_by():
    """At 13 m behind and to the left of its leader, 18.38 m: a quarter is 4.596 m."""
    flown = new_flight(until_s=8.0)
    order = order_of(*moves({"f1": Point(-13.0, -13.0)}), time_s=8.0, across_s=4.0)
    known = KnownOrder(arrangement=order, signed=b"", check=0)
    flown.companion._arrangements.flight.begin(known)  # noqa: SLF001
    flown.run(14.0)
    vehicle = flown.companion._vehicle  # noqa: SLF001
    assert vehicle.own.belief.most_m == pytest.approx(4.596, abs=0.001)
    assert vehicle.role.followed.stories.most_m == vehicle.own.belief.most_m


ALL = frozenset(NAMES)
F1_MOVES = order_of(*moves({"f1": Point(-90, 0)} | STAYING))
WITHOUT_F3 = order_of(*moves({name: SLOTS[name] for name in ("f1", "f2")}))
"""Orders in which only f1 moves, and in which f3 is dismissed."""


@pytest.mark.parametrize(
    ("order", "agreed", "closing", "lacking"),
    [
        (further(SLOTS), ALL, False, []),
        # Two whose slots move are silent: nothing goes without them.
        (further(SLOTS), {"leader", "f1"}, True, ["f2", "f3"]),
        # One whose slot stays is silent: it is waited for, and then most of them decide.
        (F1_MOVES, ALL - {"f3"}, False, ["f3"]),
        (F1_MOVES, ALL - {"f3"}, True, []),
        (F1_MOVES, {"leader", "f1"}, True, ["f2", "f3"]),
        # Who is dismissed is not asked.
        (WITHOUT_F3, ALL - {"f3"}, False, []),
        # Who is to lead has to agree, wherever its slot is.
        (order_of(*moves(dict(SLOTS)), lead="f2"), ALL - {"f2"}, True, ["f2"]),
    ],
)
def test_those_who_move_have_to_agree_and_most_of_the_others(order, agreed, closing, lacking):
    assert missing_votes(order, "leader", agreed, ALL, closing=closing) == lacking


def test_a_follower_that_says_nothing_does_not_keep_the_others_from_dismissing_it():
    formation = begun(silent={"f3"})
    # It is heard flying by its slot all the same.
    formation.members["leader"].hear("f3", heard(5.0, 0), 5.0)
    formation.give(WITHOUT_F3, until_s=12.0)
    assert [formation.flown[name] for name in ("leader", "f1", "f2")] == [1, 1, 1]


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        (order_of(*moves({"f1": Point(-50.0, 0.0, -90.0)}), across_s=60.0), "f1 would fly 10 m"),
        (further({**SLOTS, "f2": SLOTS["f1"]}), "would come within"),
        (further({**SLOTS, "f9": Point(-90.0, 0.0)}), "f9 is no follower"),
    ],
)
def test_an_order_that_was_missed_passes_the_limits_of_a_fresh_one(order, sentence):
    member = member_of()
    for name in ("f2", "f3"):
        member.hear(name, heard(30.0, 1), 30.0)
    data = encode_order(order)
    member.receive_order(data, data, 30.0, repeated=True)
    assert member.flight.flown is None
    assert sentence in answered(member)[-1].text
    assert member.waits(30.0)


def test_in_a_formation_of_two_the_other_one_is_waited_for_after_a_start_and_no_longer():
    plan = plan_of(vehicle="leader")
    pair = replace(plan, others=tuple(one for one in plan.others if one.name == "f1"))
    leader = Arrangements(pair, SAME_CLOCK)
    for now, waits in ((5.0, True), (25.1, False)):
        leader.hear("f1", heard(now, 2**32 - 1), now)
        assert leader.waits(now) is waits


@pytest.mark.parametrize("deaf", NAMES)
def test_an_order_that_one_has_not_received_changes_nobody(deaf):
    formation = ordered(
        further(SLOTS), until_s=60.0, lost=lambda kind, _, to, __: kind == "order" and to == deaf
    )
    assert formation.flown == dict.fromkeys(NAMES, 0)
    void = [reply.text for _, reply in formation.said if reply.verdict is Verdict.VOID]
    assert len(void) >= len(NAMES) - 1
    if deaf != "leader":
        assert f"{deaf} does not answer" in void


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.floats(0.0, 0.95))
def test_whatever_is_lost_all_fly_the_same_in_the_end_and_no_order_without_all_answers(seed, loss):
    random = Random(seed)
    formation = Formation(lost=lambda *_: formation.now < 15.0 and random.random() < loss)
    formation.run(5.0)
    for _ in range(4):
        formation.give(further(SLOTS), until_s=formation.now + 0.5)
    formation.run(60.0)
    assert len(set(formation.flown.values())) == 1
    if formation.flown["leader"]:
        ready = {name for name, reply in formation.said if reply.verdict is Verdict.READY}
        assert ready >= set(NAMES[1:])


def test_one_that_cannot_is_asked_once_and_says_why_and_nobody_changes():
    ends = {name: Point(slot.forward + 200.0, slot.right + 300.0) for name, slot in SLOTS.items()}
    formation = ordered(order_of(*moves(ends)), until_s=30.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    # 200 m in 10 s at 1/0.7 of the mean beside 20 m/s: 48.6 m/s.
    refused = "order 1 is refused: f1 would have to fly 48.6 m/s, and its limit is 32 m/s"
    assert refused in formation.words


@pytest.mark.parametrize(
    ("order", "sentence"),
    [
        (further(SLOTS, time_s=5.5), "its time is 0 s ahead"),
        (further(SLOTS, time_s=500.0), "its time is 495 s ahead"),
        (order_of(*moves({"f9": Point(0, 9)}, {"f9": Point(0, 9)})), "f9 is no follower"),
        (order_of(*moves({"f1": LEFT}, {"f1": Point(-90, 0)})), "f1 is to begin -90 m ahead of"),
        (
            order_of(*moves({"f2": LEFT, "f3": RIGHT}, {"f2": RIGHT, "f3": LEFT})),
            "f2 and f3 would come within 0.0 m of each other 5 s after its beginning",
        ),
    ],
)
def test_a_wrong_order_is_refused_with_its_reason(order, sentence):
    assert_refused(member_of(), order, sentence)


@pytest.mark.parametrize(
    ("joining_m", "spacing", "sentence"),
    [
        # Slots 20 and 20 m behind and aside: 28.3 m from the leader, to be 0.4 times as far.
        (60.0, 0.4, "f1 is still 60 m from its slot, and leader would come within 11.3 m"),
        (60.0, 0.6, None),
        (0.0, 0.4, None),
    ],
)
def test_slots_come_near_the_one_of_a_vehicle_only_once_it_has_joined(joining_m, spacing, sentence):
    slot, member = SLOTS["f1"], member_of()
    member.joining_m = joining_m
    nearer = moves({"f1": Point(spacing * slot.forward, spacing * slot.right)})
    assert_refused(member, order_of(*nearer), sentence)


@pytest.mark.parametrize("restarted", NAMES)
def test_a_companion_that_was_restarted_waits_until_the_order_is_repeated(restarted):
    formation = ordered(further(SLOTS), until_s=30.0)
    formation.start(restarted)
    for now, waits in ((30.3, True), (34.0, False)):
        formation.run(now)
        assert formation.members[restarted].waits(now) is waits
    assert formation.flown == dict.fromkeys(NAMES, 1)


def test_an_old_order_is_not_flown_again():
    formation = ordered(further(SLOTS, number=7), until_s=30.0)
    formation.give(order_of(*moves(SLOTS, AWAY), number=5, time_s=40.0), until_s=60.0)
    assert formation.flown == dict.fromkeys(NAMES, 7)


def test_who_has_no_place_leaves_and_comes_back_by_another_order():
    stay = moves({name: SLOTS[name] for name in ("f1", "f3")})
    formation = ordered(order_of(*stay, across_s=6.0), until_s=20.0)
    assert [name for name in NAMES if formation.members[name].flight.has_left] == ["f2"]
    assert formation.members["f2"].obstacle(20.0) == "ordered out of the formation"
    assert formation.members["f1"].obstacle(20.0) is None
    formation.give(order_of(*moves(SLOTS), number=2, time_s=30.0, across_s=6.0), until_s=30.1)
    assert not formation.members["f2"].flight.has_left
    assert formation.members["f2"].returns_to_formation()
    assert not formation.members["f2"].returns_to_formation()


def test_an_operator_that_asks_hears_the_order_that_is_flown():
    member = ordered(further(SLOTS), until_s=30.0).members["leader"]
    asks = encode_reply(Reply(number=0, verdict=Verdict.UNKNOWN))
    for time_s in (30.0, 30.5):
        member.receive_reply("operator", asks, time_s)
    assert member.to_say()[1] == [encode_order(further(SLOTS))]


def test_one_that_misses_the_confirmation_goes_on_until_its_time_and_flies_the_order_once_repeated():
    member = member_of("f2")
    data = encode_order(further(SLOTS))
    member.receive_order(data, data, 5.0)
    # Of the leader nothing is heard any more.
    member.hear("f1", heard(6.0, 1), 6.0)
    assert not member.waits(6.0)
    for name in ("f1", "f3"):
        member.hear(name, heard(10.0, 1), 10.0)
    member.step(10.1)
    member.receive_order(data, data, 10.2, repeated=True)
    assert member.number == 1
    assert not member.waits(10.2)


def test_one_that_took_an_order_for_void_flies_it_once_the_others_do():
    lost = {"state"}
    formation = ordered(
        further(SLOTS), until_s=10.4, lost=lambda kind, _, to, __: kind in lost and to == "f2"
    )
    # Its own clock alone has brought it here: a leader whose states come late says nothing of the order.
    formation.members["f2"].hear("leader", heard(10.4, 0), 10.4)
    formation.run(10.7)
    void = "order 1 is void: the leader has not confirmed it; all fly on as before"
    assert void in formation.words
    lost.clear()
    formation.run(14.0)
    assert formation.flown == dict.fromkeys(NAMES, 1)
    assert not formation.members["f2"].waits(14.0)


def test_what_a_vehicle_repeats_counts_only_where_the_others_fly_by_it():
    member = member_of()
    off = called_off(number=4, time_s=99.0)
    for data in (off, encode_order(further(SLOTS, time_s=104.0))):
        member.receive_order(data, data, 100.0, repeated=True)
    assert member.flight.flown is None
    assert member.to_say() == ([], [])
    member.hear("leader", heard(100.0, 4), 100.0)
    member.receive_order(off, off, 100.1, repeated=True)
    assert member.flight.has_left


class RebootedClock:
    """A follower's view of the formation's clock: 1000 s ahead of its own until the leader's starts anew."""

    def __init__(self) -> None:
        self.ahead_s = 1000.0
        clock = SharedClock(from_own=lambda own_s: own_s + self.ahead_s)
        self.member = Arrangements(plan_of(vehicle="f1"), clock)
        self.member.receive_order(encode_order(further(SLOTS, time_s=1010.0)), b"", 5.0)


@pytest.mark.parametrize(
    ("at_s", "share"), [(15.0, 0.5), (60.0, 1.0)], ids=["on the way", "all done"]
)
def test_slots_stay_where_they_are_when_the_leaders_computer_starts_anew(at_s, share):
    clock = RebootedClock()
    member = clock.member
    member.hear("leader", heard(6.0, 1), 6.0)
    member.step(10.0)
    before = member.flight.slot("f1", at_s)
    clock.ahead_s = -20.0
    member.step(at_s)
    after = member.flight.slot("f1", at_s)
    assert after.forward == pytest.approx(before.forward)
    assert after.forward == pytest.approx((1.0 + 0.5 * share) * SLOTS["f1"].forward)
    # What is on its way goes on; then the next order is taken by the new clock.
    member.to_say()
    now = at_s + 30.0
    order = order_of(*moves(SLOTS, AWAY), number=2, time_s=now - 20.0 + 6.0)
    member.receive_order(encode_order(order), b"", now)
    member.step(now)
    assert [reply.verdict for reply in answered(member)] == [Verdict.READY]


def test_an_order_that_waits_for_its_time_is_decided_when_the_clock_starts_anew():
    clock = RebootedClock()
    member = clock.member
    member.step(5.0)
    clock.ahead_s = -4.0
    for time_s in (6.0, 10.4, 10.6):
        member.hear("leader", heard(time_s, 0), time_s)
        member.step(time_s)
    assert answered(member)[-1].verdict is Verdict.VOID


def test_a_leader_whose_computer_was_started_anew_flies_the_order_that_all_others_fly():
    leader = member_of("leader")
    for name in ("f1", "f2"):
        leader.hear(name, heard(20.0, 7), 20.0)
    data = encode_order(further(SLOTS, number=7, time_s=100010.0))
    leader.receive_order(data, data, 20.0, repeated=True)
    assert not leader.waits(20.0)
    assert leader.flight.slot("f1", 20.0).forward == 1.5 * SLOTS["f1"].forward


def given_apart(first: bytes, second: bytes, *, to: str, both: bool) -> Formation:
    """Make a formation of which one is given the second order (first), the others the first one."""
    formation = begun()
    for name, member in formation.members.items():
        orders = (second, first) if name == to else (first, second)
        for data in orders if both else orders[:1]:
            member.receive_order(data, data, 5.0)
    formation.run(60.0)
    return formation


def test_two_orders_of_one_number_are_not_both_flown():
    slow = replace(further(SLOTS), across_s=12.0)
    first, second = encode_order(further(SLOTS)), encode_order(slow)
    formation = given_apart(first, second, to="f1", both=True)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    for check in (check_of(first), check_of(second)):
        verdicts = {reply.verdict for _, reply in formation.said if reply.check == check}
        # Who hears that the leader has the other one agrees to its own no more.
        assert verdicts - {Verdict.READY} == {Verdict.REFUSED, Verdict.VOID}


def test_who_holds_another_order_of_the_number_that_the_leader_confirms_flies_the_leaders():
    given, other = (
        encode_order(order_of(*moves(SLOTS | {name: AWAY[name]}))) for name in ("f1", "f3")
    )
    formation = given_apart(given, other, to="f3", both=False)
    checks = {name: one.flight.order.check for name, one in formation.members.items()}
    assert checks == dict.fromkeys(NAMES, check_of(given))


def test_a_leader_that_nobody_hears_flies_no_order_alone():
    def lost(kind: str, sender: str, *_: object) -> bool:
        return (kind, sender) == ("state", "leader")

    formation = ordered(further(SLOTS), until_s=60.0, lost=lost)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    void = "order 1 is void: nobody has heard that it is confirmed; all fly on as before"
    assert void in formation.words


def led_by_any(vehicle: str) -> FlightPlan:
    """The part of a vehicle in a mission that f1 and f2 may lead, too."""
    return flight_plan(replaced("line-calm", deputies=["f1", "f2"]), vehicle)


def test_a_void_order_is_flown_by_nobody_whatever_one_vehicle_says():
    formation = begun(plan=led_by_any, silent={"f2"})
    formation.give(further(SLOTS))
    while formation.now < 14.0:
        formation.run(formation.now + 0.25)
        for name in ("leader", "f1", "f2"):
            formation.members[name].hear("f3", heard(formation.now, 1), formation.now)
    assert formation.flown == dict.fromkeys(NAMES, 0)


@pytest.mark.parametrize(("told", "flies"), [(["f2"], 0), (["f1", "f2"], 1), (["f2", "f3"], 1)])
def test_what_a_leader_has_confirmed_that_is_lost_since_is_flown_by_all_or_by_nobody(told, flies):
    def lost(kind: str, sender: str, to: str, _: float) -> bool:
        if kind == "reply":
            # Who leads after it could not decide anew.
            return (sender, to) == ("f3", "f1")
        return (kind, sender) == ("state", "leader") and to not in told

    formation = ordered(further(SLOTS), until_s=9.0, plan=led_by_any, lost=lost)
    formation.silent.add("leader")
    for name in NAMES[1:]:
        formation.members[name].coordinator = "f1"
    formation.run(30.0)
    assert [formation.flown[name] for name in NAMES[1:]] == [flies] * 3


@pytest.mark.parametrize(
    ("vehicle", "numbers", "waits"),
    [
        # The leader's number counts, and that of two others; never that of one.
        ("f2", {"leader": 7, "f1": 0, "f3": 0}, True),
        ("f2", {"leader": 0, "f1": 7, "f3": 7}, True),
        ("leader", {"f1": 7}, False),
        ("f2", {"f1": 2**32 - 1}, False),
        ("f2", {"leader": 0, "f1": 2**32 - 1, "f3": 0}, False),
    ],
)
def test_the_number_of_one_vehicle_stops_nobody(vehicle, numbers, waits):
    member = member_of(vehicle)
    for name, number in numbers.items():
        member.hear(name, heard(5.0, number), 5.0)
    assert member.waits(5.0) is waits
    assert (member.obstacle(5.0) is not None) is waits
    # Nor does it bring back what was called off in another flight.
    old = called_off(number=2**32 - 1, time_s=5.0)
    member.receive_order(old, old, 5.0, repeated=True)
    assert member.flight.flown is None


@pytest.mark.parametrize(
    ("to", "layer", "climb_s", "sentence"),
    [
        # 1/0.7 of the mean, in 10 s: 42.9 m/s for 300 m.
        ((300.0, 0.0), None, 0.0, "f1 would have to fly 42.9 m/s aside"),
        ((0.0, 100.0), None, 0.0, "f1 would have to climb at 14.3 m/s, and its limit is 4"),
        ((0.0, 30.0), 60.0, 20.0, "f1 would have to climb at 4.3 m/s"),
        ((0.0, 30.0), 60.0, 0.0, "f1 would have to climb at 857.1 m/s"),
        ((0.0, 0.0), 54.0, 20.0, "f1 would have to sink at 3.9 m/s, and its limit is 3"),
        ((0.0, 0.0), 40.0, 20.0, None),
    ],
)
def test_a_slot_that_moves_faster_than_its_aircraft_is_refused(to, layer, climb_s, sentence):
    begin = SLOTS["f1"]
    end = Point(begin.forward, begin.right + to[0], to[1])
    place = SlotMove(vehicle="f1", begin=begin, end=end, layer=layer)
    assert_refused(member_of(), order_of(place, climb_s=climb_s), sentence)


def hold_of(radius_m: float, away_deg: float) -> Arrangement:
    latitude, longitude = plan_of().frame.origin
    circle = HoldCircle(
        latitude_deg=latitude + away_deg, longitude_deg=longitude, radius_m=radius_m
    )
    return order_of(flown=Manoeuvre.HOLD, circle=circle)


@pytest.mark.parametrize(
    ("vehicle", "hold", "sentence"),
    [
        # 20 m/s at 45 degrees: 20² / 9.81 = 41 m.
        ("leader", (20.0, 0.0), "a circle of 20 m is too small: at least 41 m are needed"),
        ("f1", (20.0, 0.0), "a circle of 20 m is too small"),
        ("leader", (200.0, 1.0), "the circle is 111 km away, more than 5 km"),
        ("f1", (200.0, 0.01), None),
    ],
)
def test_a_hold_that_nobody_can_fly_or_that_is_elsewhere_is_refused(vehicle, hold, sentence):
    assert_refused(member_of(vehicle), hold_of(*hold), sentence)


def assert_refused(member: Arrangements, order: Arrangement, sentence: str | None) -> None:
    """See that an order is refused with this in its sentence; with none, that it is agreed to."""
    member.receive_order(encode_order(order), b"", 5.0)
    member.step(5.0)
    (reply,) = answered(member)
    assert reply.verdict is (Verdict.READY if sentence is None else Verdict.REFUSED)
    assert (sentence or "") in reply.text


def test_an_order_may_be_given_while_slots_still_move_that_are_at_rest_at_its_time():
    # They move from 10 s to 20 s.
    formation = ordered(further(SLOTS), until_s=16.0)
    formation.give(further(AWAY, number=2, time_s=20.5), until_s=21.0)
    assert formation.flown == dict.fromkeys(NAMES, 2)


def test_an_abort_is_flown_at_once_without_answers():
    formation = begun()
    formation.give(abort(time_s=0.0))
    assert formation.flown == dict.fromkeys(NAMES, 4)
    assert all(member.flight.has_left for member in formation.members.values())


@pytest.mark.parametrize(
    ("clock", "given_s", "flown"),
    [
        *((SAME_CLOCK, given_s, given_s == 71.0) for given_s in (69.0, 71.0, 131.0)),
        (SharedClock(from_own=lambda _: math.nan), 1e6, True),
    ],
)
def test_an_abort_is_of_now_where_a_time_is_known(clock, given_s, flown):
    member = Arrangements(plan_of(vehicle="f1"), clock)
    member.receive_order(called_off(number=4, time_s=given_s), b"", 100.0)
    assert member.flight.has_left is flown
    (reply,) = answered(member)
    assert reply.verdict is (Verdict.FLOWN if flown else Verdict.REFUSED)


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
    stays = SlotMove(vehicle="f1", begin=begin, end=begin)
    rises = replace(stays, end=replace(begin, up=6.0), layer=20.0)
    member = member_of()
    member.hear("leader", heard(10.0, 1), 10.0)
    member.receive_order(encode_order(order_of(rises, climb_s=20.0)), b"", 10.0)
    # Half of its way into the layer, and the abort tells the mission's slot.
    assert member.own_up(20.0) == pytest.approx(10.0)
    member.receive_order(encode_order(abort(stays, number=2, time_s=20.0)), b"", 20.0)
    assert member.own_up(60.0) == pytest.approx(10.0)


def test_an_old_abort_of_a_lower_number_is_not_flown():
    formation = ordered(further(SLOTS, number=4, time_s=10.0), until_s=40.0)
    formation.give(abort(number=3, time_s=9.0))
    assert not any(member.flight.has_left for member in formation.members.values())


def test_no_order_brings_a_formation_back_after_an_abort():
    formation = ordered(abort(), until_s=6.0)
    formation.give(further(SLOTS, number=5, time_s=12.0), until_s=15.0)
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
    formation = ordered(abort(), until_s=60.0)
    formation.start("f2")
    formation.run(64.0)
    assert formation.members["f2"].flight.has_left
