"""An operator's program hears who leads, and can call everything off whatever else it does not know."""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from random import Random
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest

from tests.kit.missions import replaced
from tests.kit.states import leader_message
from vfguide.formation.arrangement import Arrangement, Manoeuvre
from vfguide.formation.orders import EPOCH_S, Order, new_number
from vfguide.lab import ordering
from vfguide.lab.order_desk import OrderDesk, unanswered
from vfguide.lab.ordering import OrderOutcome, conclusion, give_order
from vfguide.link.codec import Kind, encode
from vfguide.link.opening import WatchedFormation
from vfguide.link.order_codec import Reply, Verdict, check_of, decode_order, encode_reply
from vfguide.mission import Mission

FOLLOWERS = ("f1", "f2", "f3")


@pytest.fixture
def mission() -> Mission:
    """Four aircraft, of which f1 and f2 may lead in the leader's place."""
    return replaced("shapes", deputies=["f1", "f2"])


def state(latitude_deg: float, **fields: float) -> bytes:
    """A state from the link, at 100 s."""
    usual = {"time_s": 100.0, "longitude_deg": 8.5, "course": 0.0, "climb_rate": 0.0}
    usual |= {"term": 0, "arrangement": 0, "leads": False}
    return encode(leader_message(latitude_deg=latitude_deg, **(usual | fields)))


def desk_of(mission: Mission, **fields: float) -> OrderDesk:
    """A desk at which all followers are heard."""
    desk = OrderDesk(mission, clock=lambda: 0.0)
    for name in FOLLOWERS:
        desk.heard_state(name, state(47.4, **fields))
    return desk


class Air:
    """A link behind which followers fly whatever they are ordered, and say so."""

    order_lead_s = 6.0

    def __init__(self, desk: OrderDesk) -> None:
        self.desk = desk
        self.now = 100.0
        self.orders: list[Arrangement] = []
        self.member: Any = SimpleNamespace(
            trust=SimpleNamespace(leader="leader"), formation_time=lambda: self.now
        )

    def say(self, kind: Kind, body: bytes) -> None:
        """Take an order; nobody answers a question for the one that is flown."""
        if kind is not Kind.ORDER:
            return
        self.orders.append(decode_order(body))
        for name in FOLLOWERS:
            number, check = self.orders[-1].number, check_of(body)
            # What is said to another order of the same number is none of this operator's business.
            for verdict, meant in ((Verdict.FLOWN, check), (Verdict.REFUSED, check ^ 1)):
                reply = Reply(number=number, verdict=verdict, check=meant)
                self.desk.heard_reply(name, encode_reply(reply))


def outcome_of(
    mission: Mission, order: Order, desk: OrderDesk, monkeypatch: pytest.MonkeyPatch
) -> tuple[OrderOutcome, Air]:
    """What becomes of an order that is given at a desk, in no time."""
    air = Air(desk)
    desk.member = air.member

    @asynccontextmanager
    async def at_desk(*_: object) -> AsyncIterator[tuple[OrderDesk, Air]]:
        yield desk, air

    async def sleep(seconds: float) -> None:
        air.now += seconds

    monkeypatch.setattr(ordering, "at_desk", at_desk)
    monkeypatch.setattr(ordering.asyncio, "sleep", sleep)
    watched = WatchedFormation(addresses=(), formation="any", leader="leader", roster=None)
    given = give_order(mission, order, watched, tell=lambda _: None)
    return asyncio.run(given), air


def test_an_abort_is_given_though_the_leader_is_gone_and_the_order_that_is_flown_not_known(
    mission, monkeypatch
):
    desk = desk_of(mission, arrangement=2**31)
    outcome, air = outcome_of(mission, Order(action="abort"), desk, monkeypatch)
    assert air.orders[0].flown is Manoeuvre.ABORT
    assert air.orders[0].number > 2**31
    verdicts = {name: reply.verdict for name, reply in outcome.replies.items()}
    assert verdicts == dict.fromkeys(FOLLOWERS, Verdict.FLOWN)
    assert outcome.silent == ("leader",)


def test_a_deputy_leads_where_its_term_is_the_highest_and_the_leader_that_is_gone_is_not_awaited(
    mission, monkeypatch
):
    desk = desk_of(mission, term=2)
    # Of three that may lead, f2 has the terms 1, 4, ..., f1 2, 5, ..., the leader 3, 6, ...
    desk.heard_lead("f1", state(47.5, term=2, leads=True))
    outcome, air = outcome_of(mission, Order(shape="trail", spacing=20.0), desk, monkeypatch)
    assert air.orders[-1].vehicles == set(FOLLOWERS)
    assert outcome.flown


def test_an_order_to_lead_is_not_flown_where_another_leads_afterwards(mission, monkeypatch):
    desk = desk_of(mission, term=2)
    desk.heard_lead("f1", state(47.5, term=2, leads=True))
    # All followers say that they fly it, and f1 leads on.
    outcome, _ = outcome_of(mission, Order(lead="f2"), desk, monkeypatch)
    assert (outcome.leads, outcome.is_led_otherwise, outcome.flown) == ("f1", True, False)
    assert conclusion(outcome)[0] == "f2: does not lead; f1 leads"
    # Who has refused it does not lead, of course: that is no news.
    refusal = Reply(number=1, verdict=Verdict.REFUSED)
    refused = replace(outcome, replies={**outcome.replies, "f2": refusal})
    assert conclusion(refused) == [f"order {outcome.number}: NOT flown by all"]
    assert not refused.is_led_otherwise
    # The mission's leader is not there to answer, and is awaited only where it is to lead.
    back = msgspec.structs.replace(outcome.arrangement, lead="leader")
    assert desk.awaited_from(desk.formation(), back) - {"leader"} == set(FOLLOWERS)
    assert "leader" in desk.awaited_from(desk.formation(), back)
    assert "leader" not in desk.awaited_from(desk.formation(), outcome.arrangement)


def test_a_hold_is_laid_by_the_leader_that_leads_not_by_one_that_its_pilot_has(mission):
    desk = OrderDesk(mission, clock=lambda: 0.0)
    desk.heard_state("leader", state(47.4, term=2))
    before = desk.leader_place(100.0)
    desk.heard_lead("f1", state(47.5, term=2, leads=True))
    # An earlier term, a term that is another's, and a state that is no leader's do not count.
    desk.heard_lead("f2", state(47.6, term=1, leads=True))
    desk.heard_lead("f2", state(47.6, term=5, leads=True))
    desk.heard_lead("f1", state(47.6, term=5))
    # A tenth of a degree of latitude.
    assert desk.leader_place(100.0).north - before.north == pytest.approx(11_120.0, abs=20.0)


def test_a_leader_that_climbs_is_expected_higher_by_the_time_of_an_order(mission):
    desk = OrderDesk(mission, clock=lambda: 0.0)
    desk.heard_state("leader", state(47.4, climb_rate=2.5))
    place = desk.leader_place(106.0)
    # 588 m above mean sea level is 100 m above the origin; 6 s later it is 15 m higher.
    assert (place.height, place.climb_rate) == pytest.approx((115.0, 2.5))
    assert desk.places()["leader"].height == pytest.approx(100.0)


def test_two_orders_of_one_second_have_different_numbers_mostly_and_later_ones_greater():
    chance = Random(1)
    for newest, unix_s in ((0, EPOCH_S + 1e7), (2**31, EPOCH_S + 1e7), (5, 0.0)):
        numbers = {new_number(newest, unix_s, chance) for _ in range(100)}
        assert len(numbers) == 8
        assert min(numbers) > newest
        later = new_number(newest, unix_s + 1.0, chance)
        assert unix_s == 0.0 or newest == 2**31 or later > max(numbers)
    # 16 years on they still fit into 32 bits.
    assert new_number(0, EPOCH_S + 16 * 366 * 86400.0, chance) < 2**32


def test_who_gets_no_answer_hears_whether_anything_arrived_and_the_remedy():
    for arrived in (Counter(), Counter({"copies": 7})):
        assert unanswered(arrived).startswith("nothing arrives")
    refused = {"refused: forged": 3, "refused: another session of the leader": 41, "copies": 9}
    told = unanswered(Counter(refused))
    assert told.startswith("44 messages arrived that are not believed, most for 'another")
    assert "the keys that the companions use" in told
