"""Who leads: terms, turns of the deputies, and many vehicles that hear each other now and then."""

import math
from itertools import pairwise

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from vfguide.companion.roles import (
    DEAF_S,
    GREATEST_TERM,
    LISTEN_S,
    STAGGER_S,
    UNSTEERED_S,
    VACANT_S,
    Succession,
    holder_of,
    term_above,
)

ORDER = ("leader", "f1", "f2")
SILENCE_S = 0.6
STEP_S = 0.05


def deputy(name: str = "f1") -> Succession:
    return Succession(name, ORDER, silence_s=SILENCE_S)


def lead_time(one: Succession, *, from_s: float, until_s: float, others: bool) -> float:
    """When it leads, s, if it hears a follower five times a second, or nobody; infinite if never."""
    steps = round((until_s - from_s) / STEP_S)
    for step in range(1, steps + 1):
        now = from_s + step * STEP_S
        if others and step % 4 == 0:
            one.hear_other(0, now)
        if one.step(now, eligible=True):
            return now
    return math.inf


def hear_until(one: Succession, until_s: float, *, steered: bool = True) -> None:
    """Hear the leader of the mission, 20 times a second, and a follower."""
    for step in range(round(until_s / STEP_S) + 1):
        one.hear_leader("leader", 0, step * STEP_S, steered=steered)
        one.hear_other(0, step * STEP_S)
        one.step(step * STEP_S, eligible=True)


def followed(name: str = "f1", *, steered: bool = True) -> Succession:
    """Make one that has heard the leader until 10 s."""
    one = deputy(name)
    hear_until(one, 10.0, steered=steered)
    return one


def started(*, leads: bool) -> Succession:
    """Make a leader that has started at 5 s, and leads if it has listened long enough since then."""
    one = deputy("leader")
    one.step(5.0, eligible=False)
    if leads:
        assert one.step(5.0 + LISTEN_S + STEP_S, eligible=False)
    return one


def test_every_term_is_one_vehicles():
    # Of three terms each of the three has one, the last in the order the lowest.
    holders = ["leader", *("f2", "f1", "leader") * 2]
    assert [holder_of(term, ORDER) for term in range(7)] == holders
    # The next is in the next round: after term 2, of the first three, the next three are 4 to 6.
    for term, following in {0: [3, 2, 1], 2: [6, 5, 4], 3: [6, 5, 4], 4: [9, 8, 7]}.items():
        assert [term_above(term, name, ORDER) for name in ORDER] == following


@pytest.mark.parametrize(
    ("name", "steered", "others", "waits_s", "term"),
    [
        # Its turn comes at once, since nobody but the silent leader comes before it.
        ("f1", True, True, SILENCE_S, 2),
        # The second deputy leaves the first its turn.
        ("f2", True, True, SILENCE_S + STAGGER_S, 1),
        # One that hears nobody takes itself for deaf at first.
        ("f1", True, False, DEAF_S + SILENCE_S, 2),
        # A leader that was never steered is followed, too.
        ("f1", False, True, SILENCE_S, 2),
        # A follower never leads.
        ("f3", True, True, math.inf, 0),
    ],
)
def test_a_deputy_leads_as_soon_as_the_leader_is_silent_for_too_long(
    name, steered, others, waits_s, term
):
    one = followed(name, steered=steered)
    assert not one.leads
    led_s = lead_time(one, from_s=10.0, until_s=30.0, others=others)
    assert led_s == pytest.approx(10.0 + waits_s, abs=2.0 * STEP_S)
    assert (one.term, one.leads) == (term, term > 0)
    assert one.holder == (name if term else "leader")


def test_after_a_blackout_of_the_link_the_leader_has_as_long_as_ever():
    one = followed()
    assert lead_time(one, from_s=10.0, until_s=14.0, others=False) == math.inf
    # The first of the others is heard 0.2 s later.
    led_s = lead_time(one, from_s=14.0, until_s=20.0, others=True)
    assert led_s == pytest.approx(14.2 + SILENCE_S, abs=2.0 * STEP_S)


def test_a_leader_that_its_pilot_takes_is_succeeded_although_it_is_heard():
    one, now = followed(), 10.0
    while not one.leads and now < 15.0:
        now += STEP_S
        one.hear_leader("leader", 0, now, steered=False)
        assert one.is_leaving(now)
        one.step(now, eligible=True)
    assert now == pytest.approx(10.0 + STEP_S + UNSTEERED_S, abs=2.0 * STEP_S)


def test_a_deputy_that_is_not_steered_or_never_heard_the_leader_does_not_lead():
    assert lead_time(deputy("f1"), from_s=0.0, until_s=30.0, others=True) == math.inf
    one = followed()
    for step in range(1, 200):
        one.hear_other(0, 10.0 + step * STEP_S)
        assert not one.step(10.0 + step * STEP_S, eligible=False)


def test_a_higher_term_ends_ones_own():
    one = followed("f2")
    lead_time(one, from_s=10.0, until_s=20.0, others=True)
    assert one.leads
    assert one.hear_leader("f1", 2, 20.0, steered=True)
    assert (one.leads, one.holder, one.term) == (False, "f1", 2)
    # The leader of the mission says that it leads in term 0: that is over.
    assert not one.hear_leader("leader", 0, 20.1, steered=True)
    assert one.term == 2


def test_nobody_leads_in_a_term_of_another_and_one_some_rounds_above_is_believed():
    one = deputy("f3")
    assert not one.hear_leader("f2", 2, 1.0, steered=True)
    assert one.term == 0
    assert one.hear_leader("leader", 36, 1.0, steered=True)


@pytest.mark.parametrize(
    ("obeyed", "listens_s", "term"),
    [
        (None, LISTEN_S, 0),
        # Its deputies are gone, but a follower still says which term it obeyed last.
        (2, VACANT_S, 6),
        # Of some rounds above: the leader's are 3, 6, ..., 33, 36, the first of the next round.
        (32, VACANT_S, 36),
        # An impossible term counts for nothing.
        (GREATEST_TERM, LISTEN_S, 0),
    ],
)
def test_a_leader_that_has_just_started_listens_before_it_leads(obeyed, listens_s, term):
    assert not deputy("leader").leads
    one = started(leads=False)
    if obeyed is not None:
        one.hear_other(obeyed, 5.1)
    one.step(5.0 + listens_s - STEP_S, eligible=False)
    assert not one.leads
    assert one.step(5.0 + listens_s + STEP_S, eligible=False)
    assert (one.leads, one.term) == (True, term)


def test_a_leader_that_comes_back_follows_the_one_who_leads_by_now():
    one = started(leads=False)
    assert one.hear_leader("f1", 2, 5.1, steered=True)
    one.step(20.0, eligible=False)
    assert (one.leads, one.holder) == (False, "f1")


@pytest.mark.parametrize("heard", [False, True])
def test_a_leader_whose_followers_obey_a_deputy_that_is_lost_leads_them_in_a_new_term(heard):
    one = started(leads=True)
    # f2 led f3 in term 1, was heard by f3 alone, and died, or is heard in time.
    one.hear_other(1, 10.0)
    one.step(10.0, eligible=True)
    if heard:
        assert one.hear_leader("f2", 1, 10.5, steered=True)
        one.step(20.0, eligible=False)
        assert (one.leads, one.holder, one.term) == (False, "f2", 1)
        return
    one.step(10.0 + VACANT_S - STEP_S, eligible=True)
    assert (one.leads, one.term) == (True, 0)
    # It has led before, too: nothing begins. Terms 1 to 3 are a round; the next of the leader's is 6.
    assert not one.step(10.0 + VACANT_S, eligible=True)
    assert (one.leads, one.term) == (True, 6)


def test_two_leaders_that_do_not_hear_each_other_take_no_turns():
    one, other = started(leads=True), followed()
    now, terms = 10.0, [(0, 0)]
    while now < 130.0:
        now += STEP_S
        # f3 hears both and obeys the higher term; each of them hears f3 alone.
        highest = max(one.term, other.term)
        for leader in (one, other):
            leader.hear_other(highest, now)
            leader.step(now, eligible=True)
        terms.append((one.term, other.term))
    changes = sum(then != before for before, then in pairwise(terms))
    # After 3, 3, 6, 6, 12, 12, 24 and 24 s, and f1's first time.
    assert 5 <= changes <= 10


def test_no_state_with_an_impossible_term_ends_succession():
    one = followed()
    one.hear_other(GREATEST_TERM, 10.0)
    # Of f3, and of a deputy that would be the holder.
    assert not one.hear_leader("f3", GREATEST_TERM, 10.0, steered=True)
    assert not one.hear_leader(holder_of(GREATEST_TERM, ORDER), GREATEST_TERM, 10.0, steered=True)
    assert lead_time(one, from_s=10.0, until_s=30.0, others=True) < 30.0
    assert (one.leads, one.term) == (True, 2)


NAMES = ("leader", "f1", "f2", "f3")
SETTLED_S = DEAF_S + SILENCE_S + 4.0
"""A part of the formation that stays as it is has one leader after this."""


class Formation(RuleBasedStateMachine):
    """Four vehicles, of which three may lead; a link that comes and goes, programs that start anew."""

    @initialize()
    def begin(self) -> None:
        self.now = 0.0
        self.changed_s = 0.0
        self.delay_s = 0.05
        self.groups = dict.fromkeys(NAMES, 0)
        self.down: set[str] = set()
        self.vehicles = {name: deputy(name) for name in NAMES}
        self.mail: list[tuple[float, str, str, int, bool]] = []
        self.terms: dict[int, str] = {}
        self.pass_time(3.0)

    @rule(seconds=st.floats(0.1, 12.0))
    def pass_time(self, seconds: float) -> None:
        end = self.now + seconds
        while self.now < end:
            self.now += STEP_S
            self.deliver()
            for name, one in self.vehicles.items():
                if name in self.down:
                    continue
                # A vehicle is steered while it knows a leader.
                one.step(self.now, eligible=one.term > 0 or not one.listens)
                self.say(name, one)

    def say(self, name: str, one: Succession) -> None:
        for to in NAMES:
            if to == name or self.groups[to] != self.groups[name]:
                continue
            arrival = self.now + self.delay_s
            if one.leads:
                self.mail.append((arrival, name, to, one.term, True))
            if round(self.now / STEP_S) % 4 == 0:
                self.mail.append((arrival, name, to, one.term, False))

    def deliver(self) -> None:
        due = [one for one in self.mail if one[0] <= self.now]
        self.mail = [one for one in self.mail if one[0] > self.now]
        for _, sender, to, term, leads in due:
            if to in self.down or self.groups[to] != self.groups[sender]:
                continue
            if leads:
                self.vehicles[to].hear_leader(sender, term, self.now, steered=True)
            else:
                self.vehicles[to].hear_other(term, self.now)

    @rule(data=st.data())
    def split(self, data: st.DataObject) -> None:
        """The link splits the formation into parts that do not hear each other, or joins them."""
        for name in NAMES:
            self.groups[name] = data.draw(st.integers(0, 2))
        self.changed_s = self.now

    @rule()
    def join(self) -> None:
        self.groups = dict.fromkeys(NAMES, 0)
        self.changed_s = self.now

    @rule(name=st.sampled_from(NAMES))
    def kill(self, name: str) -> None:
        self.down.add(name)
        self.changed_s = self.now

    @precondition(lambda self: self.down)
    @rule(data=st.data())
    def restart(self, data: st.DataObject) -> None:
        name = data.draw(st.sampled_from(sorted(self.down)))
        self.down.discard(name)
        self.vehicles[name] = deputy(name)
        self.changed_s = self.now

    @rule(to=st.sampled_from(NAMES), term=st.integers(0, GREATEST_TERM) | st.integers(0, 4000))
    def forge(self, to: str, term: int) -> None:
        """A state whose term is damaged."""
        self.vehicles[to].hear_other(term, self.now)
        self.changed_s = self.now

    @rule(delay_s=st.floats(0.0, 0.4))
    def delay(self, delay_s: float) -> None:
        self.delay_s = delay_s
        self.changed_s = self.now

    @invariant()
    def never_two_leaders_of_one_term(self) -> None:
        vehicles = getattr(self, "vehicles", {}).items()
        leaders = [one.term for name, one in vehicles if one.leads and name not in self.down]
        assert len(leaders) == len(set(leaders))

    @invariant()
    def one_leader_in_each_part_in_time(self) -> None:
        if not hasattr(self, "vehicles") or self.now - self.changed_s < SETTLED_S:
            return
        for group in set(self.groups.values()):
            alive = [name for name in NAMES if self.groups[name] == group and name not in self.down]
            part = {name: self.vehicles[name] for name in alive}
            # A deputy that was made anew knows of no leader, and cannot carry one on.
            deputies = [one for name, one in part.items() if name in ORDER[1:]]
            able = "leader" in part or any(one.was_heard for one in deputies)
            leaders = [one for one in part.values() if one.leads]
            assert len(leaders) <= 1
            if able:
                assert len(leaders) == 1
            if leaders:
                assert {one.term for one in part.values()} == {leaders[0].term}


Formation.TestCase.settings = settings(max_examples=60, stateful_step_count=25, deadline=None)
TestFormation = Formation.TestCase


def test_a_deputy_that_is_ordered_to_lead_leads_at_once_in_a_term_of_its_own():
    one = followed("f2")
    assert not one.step(10.0, eligible=False, ordered=True)
    assert one.step(10.05, eligible=True, ordered=True)
    # Of terms 1 to 3 the first is that of the last in the order.
    assert (one.term, one.holder) == (1, "f2")
    # The mission's leader, ordered back, leads in the last of the next three.
    leader = started(leads=True)
    assert leader.hear_leader("f2", 1, 11.0, steered=True)
    assert leader.step(11.05, eligible=True, ordered=True)
    assert (leader.term, leader.holder) == (6, "leader")
