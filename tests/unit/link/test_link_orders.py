"""Who may order, and whose repeated orders are believed."""

from itertools import count

import pytest

from tests.unit.link.wire import LEADER, trust_of
from vfguide.link.envelope import Kind
from vfguide.link.member import Member, Parcel
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import RefusedError


class Crew:
    """A member on a wire without delay, and the orders and answers that it has heard."""

    def __init__(self, name: str, session: int, everybody: list["Crew"]) -> None:
        self.orders: list[tuple[bytes, bytes, bool]] = []
        self.replies: list[tuple[str, bytes]] = []
        self.said: list[Parcel] = []
        self.member = Member(
            trust_of(name, session),
            clock=lambda: 0.0,
            receive_order=lambda *order: self.orders.append(order),
            receive_reply=lambda sender, data: self.replies.append((sender, data)),
            peer_clock=None if name == LEADER else PeerClock(chance=count(session).__next__),
        )
        self.everybody = everybody
        self.member.send = self._send
        everybody.append(self)

    def _send(self, parcel: Parcel) -> None:
        self.said.append(parcel)
        for other in self.everybody:
            if other is not self:
                other.member.take(parcel.data)


@pytest.fixture
def crews() -> dict[str, Crew]:
    """A leader, two followers and an operator, who all know that the leader lives."""
    everybody: list[Crew] = []
    found = {
        name: Crew(name, number, everybody)
        for number, name in enumerate((LEADER, "f1", "f2", "eye"), 1)
    }
    for name in ("f1", "f2", "eye"):
        found[name].member.ask()
    return found


def test_an_operators_order_reaches_everybody_with_its_envelope(crews):
    parcel = crews["eye"].member.say(Kind.ORDER, b"vee")
    for name in (LEADER, "f1", "f2"):
        assert crews[name].orders == [(b"vee", parcel.data, False)]


def test_a_vehicle_may_not_order(crews):
    crews["f1"].member.say(Kind.ORDER, b"trail")
    assert crews["f2"].orders == crews[LEADER].orders == []
    assert crews["f2"].member.counters["refused: not for its sender to say"] == 1


def test_an_answer_reaches_the_leader_and_the_operator(crews):
    crews["f2"].member.say(Kind.REPLY, b"yes")
    assert crews[LEADER].replies == crews["eye"].replies == [("f2", b"yes")]


def test_an_order_is_not_heard_twice_but_may_be_repeated_by_a_vehicle(crews):
    parcel = crews["eye"].member.say(Kind.ORDER, b"vee")
    crews["f2"].member.take(parcel.data)
    assert len(crews["f2"].orders) == 1
    crews["f1"].member.say(Kind.REPEAT, parcel.data)
    assert crews["f2"].orders == [(b"vee", parcel.data, False), (b"vee", parcel.data, True)]


def test_what_a_vehicle_repeats_has_to_be_an_operators(crews):
    own = crews["f1"].member.trust.seal(Kind.ORDER, b"trail", time_s=0.0)
    parcel = crews["eye"].member.say(Kind.ORDER, b"vee")
    changed = parcel.data.replace(b"vee", b"vex")
    state = crews["eye"].member.trust.seal(Kind.REPLY, b"vee", time_s=0.0)
    for data in (own, changed, state, b"", b"noise"):
        crews["f1"].member.say(Kind.REPEAT, data)
    assert crews["f2"].orders == [(b"vee", parcel.data, False)]
    counters = crews["f2"].member.counters
    assert counters["refused: a forged order"] == 1
    assert counters["refused: not an operator's order"] == 2
    assert counters["refused: malformed"] == 2


def test_an_order_of_another_flight_is_vouched_for_and_nothing_more(crews):
    # Its number decides: only the one that is flown now is taken.
    parcel = crews["eye"].member.say(Kind.ORDER, b"vee")
    later = trust_of("f2", 99)
    with pytest.raises(RefusedError, match="another flight"):
        later.believe(later.read(parcel.data), 0.0)
    assert later.vouch(parcel.data).body == b"vee"
