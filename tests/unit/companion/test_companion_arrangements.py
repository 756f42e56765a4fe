"""Orders are agreed on by all or change nobody, whatever the link loses; who missed one hears of it."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.companion.arrangements import Arrangements
from vfguide.companion.plan import FlightPlan, FollowerTask, KnownPath, LeadPlan
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.formation.arrangement import Arrangement, Circle, Manoeuvre, Place, Point
from vfguide.guidance.settings import PathGains
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    check_of,
    decode_reply,
    encode_order,
    encode_reply,
)
from vfguide.paths.circle import Circle as CirclePath
from vfguide.state import HeardState

MakePlan = Callable[..., FlightPlan]
NAMES = ("leader", "f1", "f2", "f3")
STEP_S = 0.05

Lost = Callable[[str, str, str, float], bool]
"""Whether something of a kind is lost from a sender to a receiver at a time."""


def nothing(kind: str, sender: str, receiver: str, now: float) -> bool:
    """A link that loses nothing."""
    del kind, sender, receiver, now
    return False


@dataclass
class Formation:
    """Four companions' knowledge of orders, on a link in memory."""

    plan: MakePlan
    lost: Lost = nothing
    now: float = 0.0
    members: dict[str, Arrangements] = field(default_factory=dict)
    said: list[tuple[str, Reply]] = field(default_factory=list)
    words: list[str] = field(default_factory=list)
    silent: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        for name in NAMES:
            self.start(name)

    def start(self, name: str) -> None:
        """A companion that knows nothing yet."""
        self.members[name] = Arrangements(self.plan(vehicle=name), SAME_CLOCK)

    def give(self, order: Arrangement) -> None:
        """An operator's order, on its way to everybody."""
        data = encode_order(order)
        for name, member in self.members.items():
            if not self.lost("order", "operator", name, self.now):
                member.receive_order(data, data, self.now)

    def run(self, until_s: float) -> None:
        """Go on until then: states 20 times a second of the leader, 4 times of the others."""
        while self.now < until_s:
            self.now = round(self.now + STEP_S, 3)
            for name, member in self.members.items():
                member.step(self.now)
                self.words += [text for text, _ in member.words()]
                replies, repeats = member.to_say()
                for other, receiver in self.members.items():
                    if other == name or name in self.silent:
                        continue
                    self._carry(name, other, receiver, replies, repeats)
                self.said += [(name, decode_reply(data)) for data in replies]

    def _carry(
        self,
        name: str,
        other: str,
        receiver: Arrangements,
        replies: list[bytes],
        repeats: list[bytes],
    ) -> None:
        for data in replies:
            if not self.lost("reply", name, other, self.now):
                receiver.receive_reply(name, data, self.now)
        for data in repeats:
            if not self.lost("repeat", name, other, self.now):
                receiver.receive_order(data, data, self.now, repeated=True)
        due = name == "leader" or round(self.now / STEP_S) % 5 == 0
        if due and not self.lost("state", name, other, self.now):
            state = heard(self.now, self.members[name].number)
            receiver.hear(name, state, self.now)

    @property
    def flown(self) -> dict[str, int]:
        """Number of what each flies."""
        return {
            name: 0 if member.flight.flown is None else member.flight.flown.number
            for name, member in self.members.items()
        }


def heard(time_s: float, number: int) -> HeardState:
    """A state that carries this number; nothing else of it counts here."""
    return HeardState(
        time_s=time_s,
        north=0.0,
        east=0.0,
        course=0.0,
        ground_speed=20.0,
        acceleration=0.0,
        turn_rate=0.0,
        turn_acceleration=0.0,
        altitude_amsl=588.0,
        steered=True,
        arrangement=number,
    )


@pytest.fixture
def slots(plan: MakePlan) -> dict[str, Point]:
    """The mission's."""
    return slots_of(plan)


def slots_of(plan: MakePlan) -> dict[str, Point]:
    """Those of the three followers."""
    found = {}
    for name in NAMES[1:]:
        task = plan(vehicle=name).task
        found[name] = Point(task.slot.forward, task.slot.right)  # type: ignore[union-attr]
    return found


def further(slots: dict[str, Point], *, number: int = 1, time_s: float = 10.0) -> Arrangement:
    """Everybody half as far again from the leader, within 10 s."""
    places = tuple(
        Place(vehicle=name, begin=slot, end=Point(1.5 * slot.forward, 1.5 * slot.right))
        for name, slot in slots.items()
    )
    return Arrangement(number=number, time_s=time_s, across_s=10.0, places=places)


def test_all_fly_an_order_from_its_time_on_once_all_have_agreed(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(further(slots))
    formation.run(9.9)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    formation.run(10.05)
    assert formation.flown == dict.fromkeys(NAMES, 1)
    # Half of the way at half of the time.
    slot = formation.members["leader"].flight.slot("f1", 15.0)
    assert slot is not None
    assert slot.forward == pytest.approx(1.25 * slots["f1"].forward)
    assert {name for name, reply in formation.said if reply.verdict is Verdict.FLOWN} == set(NAMES)
    # The slots move from 10 to 20 s: each says once that they are at rest.
    done = "order 1 is carried out: all slots are at rest"
    formation.run(19.9)
    assert formation.words.count(done) == 0
    formation.run(25.0)
    assert formation.words.count(done) == len(NAMES)


@pytest.mark.parametrize("deaf", NAMES)
def test_an_order_that_one_has_not_received_changes_nobody(
    plan: MakePlan, slots: dict[str, Point], deaf: str
) -> None:
    formation = Formation(plan, lost=lambda kind, _, to, __: kind == "order" and to == deaf)
    formation.run(5.0)
    formation.give(further(slots))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    void = [reply.text for _, reply in formation.said if reply.verdict is Verdict.VOID]
    assert len(void) >= len(NAMES) - 1
    if deaf != "leader":
        assert f"{deaf} does not answer" in void


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32), st.floats(0.0, 0.95))
def test_whatever_is_lost_all_fly_the_same_in_the_end_and_no_order_without_all_answers(
    plan: MakePlan, seed: int, loss: float
) -> None:
    random = Random(seed)
    formation = Formation(plan, lost=lambda *_: formation.now < 15.0 and random.random() < loss)
    slots = slots_of(plan)
    formation.run(5.0)
    for _ in range(4):
        formation.give(further(slots))
        formation.run(formation.now + 0.5)
    formation.run(60.0)
    assert len(set(formation.flown.values())) == 1
    if formation.flown["leader"]:
        ready = {name for name, reply in formation.said if reply.verdict is Verdict.READY}
        assert ready >= set(NAMES[1:])


def test_one_that_cannot_is_asked_once_and_says_why_and_nobody_changes(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    places = tuple(
        Place(vehicle=name, begin=slot, end=Point(slot.forward + 200.0, slot.right + 300.0))
        for name, slot in slots.items()
    )
    formation.run(5.0)
    formation.give(Arrangement(number=1, time_s=10.0, across_s=10.0, places=places))
    formation.run(30.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    # 200 m in 10 s at 1/0.7 of the mean beside 20 m/s: 48.6 m/s.
    assert "order 1 is refused: f1 would have to fly 48.6 m/s, and its limit is 32 m/s" in (
        formation.words
    )


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"time_s": 5.5}, "its time is 0 s ahead"),
        ({"time_s": 500.0}, "its time is 495 s ahead"),
        (
            {"places": (Place(vehicle="f9", begin=Point(0, 9), end=Point(0, 9)),)},
            "f9 is no follower",
        ),
        (
            {"places": (Place(vehicle="f1", begin=Point(-90, 0), end=Point(-50, 0)),)},
            "f1 is to begin -90 m ahead of",
        ),
        (
            {
                "places": (
                    Place(vehicle="f2", begin=Point(-20, 10), end=Point(-20, -10)),
                    Place(vehicle="f3", begin=Point(-20, -10), end=Point(-20, 10)),
                )
            },
            "f2 and f3 would come within 0.0 m of each other 5 s after its beginning",
        ),
    ],
)
def test_a_wrong_order_is_refused_with_its_reason(
    plan: MakePlan, slots: dict[str, Point], change: dict[str, object], sentence: str
) -> None:
    member = Arrangements(plan(vehicle="f1"), SAME_CLOCK)
    member.receive_order(encode_order(replace(further(slots), **change)), b"", 5.0)  # type: ignore[arg-type]
    (data,), _ = member.to_say()
    reply = decode_reply(data)
    assert reply.verdict is Verdict.REFUSED
    assert sentence in reply.text


@pytest.mark.parametrize(
    ("joining_m", "spacing", "sentence"),
    [
        # Slots 20 and 20 m behind and aside: 28.3 m from the leader, to be 0.4 times as far.
        (60.0, 0.4, "f1 is still 60 m from its slot, and leader would come within 11.3 m"),
        (60.0, 0.6, None),
        (0.0, 0.4, None),
    ],
)
def test_slots_come_near_the_one_of_a_vehicle_only_once_it_has_joined(
    plan: MakePlan, joining_m: float, spacing: float, sentence: str | None
) -> None:
    begin = slots_of(plan)["f1"]
    place = Place(
        vehicle="f1", begin=begin, end=Point(spacing * begin.forward, spacing * begin.right)
    )
    member = Arrangements(plan(vehicle="f1"), SAME_CLOCK)
    member.joining_m = joining_m
    assert_refused(
        member, Arrangement(number=1, time_s=10.0, across_s=10.0, places=(place,)), sentence
    )


def test_an_abort_is_flown_at_once_without_answers(plan: MakePlan) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(
        Arrangement(number=4, time_s=0.0, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )
    assert formation.flown == dict.fromkeys(NAMES, 4)
    assert all(member.flight.has_left for member in formation.members.values())


@pytest.mark.parametrize("restarted", NAMES)
def test_a_companion_that_was_restarted_waits_until_the_order_is_repeated(
    plan: MakePlan, slots: dict[str, Point], restarted: str
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(further(slots))
    formation.run(30.0)
    formation.start(restarted)
    formation.run(30.3)
    assert formation.members[restarted].waits(30.3)
    formation.run(34.0)
    assert not formation.members[restarted].waits(34.0)
    assert formation.flown == dict.fromkeys(NAMES, 1)


def test_an_old_order_is_not_flown_again(plan: MakePlan, slots: dict[str, Point]) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(further(slots, number=7))
    formation.run(30.0)
    back = tuple(
        Place(vehicle=name, begin=Point(1.5 * slot.forward, 1.5 * slot.right), end=slot)
        for name, slot in slots.items()
    )
    formation.give(Arrangement(number=5, time_s=40.0, across_s=10.0, places=back))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 7)


def test_who_has_no_place_leaves_and_comes_back_by_another_order(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    stay = tuple(Place(vehicle=name, begin=slots[name], end=slots[name]) for name in ("f1", "f3"))
    formation.give(Arrangement(number=1, time_s=10.0, across_s=6.0, places=stay))
    formation.run(20.0)
    assert [name for name in NAMES if formation.members[name].flight.has_left] == ["f2"]
    assert formation.members["f2"].obstacle(20.0) == "ordered out of the formation"
    assert formation.members["f1"].obstacle(20.0) is None
    everybody = tuple(Place(vehicle=name, begin=slot, end=slot) for name, slot in slots.items())
    formation.give(Arrangement(number=2, time_s=30.0, across_s=6.0, places=everybody))
    formation.run(30.1)
    assert not formation.members["f2"].flight.has_left
    assert formation.members["f2"].returns_to_formation()
    assert not formation.members["f2"].returns_to_formation()


def test_an_operator_that_asks_hears_the_order_that_is_flown(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    member = Arrangements(plan(vehicle="leader"), SAME_CLOCK)
    formation = Formation(plan)
    formation.members["leader"] = member
    formation.run(5.0)
    formation.give(further(slots))
    formation.run(30.0)
    asks = encode_reply(Reply(number=0, verdict=Verdict.UNKNOWN))
    for time_s in (30.0, 30.5):
        member.receive_reply("operator", asks, time_s)
    assert member.to_say()[1] == [encode_order(further(slots))]


def test_one_that_misses_the_confirmation_goes_on_until_its_time_and_flies_the_order_once_repeated(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    member = Arrangements(plan(vehicle="f2"), SAME_CLOCK)
    data = encode_order(further(slots))
    member.receive_order(data, data, 5.0)
    # Of the leader nothing is heard any more.
    member.hear("f1", heard(6.0, 1), 6.0)
    assert not member.waits(6.0)
    member.hear("f1", heard(10.0, 1), 10.0)
    member.step(10.1)
    member.receive_order(data, data, 10.2, repeated=True)
    assert member.number == 1
    assert not member.waits(10.2)


def test_one_that_took_an_order_for_void_flies_it_once_the_others_do(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    lost = {"state"}
    formation = Formation(plan, lost=lambda kind, _, to, __: kind in lost and to == "f2")
    formation.run(5.0)
    formation.give(further(slots))
    formation.run(10.4)
    # Its own clock alone has brought it here: a leader whose states come late says nothing of the order.
    formation.members["f2"].hear("leader", heard(10.4, 0), 10.4)
    formation.run(10.7)
    assert "order 1 is void: the leader has not confirmed it; all fly on as before" in (
        formation.words
    )
    lost.clear()
    formation.run(14.0)
    assert formation.flown == dict.fromkeys(NAMES, 1)
    assert not formation.members["f2"].waits(14.0)


def called_off(*, number: int, time_s: float) -> bytes:
    """An order that calls everything off."""
    return encode_order(
        Arrangement(number=number, time_s=time_s, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )


def test_what_a_vehicle_repeats_counts_only_where_the_others_fly_by_it(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    member = Arrangements(plan(vehicle="f1"), SAME_CLOCK)
    abort = called_off(number=4, time_s=99.0)
    for data in (abort, encode_order(further(slots, time_s=104.0))):
        member.receive_order(data, data, 100.0, repeated=True)
    assert member.flight.flown is None
    assert member.to_say() == ([], [])
    member.hear("leader", heard(100.0, 4), 100.0)
    member.receive_order(abort, abort, 100.1, repeated=True)
    assert member.flight.has_left


@pytest.mark.parametrize(("given_s", "flown"), [(69.0, False), (71.0, True), (131.0, False)])
def test_an_abort_is_of_now(plan: MakePlan, given_s: float, *, flown: bool) -> None:
    member = Arrangements(plan(vehicle="f1"), SAME_CLOCK)
    member.receive_order(called_off(number=4, time_s=given_s), b"", 100.0)
    assert member.flight.has_left is flown
    (data,), _ = member.to_say()
    reply = decode_reply(data)
    assert reply.verdict is (Verdict.FLOWN if flown else Verdict.REFUSED)


def test_an_abort_is_flown_where_no_time_is_known(plan: MakePlan) -> None:
    unknown = SharedClock(from_own=lambda _: math.nan)
    member = Arrangements(plan(vehicle="f1"), unknown)
    member.receive_order(called_off(number=4, time_s=1e6), b"", 100.0)
    assert member.flight.has_left


@pytest.mark.parametrize("number", [3, 4])
@pytest.mark.parametrize("now", [5.5, 11.0])
def test_an_abort_is_flown_whatever_its_number(
    plan: MakePlan, slots: dict[str, Point], number: int, now: float
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(further(slots, number=4, time_s=10.0))
    if now > 10.0:
        formation.run(now)
        assert formation.flown == dict.fromkeys(NAMES, 4)
    for member in formation.members.values():
        member.to_say()
        abort = called_off(number=number, time_s=formation.now)
        member.receive_order(abort, abort, formation.now)
        member.receive_order(abort, abort, formation.now)
        assert member.flight.has_left
        replies = [decode_reply(data) for data in member.to_say()[0]]
        expected = (number, Verdict.FLOWN, check_of(abort))
        assert [(one.number, one.verdict, one.check) for one in replies] == [expected] * 2
    # By the greater number, and what was pending is flown by nobody.
    formation.run(20.0)
    assert set(formation.flown.values()) == {4 if now > 10.0 else number}
    assert all(member.flight.has_left for member in formation.members.values())


def test_after_an_abort_the_height_of_the_slot_is_the_one_that_it_had(plan: MakePlan) -> None:
    begin = slots_of(plan)["f1"]
    end = Point(begin.forward, begin.right, 6.0)
    place = Place(vehicle="f1", begin=begin, end=begin, layer=20.0)
    order = Arrangement(number=1, time_s=10.0, climb_s=20.0, across_s=10.0, places=(place,))
    member = Arrangements(plan(vehicle="f1"), SAME_CLOCK)
    member.hear("leader", heard(10.0, 1), 10.0)
    member.receive_order(encode_order(replace(order, places=(replace(place, end=end),))), b"", 10.0)
    # Half of its way into the layer, and the abort tells the mission's slot.
    abort = Arrangement(
        number=2,
        time_s=20.0,
        flown=Manoeuvre.ABORT,
        across_s=0.0,
        places=(Place(vehicle="f1", begin=begin, end=begin),),
    )
    assert member.own_up(20.0) == pytest.approx(10.0)
    member.receive_order(encode_order(abort), b"", 20.0)
    assert member.own_up(60.0) == pytest.approx(10.0)


def test_an_old_abort_of_a_lower_number_is_not_flown(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(further(slots, number=4, time_s=10.0))
    formation.run(40.0)
    formation.give(
        Arrangement(number=3, time_s=9.0, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )
    assert not any(member.flight.has_left for member in formation.members.values())


def test_no_order_brings_a_formation_back_after_an_abort(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(
        Arrangement(number=4, time_s=5.0, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )
    formation.run(6.0)
    formation.give(further(slots, number=5, time_s=12.0))
    formation.run(15.0)
    assert formation.flown == dict.fromkeys(NAMES, 4)
    assert not any(member.returns_to_formation() for member in formation.members.values())
    refused = {reply.text for _, reply in formation.said if reply.verdict is Verdict.REFUSED}
    assert refused == {
        "everything was called off: no order brings the formation back, restart all companions"
    }
    # Nor does one that others are said to fly.
    member, order = formation.members["f1"], encode_order(further(slots, number=6, time_s=14.0))
    member.hear("leader", heard(15.0, 6), 15.0)
    for repeated in (True, False):
        member.receive_order(order, order, 15.1, repeated=repeated)
        assert member.flight.called_off == 4
    # The same abort is answered as before, and a further one is flown.
    formation.give(
        Arrangement(number=7, time_s=15.0, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )
    assert formation.flown == dict.fromkeys(NAMES, 7)


class RebootedClock:
    """A follower's view of the formation's clock: 1000 s ahead of its own until the leader's starts anew."""

    def __init__(self) -> None:
        self.ahead_s = 1000.0
        self.shared = SharedClock(from_own=lambda own_s: own_s + self.ahead_s)


@pytest.mark.parametrize(
    ("at_s", "share"), [(15.0, 0.5), (60.0, 1.0)], ids=["on the way", "all done"]
)
def test_slots_stay_where_they_are_when_the_leaders_computer_starts_anew(
    plan: MakePlan, slots: dict[str, Point], at_s: float, share: float
) -> None:
    clock = RebootedClock()
    member = Arrangements(plan(vehicle="f1"), clock.shared)
    member.receive_order(encode_order(further(slots, time_s=1010.0)), b"", 5.0)
    member.hear("leader", heard(6.0, 1), 6.0)
    member.step(10.0)
    before = member.flight.slot("f1", at_s)
    clock.ahead_s = -20.0
    member.step(at_s)
    after = member.flight.slot("f1", at_s)
    assert before is not None
    assert after is not None
    assert after.forward == pytest.approx(before.forward)
    assert after.forward == pytest.approx((1.0 + 0.5 * share) * slots["f1"].forward)
    # What is on its way goes on; then the next order is taken by the new clock.
    member.to_say()
    now = at_s + 30.0
    onward = tuple(
        Place(vehicle=name, begin=Point(1.5 * slot.forward, 1.5 * slot.right), end=slot)
        for name, slot in slots.items()
    )
    order = Arrangement(number=2, time_s=now - 20.0 + 6.0, across_s=10.0, places=onward)
    member.receive_order(encode_order(order), b"", now)
    member.step(now)
    assert [decode_reply(data).verdict for data in member.to_say()[0]] == [Verdict.READY]


def test_an_order_that_waits_for_its_time_is_decided_when_the_clock_starts_anew(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    clock = RebootedClock()
    member = Arrangements(plan(vehicle="f1"), clock.shared)
    member.receive_order(encode_order(further(slots, time_s=1010.0)), b"", 5.0)
    member.step(5.0)
    clock.ahead_s = -4.0
    for time_s in (6.0, 10.4, 10.6):
        member.hear("leader", heard(time_s, 0), time_s)
        member.step(time_s)
    verdicts = [decode_reply(data).verdict for data in member.to_say()[0]]
    assert verdicts[-1] is Verdict.VOID


def test_a_leader_whose_computer_was_started_anew_flies_the_order_that_all_others_fly(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    leader = Arrangements(plan(vehicle="leader"), SAME_CLOCK)
    leader.hear("f1", heard(20.0, 7), 20.0)
    data = encode_order(further(slots, number=7, time_s=100010.0))
    leader.receive_order(data, data, 20.0, repeated=True)
    assert not leader.waits(20.0)
    slot = leader.flight.slot("f1", 20.0)
    assert slot is not None
    assert slot.forward == 1.5 * slots["f1"].forward


def test_two_orders_of_one_number_are_not_both_flown(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    first, second = (
        encode_order(replace(further(slots), across_s=across_s)) for across_s in (10.0, 12.0)
    )
    for name, member in formation.members.items():
        for data in (second, first) if name == "f1" else (first, second):
            member.receive_order(data, data, 5.0)
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    verdicts = {
        check: {reply.verdict for _, reply in formation.said if reply.check == check}
        for check in (check_of(first), check_of(second))
    }
    assert verdicts == {
        check_of(first): {Verdict.READY, Verdict.REFUSED, Verdict.VOID},
        check_of(second): {Verdict.READY, Verdict.REFUSED, Verdict.VOID},
    }


def test_the_number_of_one_vehicle_stops_nobody(plan: MakePlan) -> None:
    member = Arrangements(plan(vehicle="f2"), SAME_CLOCK)
    for name, number in (("leader", 0), ("f3", 0), ("f1", 2**32 - 1)):
        member.hear(name, heard(5.0, number), 5.0)
    assert not member.waits(5.0)
    assert member.obstacle(5.0) is None
    # Nor does it bring back what was called off in another flight.
    old = called_off(number=2**32 - 1, time_s=5.0)
    member.receive_order(old, old, 5.0, repeated=True)
    assert member.flight.flown is None


@pytest.mark.parametrize("others", [("leader",), ("f1", "f3")])
def test_the_leaders_number_counts_and_that_of_two_others(
    plan: MakePlan, others: tuple[str, ...]
) -> None:
    member = Arrangements(plan(vehicle="f2"), SAME_CLOCK)
    for name in {*NAMES} - {"f2"}:
        member.hear(name, heard(5.0, 7 if name in others else 0), 5.0)
    assert member.waits(5.0)


def test_one_vehicles_number_counts_where_no_second_is_heard(plan: MakePlan) -> None:
    member = Arrangements(plan(vehicle="leader"), SAME_CLOCK)
    member.hear("f1", heard(5.0, 7), 5.0)
    assert member.waits(5.0)


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
def test_a_slot_that_moves_faster_than_its_aircraft_is_refused(
    plan: MakePlan,
    to: tuple[float, float],
    layer: float | None,
    climb_s: float,
    sentence: str | None,
) -> None:
    begin = slots_of(plan)["f1"]
    end = Point(begin.forward, begin.right + to[0], to[1])
    place = Place(vehicle="f1", begin=begin, end=end, layer=layer)
    order = Arrangement(number=1, time_s=10.0, climb_s=climb_s, across_s=10.0, places=(place,))
    assert_refused(Arrangements(plan(vehicle="f1"), SAME_CLOCK), order, sentence)


@pytest.mark.parametrize(
    ("vehicle", "radius_m", "away_deg", "sentence"),
    [
        # 20 m/s at 45 degrees: 20² / 9.81 = 41 m.
        ("leader", 20.0, 0.0, "a circle of 20 m is too small: at least 41 m are needed"),
        ("f1", 20.0, 0.0, "a circle of 20 m is too small"),
        ("leader", 200.0, 1.0, "the circle is 111 km away, more than 5 km"),
        ("f1", 200.0, 0.01, None),
    ],
)
def test_a_hold_that_nobody_can_fly_or_that_is_elsewhere_is_refused(
    plan: MakePlan,
    vehicle: str,
    radius_m: float,
    away_deg: float,
    sentence: str | None,
) -> None:
    own = plan(vehicle=vehicle)
    latitude_deg, longitude_deg = own.frame.to_geodetic(0.0, 0.0)
    circle = Circle(
        latitude_deg=latitude_deg + away_deg, longitude_deg=longitude_deg, radius_m=radius_m
    )
    order = Arrangement(
        number=1, time_s=10.0, flown=Manoeuvre.HOLD, across_s=10.0, places=(), circle=circle
    )
    assert_refused(Arrangements(own, SAME_CLOCK), order, sentence)


def assert_refused(member: Arrangements, order: Arrangement, sentence: str | None) -> None:
    """See that an order is refused with this in its sentence; with none, that it is agreed to."""
    member.receive_order(encode_order(order), b"", 5.0)
    member.step(5.0)
    (data,), _ = member.to_say()
    reply = decode_reply(data)
    assert reply.verdict is (Verdict.READY if sentence is None else Verdict.REFUSED)
    assert (sentence or "") in reply.text


def test_after_an_abort_a_restarted_companion_hears_of_it_again(plan: MakePlan) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    formation.give(
        Arrangement(number=4, time_s=5.0, flown=Manoeuvre.ABORT, across_s=0.0, places=())
    )
    formation.run(60.0)
    formation.start("f2")
    formation.run(64.0)
    assert formation.members["f2"].flight.has_left


def test_an_order_may_be_given_while_slots_still_move_that_are_at_rest_at_its_time(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(plan)
    formation.run(5.0)
    first = further(slots)
    formation.give(first)
    # They move from 10 s to 20 s.
    formation.run(16.0)
    formation.give(further({one.vehicle: one.end for one in first.places}, number=2, time_s=20.5))
    formation.run(21.0)
    assert formation.flown == dict.fromkeys(NAMES, 2)


def with_paths(plan: MakePlan) -> MakePlan:
    """Plans of a mission that has another path, and two who may lead."""

    def make(**options: object) -> FlightPlan:
        one = plan(**options)
        other = KnownPath(
            CirclePath(north=0.0, east=0.0, radius=300.0, direction=1),
            PathGains(gain=0.03, approach_angle=math.pi / 2.0),
        )
        task = plan(vehicle="f3").task
        assert isinstance(task, FollowerTask)
        lead = LeadPlan(order=("leader", "f1"), task=task, altitude_amsl=588.0)
        return replace(one, paths={**one.paths, "survey": other}, lead=lead)

    return make


def test_another_path_is_known_from_the_agreed_time_on_and_its_field_is_as_gentle_as_the_turns(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.give(replace(further(slots), path="survey", turn_radius_m=125.0))
    formation.run(9.9)
    assert [one.flight.route for one in formation.members.values()] == [None] * len(NAMES)
    formation.run(10.05)
    routes = [one.flight.route for one in formation.members.values()]
    assert all(one is not None and one.least_radius == pytest.approx(125.0) for one in routes)
    # 1 / 125 m is less than the path's own 0.03 1/m.
    assert {one.gains.gain for one in routes if one is not None} == {0.008}


def test_a_path_that_one_companion_does_not_know_is_flown_by_nobody(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.members["f2"] = Arrangements(plan(vehicle="f2"), SAME_CLOCK)
    formation.run(5.0)
    formation.give(replace(further(slots), path="survey", turn_radius_m=125.0))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    refused = {reply.text for name, reply in formation.said if name == "f2"}
    assert "no path is called 'survey' in its mission: give all the same mission" in refused


def test_a_path_that_is_another_curve_for_one_companion_is_flown_by_nobody(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    other = with_paths(plan)(vehicle="f2")
    paths = {**other.paths, "survey": replace(other.paths["survey"], check=7)}
    formation.members["f2"] = Arrangements(replace(other, paths=paths), SAME_CLOCK)
    formation.run(5.0)
    formation.give(replace(further(slots), path="survey", turn_radius_m=125.0))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    refused = {reply.text for name, reply in formation.said if name == "f2"}
    assert refused >= {
        "its mission file means another curve by 'survey': give all the same mission"
    }


def test_nobody_leads_by_an_order_along_a_path_that_is_another_curve_in_its_own_mission(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    other = with_paths(plan)(vehicle="f1")
    paths = {**other.paths, "main": replace(other.paths["main"], check=7)}
    formation.members["f1"] = Arrangements(replace(other, paths=paths), SAME_CLOCK)
    formation.run(5.0)
    formation.give(replace(further(slots), lead="f1", path_check=8))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    refused = {reply.text for name, reply in formation.said if name == "f1"}
    assert refused >= {"its mission file means another curve by 'main': give all the same mission"}


def test_a_companion_that_missed_the_order_and_means_another_curve_by_its_path_does_not_steer(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.give(replace(further(slots), path="survey", turn_radius_m=125.0))
    formation.run(11.0)
    other = with_paths(plan)(vehicle="f2")
    paths = {**other.paths, "survey": replace(other.paths["survey"], check=7)}
    formation.members["f2"] = Arrangements(replace(other, paths=paths), SAME_CLOCK)
    formation.run(30.0)
    assert formation.flown["f2"] == 0
    assert formation.members["f2"].obstacle(formation.now) is not None
    assert len([text for text in formation.words if "another curve" in text]) == 1


def test_who_is_to_lead_leads_for_a_moment_after_the_agreed_time_only(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.give(replace(further(slots), lead="f1"))
    formation.run(10.1)
    assert [name for name, one in formation.members.items() if one.leads_by_order(10.1)] == ["f1"]
    assert not formation.members["f1"].leads_by_order(12.0)


def test_another_copy_of_the_order_at_its_very_time_does_not_keep_anybody_from_leading_by_it(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    order = replace(further(slots), lead="f1")
    formation.give(order)
    formation.run(9.95)
    # The operator repeats it until all fly it; f1 gets that before its own next step.
    formation.now = 10.0
    formation.give(order)
    assert formation.flown["f1"] == 1
    assert formation.members["f1"].leads_by_order(10.0)


def test_a_companion_that_hears_of_the_order_later_does_not_lead_by_it(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.give(replace(further(slots), lead="f1"))
    formation.run(11.0)
    formation.start("f1")
    while formation.flown["f1"] == 0:
        formation.run(formation.now + 0.1)
        assert formation.now < 30.0
        assert not formation.members["f1"].leads_by_order(formation.now)


def test_nobody_is_ordered_to_lead_who_is_not_heard(
    plan: MakePlan, slots: dict[str, Point]
) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.silent.add("f1")
    formation.run(12.0)
    formation.give(replace(further(slots), time_s=20.0, lead="f1"))
    formation.run(60.0)
    assert {name: formation.flown[name] for name in NAMES if name != "f1"} == {
        name: 0 for name in NAMES if name != "f1"
    }
    assert "f1 is to lead, and is not heard" in {reply.text for _, reply in formation.said}


def test_nobody_leads_by_an_order_who_is_no_deputy(plan: MakePlan, slots: dict[str, Point]) -> None:
    formation = Formation(with_paths(plan))
    formation.run(5.0)
    formation.give(replace(further(slots), lead="f2"))
    formation.run(60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    assert "f2 is neither leader nor deputy of its mission" in {
        reply.text for _, reply in formation.said
    }
