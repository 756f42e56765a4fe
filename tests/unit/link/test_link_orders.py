"""Who may order, and whose repeated orders are believed."""

import pytest

from tests.kit.link import LEADER, Station, Wire, trust_of
from vfguide.link.envelope import Kind
from vfguide.link.trust import RefusedError


@pytest.fixture
def wire() -> Wire:
    """A leader, two followers and an operator, who all know that the leader lives."""
    wire = Wire()
    for number, name in enumerate((LEADER, "f1", "f2", "eye"), 1):
        wire.station(name, session=number)
    for one in wire.stations[1:]:
        one.member.ask()
    wire.run(0.1)
    return wire


def say(wire: Wire, station: Station, kind: Kind, body: bytes) -> bytes:
    """Say something that everybody hears; return its envelope."""
    envelope = station.member.say(kind, body).data
    wire.run(0.1)
    return envelope


def test_an_operators_order_reaches_everybody_with_its_envelope(wire):
    *vehicles, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    for one in vehicles:
        assert one.orders == [(b"vee", envelope, False)]


def test_a_vehicle_may_not_order(wire):
    leader, one, other, _ = wire.stations
    say(wire, one, Kind.ORDER, b"trail")
    assert other.orders == leader.orders == []
    assert other.counters["refused: not for its sender to say"] == 1


def test_an_answer_reaches_the_leader_and_the_operator(wire):
    leader, _, other, operator = wire.stations
    say(wire, other, Kind.REPLY, b"yes")
    assert leader.replies == operator.replies == [("f2", b"yes")]


def test_an_order_is_not_heard_twice_but_may_be_repeated_by_a_vehicle(wire):
    _, one, other, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    other.member.take(envelope)
    assert len(other.orders) == 1
    say(wire, one, Kind.REPEAT, envelope)
    assert other.orders == [(b"vee", envelope, False), (b"vee", envelope, True)]


def test_what_a_vehicle_repeats_has_to_be_an_operators(wire):
    _, one, other, operator = wire.stations
    own = one.member.trust.seal(Kind.ORDER, b"trail", time_s=0.0)
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    changed = envelope.replace(b"vee", b"vex")
    state = operator.member.trust.seal(Kind.REPLY, b"vee", time_s=0.0)
    for data in (own, changed, state, b"", b"noise"):
        say(wire, one, Kind.REPEAT, data)
    assert other.orders == [(b"vee", envelope, False)]
    assert other.counters["refused: a forged order"] == 1
    assert other.counters["refused: not an operator's order"] == 2
    assert other.counters["refused: malformed"] == 2


def test_an_order_of_another_flight_needs_two_members_that_have_met_it(wire):
    envelope = say(wire, wire.stations[-1], Kind.ORDER, b"vee")
    later = trust_of("f2", 99)
    with pytest.raises(RefusedError, match="another flight"):
        later.believe(later.read(envelope), 0.0)
    for speaker in ("f1", "f1"):
        with pytest.raises(RefusedError, match="an order of another flight"):
            later.vouch(envelope, speaker)
    # As of a leader that was started anew since: those who have flown by it tell of it.
    assert later.vouch(envelope, LEADER).body == b"vee"


def test_an_order_of_this_flight_is_vouched_for_by_one_also_after_the_leader_was_started_anew(wire):
    *_, other, operator = wire.stations
    envelope = say(wire, operator, Kind.ORDER, b"vee")
    other.member.trust.prove(55, 100.0)
    assert other.member.trust.vouch(envelope, "f1").body == b"vee"
