"""What an operator says of a stolen key: heard by all, passed on, kept, and not to be made up."""

from collections import Counter
from dataclasses import replace
from typing import Any

import pytest

from tests.kit.link import (
    KEYS,
    LEADER,
    PUBLIC,
    ROSTER,
    Station,
    Wire,
    formation,
    signed_as,
    trust_of,
)
from tests.unit.link import radio_crafts
from vfguide.link.codec import Kind
from vfguide.link.keys import read_revocations, write_revocations
from vfguide.link.packed import PackedKind
from vfguide.link.trust import REVOKED, RefusedError

WITHIN_S = 2.0
"""A revoked key is out so long after the statement has reached the formation."""


def ordered(seconds: float = 2.0) -> tuple[Wire, Station, Station, Station, Station]:
    """A wire, a leader, two followers and an operator's program, after some seconds of flight."""
    wire, *members = formation(seconds)
    desk = wire.station("eye", session=9)
    desk.member.ask()
    return wire, *members, desk


def statement(vehicle: str, **changes: Any) -> bytes:
    """An operator's statement about a vehicle's key."""
    return trust_of("eye", 77, **changes).revocation(vehicle)


def forged(signer: str, sender: str = "eye", body: bytes = PUBLIC["f1"] + b"f1") -> bytes:
    """A statement in a name, signed by somebody's key."""
    return signed_as(signer, sender, Kind.REVOCATION, body)


def passed_on(wire: Wire, seconds: float, *stations: Station) -> None:
    """Let time pass in which members say again what they know of revoked keys."""
    for _ in range(round(seconds)):
        for station in stations:
            station.member.pass_on()
        wire.run(1.0)


def test_a_revoked_key_is_out_at_once_and_the_others_fly_on():
    wire, leader, one, other, desk = ordered()
    desk.member.revoke("f1")
    wire.run(0.02)
    heard = len(other.neighbours)
    wire.fly(leader, WITHIN_S, one, other)
    assert "f1" not in {name for name, _ in other.neighbours[heard:]}
    assert other.heard[-1][1] == b"lead 39"
    assert leader.neighbours[-1][0] == "f2"
    assert [station.member.trust.revoked for station in (leader, other, desk)] == [("f1",)] * 3


def test_the_owner_of_a_revoked_key_stands_back_and_says_nothing():
    wire, leader, one, other, desk = ordered()
    assert not one.member.stands_back
    desk.member.revoke("f1")
    wire.run(0.1)
    assert one.member.trust.is_revoked
    assert one.member.stands_back
    said = len(wire.sent)
    one.member.publish(b"f1")
    assert len(wire.sent) == said
    assert not other.member.stands_back
    assert not leader.member.stands_back


@pytest.mark.parametrize("revoked", [False, True])
def test_a_thief_that_was_not_told_is_heard_by_nobody(revoked):
    wire, leader, one, other, desk = ordered()
    if revoked:
        desk.member.revoke("f1")
    wire.run(0.1)
    wire.stations.remove(one)
    thief = wire.station("f1", session=99)
    before = len(other.neighbours)
    wire.fly(leader, 2.0, thief)
    heard = [said for said in other.neighbours[before:] if said[0] == "f1"]
    assert bool(heard) is not revoked
    assert (other.counters[f"refused: {REVOKED}"] >= 9) is revoked


def test_the_stolen_key_of_the_leader_is_out_for_those_who_follow_it_and_for_those_who_join():
    wire, _, one, other, desk = ordered()
    thief = wire.station(LEADER, session=99)
    desk.member.revoke(LEADER)
    wire.run(0.02)
    heard = len(one.heard)
    joins = wire.station("f2", session=44)
    passed_on(wire, 1.0, one, other)
    for _ in range(40):
        thief.member.send(thief.member._seal(Kind.STATE, "", b"thief"))  # noqa: SLF001
        joins.member.ask()
        wire.run(0.05)
    assert len(one.heard) == heard
    assert joins.heard == []
    assert not joins.member.trust.proven


def test_a_deputy_tells_the_time_of_the_flight_after_the_leaders_key_is_revoked():
    wire, leader, one, other, desk = ordered()
    for station in (one, other):
        station.member.trust.deputies = frozenset({"f1"})
    desk.member.revoke(LEADER)
    wire.fly(leader, 3.5, one, other)
    one.member.stands_in = True
    offset_s = other.clock.offset_s
    other.member.ask()
    wire.run(0.1)
    assert other.counters["refused: a deputy's clock while the leader may live"] == 0
    assert other.clock.offset_s == pytest.approx(offset_s, abs=0.01)


def test_who_joins_later_gets_it_from_the_others_before_it_has_proven_any_leader():
    wire, leader, _, other, desk = ordered()
    desk.member.revoke("f1")
    wire.run(0.1)
    wire.stations.remove(desk)
    wire.stations.remove(other)
    joins = wire.station("f2", session=44)
    passed_on(wire, WITHIN_S, leader)
    assert joins.member.trust.revoked == ("f1",)
    assert not joins.member.trust.proven


@pytest.mark.parametrize("signer", ["f1", "f2", LEADER])
@pytest.mark.parametrize("sender", ["eye", "own"])
def test_no_vehicles_key_revokes_another(signer, sender):
    wire, leader, one, other, _ = ordered()
    wire.inject(forged(signer, signer if sender == "own" else "eye"))
    wire.run(0.1)
    wire.fly(leader, 1.0, one, other)
    assert {station.member.trust.revoked for station in wire.stations} == {()}
    assert "f1" in {name for name, _ in other.neighbours[-4:]}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (
            statement("f1", formation="line", roster=replace(ROSTER, formation="line")),
            "another formation",
        ),
        (forged("eye", body=PUBLIC["f2"] + b"f1"), "no key of this roster"),
        (forged("eye", body=PUBLIC["eye"] + b"eye"), "no key of this roster"),
        (forged("eye", body=b""), "no key of this roster"),
        (forged("eye")[:-1] + b"\0", "forged"),
        (trust_of("eye", 5, signed=False).seal(Kind.REVOCATION, b"", time_s=0.0), "not signed"),
        (forged("f2", "stranger"), "not for its sender to say"),
    ],
    ids=["formation", "old key", "operator", "empty", "bent", "unsigned", "stranger"],
)
def test_statements_that_are_none_change_nothing(data, reason):
    wire, _, _, other, _ = ordered()
    for _ in range(3):
        wire.inject(data)
    wire.run(0.1)
    assert other.counters[f"refused: {reason}"] == 3
    assert other.member.trust.revoked == ()
    assert other.counters["failed to use"] == 0


def test_a_statement_of_another_flight_about_a_key_that_was_replaced_since_changes_nothing():
    old = statement(
        "f1", roster=replace(ROSTER, vehicles=ROSTER.vehicles | {"f1": KEYS["eye"].sign(b"")[:32]})
    )
    trust = trust_of("f2", 3)
    with pytest.raises(RefusedError, match="no key of this roster"):
        trust.revoke(trust.read(old), 0.0)


def test_a_statement_that_is_played_again_a_thousand_times_costs_no_signature_and_tells_nobody_twice():
    wire, _, _, other, desk = ordered()
    sealed = desk.member.revoke("f1").data
    wire.run(0.1)
    looked: Counter[str] = Counter()
    verifies = other.member.trust._verifiers["eye"]  # noqa: SLF001

    def counted(signature: bytes, signed: bytes) -> bool:
        looked["eye"] += 1
        return verifies(signature, signed)

    other.member.trust._verifiers["eye"] = counted  # noqa: SLF001
    for _ in range(1000):
        wire.inject(sealed)
    # Another statement of the same is as good as the first.
    wire.inject(statement("f1"))
    wire.run(0.1)
    assert other.revoked == ["f1"]
    assert not looked
    assert len(other.member.trust.statements) == 1


def test_it_is_kept_over_a_restart_and_nothing_is_believed_of_a_damaged_file(tmp_path):
    file = tmp_path / "f2.revoked"
    assert read_revocations(file) == ()
    write_revocations(file, [statement("f1")])
    again = trust_of("f2", 44)
    assert again.recall(read_revocations(file)) == 0
    assert again.revoked == ("f1",)
    file.write_bytes(b"\xff nonsense\n" + file.read_bytes() + forged("f2").hex().encode() + b"\n")
    damaged = trust_of("f2", 45)
    # The operator reads of it in the log; what is said of a key that is out already needs no look.
    assert damaged.recall(read_revocations(file)) == 1
    assert damaged.revoked == ("f1",)


def test_on_a_radio_the_statement_comes_in_pieces_and_the_packets_of_that_vehicle_are_out():
    channel, leader, one, other = radio_crafts.formation(6.0)
    desk = channel.craft("eye", session=9, orders=True)
    channel.fly(6.0)
    for _ in range(12):
        desk.member.revoke("f1")
        channel.fly(0.5)
    assert leader.member.trust.revoked == other.member.trust.revoked == ("f1",)
    channel.gone(desk)
    heard = len(other.neighbours)
    channel.fly(WITHIN_S)
    assert not [said for said in other.neighbours[heard:] if said[0] == "f1"]
    # Who joins hears it of the others.
    channel.gone(other)
    joins = channel.craft("f2", session=44)
    for _ in range(30):
        leader.member.pass_on()
        channel.fly(1.0)
    assert joins.member.trust.revoked == ("f1",)
    assert one.member.stands_back


def test_a_recorded_piece_of_a_statement_moves_nobodys_turns():
    channel, leader, one, other = radio_crafts.formation(6.0)
    desk = channel.craft("eye", session=9, orders=True)
    desk.member.trust.revoke(desk.member.trust.read(statement(LEADER)), 0.0)
    one.member.trust.revoke(one.member.trust.read(statement(LEADER)), 0.0)
    taken = channel.record()
    for _ in range(8):
        one.member.pass_on()
        channel.fly(0.5)
    pieces = [
        frame for frame in taken if radio_crafts.packets_of([frame]) == [PackedKind.REVOCATION]
    ]
    assert pieces
    channel.gone(leader)
    channel.gone(one)
    channel.fly(6.0)
    now = other.member.clock()
    before = other.station.next_turn(now)
    assert before is not None
    other.station.hear(pieces[0], now)
    assert other.station.next_turn(now) == before
