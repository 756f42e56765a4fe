"""A formation that falls into parts which do not hear each other, is ordered about, and comes together."""

import math

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from tests.kit.orders import NAMES, SLOTS, begun, moves, order_of
from vfguide.formation.arrangement import Point

LEAD_S = 6.0
"""An order is given so long before its time."""

LOOK_S, DIFFER_S = 0.25, 5.0
"""So often it is looked whether two steer by different orders, and for so long they may."""

TOGETHER_S = 15.0
"""After a merge everybody flies the same within this."""

Parts = tuple[frozenset[str], ...]

WHOLE: Parts = (frozenset(NAMES),)


def parts_of(places: tuple[int, ...]) -> Parts:
    """The parts in which members are, by their numbers."""
    return tuple(
        frozenset(name for name, place in zip(NAMES, places, strict=True) if place == part)
        for part in sorted(set(places))
    )


class PartedFormation(RuleBasedStateMachine):
    """Four companions in up to three parts; an operator is heard by one part, or by all."""

    @initialize()
    def begin(self) -> None:
        self.parts = WHOLE
        self.formation = begun(lost=self.lost)
        self.number = 0
        self.differ_s = math.inf
        self.reach = frozenset(NAMES)

    def lost(self, kind: str, sender: str, receiver: str, now: float) -> bool:
        del now
        if kind == "order":
            return receiver not in self.reach
        return not any({sender, receiver} <= part for part in self.parts)

    @rule(places=st.tuples(*[st.integers(0, 2)] * len(NAMES)))
    def split(self, places: tuple[int, ...]) -> None:
        """From now on only those hear each other who are in one part."""
        self.parts = parts_of(places)

    @rule(part=st.integers(0, 2), wide=st.booleans(), repeats=st.integers(1, 3))
    def order(self, part: int, wide: bool, repeats: int) -> None:
        """An operator orders all slots half as far again, or back, as it is heard by one part or by all."""
        formation = self.formation
        self.number += 1
        known = formation.members["leader"].flight.flown
        begins = SLOTS if known is None else {one.vehicle: one.end for one in known.places}
        scale = 1.5 if wide else 1.0
        ends = {
            name: Point(scale * slot.forward, scale * slot.right, slot.up)
            for name, slot in SLOTS.items()
        }
        time_s = formation.now + LEAD_S
        order = order_of(*moves(ends, begins), number=self.number, time_s=time_s, across_s=3.0)
        self.reach = self.parts[part % len(self.parts)]
        for _ in range(repeats):
            formation.give(order)
            self.go_on(0.5)

    @rule(name=st.sampled_from(NAMES))
    def kill(self, name: str) -> None:
        """A companion is started anew while all hear each other, and two of them know the order."""
        flown = self.formation.flown
        others = [number for other, number in flown.items() if other != name]
        if self.parts == WHOLE and others.count(max(flown.values())) >= 2:
            self.formation.start(name)
            self.go_on(DIFFER_S)

    @rule(seconds=st.sampled_from([0.3, 1.0, 5.0, 12.0]))
    def go_on(self, seconds: float) -> None:
        """Beside the leader nobody steers by another order than it does, but for a moment."""
        formation, ends = self.formation, self.formation.now + seconds
        while formation.now < ends:
            formation.run(min(formation.now + LOOK_S, ends))
            flown = self.steered_by(next(part for part in self.parts if "leader" in part))
            if len(set(flown.values())) <= 1:
                self.differ_s = math.inf
            self.differ_s = min(self.differ_s, formation.now)
            assert formation.now - self.differ_s <= DIFFER_S, (flown, formation.flown, self.parts)

    @rule()
    def merge(self) -> None:
        """All hear all again: before long everybody flies the same order."""
        self.parts = WHOLE
        self.go_on(TOGETHER_S)
        assert len(set(self.formation.flown.values())) == 1, self.formation.flown
        assert len(self.steered_by(WHOLE[0])) == len(NAMES)

    def steered_by(self, part: frozenset[str]) -> dict[str, int]:
        """Number of what each member of a part flies by that is steered."""
        members, now = self.formation.members, self.formation.now
        return {
            name: number
            for name, number in self.formation.flown.items()
            if name in part and members[name].obstacle(now) is None
        }

    @invariant()
    def nothing_is_flown_that_was_not_ordered(self) -> None:
        assert set(self.formation.flown.values()) <= {0, *range(1, self.number + 1)}


def test_what_the_leader_flies_is_taken_up_by_a_part_that_a_deputy_leads():
    """The leader flew it with f1 alone, and comes to f2 and f3, which f2 has led meanwhile and leads on."""
    parts = parts_of((0, 0, 1, 1))

    def lost(kind: str, sender: str, receiver: str, now: float) -> bool:
        del now
        if kind == "order":
            return receiver in parts[1]
        return not any({sender, receiver} <= part for part in parts)

    formation = begun(lost=lost)
    farther = Point(1.5 * SLOTS["f1"].forward, SLOTS["f1"].right, 0.0)
    order = order_of(
        *moves({**SLOTS, "f1": farther}), number=8, time_s=formation.now + LEAD_S, across_s=3.0
    )
    formation.give(order)
    formation.run(formation.now + LEAD_S + 2.0)
    assert formation.flown == {"leader": 8, "f1": 8, "f2": 0, "f3": 0}
    parts = parts_of((0, 1, 0, 0))
    for name in parts[0]:
        formation.members[name].coordinator = "f2"
    formation.run(formation.now + TOGETHER_S)
    assert set(formation.flown.values()) == {8}


def test_who_misses_what_is_flown_knows_it_while_a_later_order_is_on_its_way():
    """f1 begins anew after order 1 was given, and hears order 2 before it is told of the first."""
    formation = begun()
    first, second = (
        order_of(*moves(SLOTS), number=number, time_s=formation.now + time_s, across_s=3.0)
        for number, time_s in ((1, LEAD_S), (2, 2.0 * LEAD_S + 1.0))
    )
    formation.give(first)
    formation.run(formation.now + 1.0)
    formation.start("f1")
    formation.run(first.time_s)
    formation.give(second)
    formation.run(first.time_s + 1.0)
    member = formation.members["f1"]
    assert formation.flown["f1"] == 1 or "not known" in str(member.obstacle(formation.now))
    formation.run(first.time_s + 4.0)
    assert formation.flown == dict.fromkeys(NAMES, 1)
    formation.run(second.time_s + 1.0)
    assert formation.flown == dict.fromkeys(NAMES, 2)


TestPartedFormation = PartedFormation.TestCase
TestPartedFormation.settings = settings(
    derandomize=True,
    deadline=None,
    max_examples=120,
    stateful_step_count=14,
    suppress_health_check=[HealthCheck.too_slow],
)
