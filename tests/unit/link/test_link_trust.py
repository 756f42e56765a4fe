import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.link import (
    FORMATION,
    KEYS,
    LEADER,
    ROSTER,
    Carried,
    Station,
    Wire,
    formation,
    signed_as,
    straight,
    trust_of,
)
from vfguide.errors import InputError
from vfguide.link.codec import (
    LARGEST,
    Kind,
    Scheme,
    checksum,
    decode_envelope,
    encode_signed,
    formation_number,
)
from vfguide.link.keys import Roster
from vfguide.link.member import NOT_SAID, TWIN_QUIET_S, TWIN_SPREAD_S, Parcel
from vfguide.link.trust import TWIN, RefusedError, Trust

ANOTHER_SESSION, ANOTHER_FLIGHT = "another session of the leader", "another flight"


def flown(carry: Callable[[Parcel], Carried] = straight) -> list[Station]:
    """A formation after some seconds on a wire that has become silent."""
    wire, *stations = formation(5.0, carry)
    wire.run(2.0)
    return stations


def proven(name: str, session: int, leader: int = 1, **options: object) -> Trust:
    """One to whom this session of the leader is the one that lives."""
    trust = trust_of(name, session, **options)
    trust.prove(leader, 0.0)
    return trust


def sealed(trust: Trust, kind: Kind = Kind.STATE, time_s: float = 1.0) -> bytes:
    return trust.seal(kind, b"", time_s=time_s)


def refused(trust: Trust, data: bytes, now: float = 0.0, time_s: float = math.nan) -> str:
    """Why a message is refused at a formation's time; empty if it is believed."""
    try:
        trust.believe(trust.read(data), now, time_s=time_s)
    except RefusedError as refusal:
        return str(refusal)
    return ""


def refused_at(trust: Trust, data: bytes, now: float = 1.0) -> str:
    """Why a message is refused by one who knows the formation's time."""
    return refused(trust, data, now, now)


def test_everybody_hears_everybody_once_the_leader_has_shown_that_it_lives():
    leader, one, other = flown()
    # Question and answer take 20 ms: the first state of the leader comes too early to be believed.
    assert [data for _, data in one.heard] == [b"lead %d" % step for step in range(1, 100)]
    assert leader.neighbours[-2:] == [("f1", b"f1 96"), ("f2", b"f2 96")]
    assert one.neighbours[-1] == ("f2", b"f2 96")
    assert one.clock.offset_s == pytest.approx(-100.0)
    assert set(other.counters) <= {f"refused: {one}" for one in (ANOTHER_SESSION, ANOTHER_FLIGHT)}


def forge(parcel: Parcel) -> Carried:
    """Whatever is said is also said by somebody who has no key, in every way that he can think of."""
    yield 0.01, parcel.data
    real = decode_envelope(parcel.data)

    names = ("formation", "sender", "session", "epoch", "time_s")

    def made(scheme: Scheme, sequence: int) -> bytes:
        same = {name: getattr(real, name) for name in names}
        return encode_signed(scheme, real.kind, sequence=sequence, body=b"forged", **same)

    for sequence in (real.sequence, real.sequence + 1, 2**32 - 1):
        signed = made(Scheme.ED25519, sequence)
        yield 0.001, signed + bytes(64)
        yield 0.001, signed + real.tag
        yield 0.001, signed + KEYS["eye"].sign(signed)
    plain = made(Scheme.UNSIGNED, real.sequence + 1)
    yield 0.001, plain + checksum(plain)


def repeat(parcel: Parcel) -> Carried:
    """Everything comes again and again."""
    for number in range(5):
        yield 0.01 + 0.3 * number, parcel.data


def bend(parcel: Parcel) -> Carried:
    """Every message is also there with a bit of it turned over."""
    yield 0.01, parcel.data
    for bit in range(0, 8 * len(parcel.data), 97):
        data = bytearray(parcel.data)
        data[bit // 8] ^= 1 << bit % 8
        yield 0.001, bytes(data)


@pytest.mark.parametrize("attack", [forge, repeat, bend])
def test_forged_repeated_and_changed_messages_change_nothing_but_counters(attack):
    calm, beset = flown(), flown(attack)
    for before, now in zip(calm, beset, strict=True):
        assert now.heard == before.heard
        assert now.neighbours == before.neighbours
        assert sum(now.counters.values()) > 100
    for number in (1, 2):
        assert beset[number].clock.offset_s == calm[number].clock.offset_s


def test_delayed_messages_are_heard_late_and_the_clock_stays_right():
    """As long each way: the middle of the exchange is where it was."""

    def delay(parcel: Parcel) -> Carried:
        yield 0.14, parcel.data

    _, calm, _ = flown()
    _, late, _ = flown(delay)
    known = dict(map(reversed, calm.heard))  # type: ignore[arg-type]
    assert len(late.heard) > 70
    assert all(when == pytest.approx(known[data] + 0.13) for when, data in late.heard)  # type: ignore[index]
    assert late.clock.offset_s == pytest.approx(-100.0, abs=1e-9)


def test_an_answer_that_is_held_back_moves_the_clock_by_half_of_that_and_says_so():
    def hold(parcel: Parcel) -> Carried:
        yield (0.21 if parcel.kind is Kind.ANSWER else 0.01), parcel.data

    _, one, _ = flown(hold)
    assert one.clock.offset_s == pytest.approx(-100.0 - 0.1)
    assert one.clock.bound_s >= 0.1


def stolen(**fields: Any) -> bytes:
    """A message by whoever has the key of f1."""
    return signed_as("f1", "f1", Kind.STATE, **fields)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"sequence": 2**32 - 1}, "a number that leaps"),
        ({"sequence": 6, "time_s": 1e10}, "of a time to come"),
        ({"session": 9, "time_s": 1e10}, "of a time to come"),
    ],
)
def test_a_stolen_key_does_not_make_its_owner_a_copy_of_itself(fields, reason):
    listener, owner = proven("f2", 3), proven("f1", 2)
    assert refused_at(listener, sealed(owner)) == ""
    assert refused_at(listener, stolen(**fields)) == reason
    assert refused_at(listener, sealed(owner, time_s=1.1)) == ""
    # Nor after the owner was started anew.
    assert refused_at(listener, sealed(proven("f1", 4), time_s=1.2)) == ""


def test_numbers_that_rise_through_an_hour_of_silence_are_heard():
    listener = proven("f2", 3)
    assert refused_at(listener, stolen(sequence=5)) == ""
    assert refused_at(listener, stolen(sequence=5 + 25 * 3600, time_s=3601.0), 3601.0) == ""


def test_a_flood_by_a_valid_key_silences_its_owner_alone():
    listener, other = proven("f2", 3), trust_of(LEADER, 1)
    reasons = Counter(refused(listener, stolen(sequence=n)) for n in range(1, 6001))
    assert reasons == {"": 2000, "says too much": 4000}
    assert refused(listener, sealed(other)) == ""
    # 400 a second are looked at from then on.
    later = Counter(refused(listener, stolen(sequence=n), 1.0) for n in range(2001, 3001))
    assert later == {"": 400, "says too much": 600}


def test_after_a_flood_by_a_valid_key_its_owner_is_heard_at_once_and_no_recording_of_it():
    listener, owner = proven("f2", 3), proven("f1", 2)
    recorded = [sealed(owner, time_s=1.0) for _ in range(3)]
    assert [refused_at(listener, data, 1.1) for data in recorded] == [""] * 3
    # Two seconds ahead, and with more numbers than the owner needs in minutes.
    for number in range(4, 1500):
        assert refused_at(listener, stolen(sequence=number, time_s=3.0), 1.1) == ""
    assert refused_at(listener, sealed(owner, time_s=2.9), 3.0) == "heard before"
    assert refused_at(listener, told := sealed(owner, time_s=3.1), 3.2) == ""
    assert {refused_at(listener, data, 3.3) for data in (*recorded, told)} == {"heard before"}


def test_the_owner_of_a_stolen_key_says_so_at_its_first_use_and_does_not_look_at_its_own_messages():
    owner = proven("f1", 2)
    own = [sealed(owner) for _ in range(4)]
    assert refused_at(owner, stolen(sequence=5)) == TWIN
    assert refused_at(owner, stolen(sequence=5)[:-1] + b"\0") == "forged"
    assert {refused_at(owner, data) for data in own} == {"one's own"}
    # What comes in its name takes no other's part of its time.
    reasons = Counter(refused(owner, stolen(sequence=n)) for n in range(5, 5000))
    assert reasons == {TWIN: 1999, "says too much": 2996}
    assert refused(owner, sealed(trust_of(LEADER, 1))) == ""


@pytest.mark.parametrize("lost", [False, True])
def test_a_deputy_tells_the_time_only_once_the_leader_is_lost(lost):
    wire, leader, one, other = formation(2.0)
    for station in (one, other):
        station.member.trust.deputies = frozenset({"f1"})
    wire.stations.remove(leader)
    one.member.stands_in = True
    wire.run(4.0 if lost else 0.5)
    other.member.ask()
    wire.run(0.2)
    assert other.counters["refused: a deputy's clock while the leader may live"] == (not lost)


def test_reflected_messages_are_ones_own_and_not_believed():
    wire, leader, one, other = formation(2.0)
    before = len(one.heard), len(one.neighbours), len(leader.neighbours)
    for parcel in list(wire.sent):
        for station in (leader, one, other):
            station.member.take(parcel.data)
    assert (len(one.heard), len(one.neighbours), len(leader.neighbours)) == before
    assert leader.counters["refused: one's own"] == 40
    assert one.counters["refused: one's own"] == 10


def test_a_recording_of_yesterday_is_believed_by_nobody():
    yesterday, *_ = formation(5.0)
    today, leader, one, other = formation(first_session=11)
    # Before anybody has spoken, and again while they fly.
    for parcel in yesterday.sent:
        today.inject(parcel.data)
    today.run(0.0)
    assert not one.heard
    assert not one.neighbours
    assert not leader.neighbours
    assert not one.clock.ready
    today.fly(leader, 1.0, one, other)
    heard, neighbours = len(one.heard), len(one.neighbours)
    for parcel in yesterday.sent:
        today.inject(parcel.data)
    today.run(0.0)
    assert (len(one.heard), len(one.neighbours)) == (heard, neighbours)
    assert one.counters[f"refused: {ANOTHER_SESSION}"] >= 200
    assert one.counters[f"refused: {ANOTHER_FLIGHT}"] >= 25


def test_a_leader_that_starts_anew_is_heard_again_and_its_last_session_no_more():
    wire, leader, one, other = formation(2.0)
    old = [parcel.data for parcel in wire.sent if parcel.kind is Kind.STATE]
    wire.stations.remove(leader)
    wire.run(1.5)
    again = wire.station(LEADER, session=50)
    one.heard.clear()
    again.member.publish(b"too early")
    wire.run(0.05)
    assert one.heard == []
    # It asks for that, and does not wait for its turn.
    assert one.member.hurry.is_set()
    wire.fly(again, 2.0, one, other)
    assert one.heard[-1][1] == b"lead 39"
    heard = len(one.heard)
    for data in old:
        wire.inject(data)
    wire.run(1.0)
    assert len(one.heard) == heard


def test_a_follower_that_starts_anew_is_heard_again_and_its_last_session_no_more():
    wire, leader, one, other = formation(2.0)
    old = [p.data for p in wire.sent if decode_envelope(p.data).sender == "f1"]
    wire.stations.remove(one)
    again = wire.station("f1", session=60, skew_s=3.0)
    wire.fly(leader, 2.0, again, other)
    assert ("f1", b"f1 36") in leader.neighbours[-4:]
    heard = len(leader.neighbours), len(other.neighbours)
    for data in old:
        wire.inject(data)
    wire.fly(leader, 1.0)
    assert (len(leader.neighbours), len(other.neighbours)) == heard
    assert leader.counters["refused: an earlier session"] >= 9


def with_rival() -> tuple[Wire, Station, Station, Station, Station]:
    """A formation, and another companion of its leader that has stepped back."""
    wire, leader, one, other = formation(12.0)
    rival = wire.station(LEADER, session=70, skew_s=40.0)
    for _ in range(3):
        rival.member.publish(b"rival")
        wire.fly(leader, 0.5, one, other)
    assert rival.member.stands_back
    return wire, leader, one, other, rival


def test_a_second_leader_is_found_out_and_not_followed():
    wire, leader, one, _ = formation(2.0)
    rival = wire.station(LEADER, session=70)
    # The one that is asked first answers first.
    wire.stations.insert(0, wire.stations.pop())
    for step in range(40):
        leader.member.publish(b"lead %d" % step)
        rival.member.publish(b"rival %d" % step)
        one.member.ask()
        wire.run(0.05)
    assert not [data for _, data in one.heard if data.startswith(b"rival")]
    assert one.counters["refused: a second leader"] >= 1
    assert rival.member.stands_back
    assert leader.counters["refused: another companion of this name"] >= 1


def test_the_younger_of_two_companions_of_the_leader_steps_back_until_the_other_is_silent():
    wire, leader, one, other, rival = with_rival()
    assert not leader.member.stands_back
    one.heard.clear()
    for _ in range(40):
        rival.member.publish(b"rival")
        rival.member.say(Kind.LEADER, b"rival")
        wire.fly(leader, 0.5, one, other)
        assert rival.member.stands_back
    assert not [data for _, data in one.heard if data == b"rival"]
    assert rival.counters[NOT_SAID] >= 80
    # The older one goes: after its silence, and some chance, the younger leads.
    wire.stations.remove(leader)
    one.heard.clear()
    wire.fly(rival, TWIN_QUIET_S + TWIN_SPREAD_S + 1.5, one, other)
    assert not rival.member.stands_back
    assert one.heard


@pytest.mark.parametrize("apart_s", [0.05, 3.0])
def test_of_two_companions_of_the_leader_that_are_both_new_the_first_goes_on(apart_s):
    wire, leader, one, _ = formation(apart_s)
    rival = wire.station(LEADER, session=70)
    for step in range(100):
        leader.member.publish(b"lead %d" % step)
        rival.member.publish(b"rival %d" % step)
        if step % 10 == 0:
            one.member.ask()
        wire.run(0.05)
    assert rival.member.stands_back
    assert not leader.member.stands_back


def test_an_answer_that_was_kept_back_sends_no_leader_back():
    """For three seconds: it may be of a companion that has died since."""

    def keep_back(parcel: Parcel) -> Carried:
        yield (3.0 if parcel.kind is Kind.ANSWER else 0.01), parcel.data

    wire, leader, one, other = formation(5.0, keep_back)
    rival = wire.station(LEADER, session=70)
    rival.member.publish(b"rival")
    wire.fly(leader, 8.0, one, other)
    assert any(p.kind is Kind.ANSWER and p.to == LEADER for p in wire.sent)
    assert not rival.member.stands_back


def test_a_question_in_ones_own_name_that_is_none_is_counted():
    wire, leader, *_ = formation()
    rival = wire.station(LEADER, session=70)
    rival.member._send(Kind.QUESTION, LEADER, b"no question")  # noqa: SLF001
    wire.run(0.1)
    assert leader.counters["refused: no question"] == 1
    assert leader.counters["failed to use"] == 0


def test_two_companions_of_the_leader_that_begin_at_once_step_back_until_chance_parts_them():
    wire = Wire()
    pair = [wire.station(LEADER, session=session) for session in (70, 71)]
    spoke, alone = [], ([True, False], [False, True])
    # Some step back together again and again: each time by chance for another while.
    while len(spoke) < 300 * 20 and not any(spoke[-200:] == 200 * [one] for one in alone):
        for station in pair:
            station.member.publish(b"lead")
        wire.run(0.05)
        spoke.append([not station.member.stands_back for station in pair])
    assert [False, False] in spoke
    assert spoke[-1] in alone


def test_a_recording_of_its_own_run_before_makes_no_leader_step_back():
    """Also where all is played that was said in its name to another of its name, the answers included."""
    wire, *_ = with_rival()
    old = [parcel.data for parcel in wire.sent if decode_envelope(parcel.data).sender == LEADER]
    assert {Kind.QUESTION, Kind.ANSWER} <= {decode_envelope(data).kind for data in old}
    wire.stations.clear()
    again = wire.station(LEADER, session=71)
    again.member.publish(b"lead")
    for data in old:
        wire.inject(data)
        wire.run(0.01)
        again.member.publish(b"lead")
    assert again.counters["refused: another companion of this name"] > 100
    assert not again.member.stands_back
    # Nor does it answer more than now and then.
    answers = [
        p for p in wire.sent if p.kind is Kind.ANSWER and decode_envelope(p.data).session == 71
    ]
    assert len(answers) <= 0.01 * len(old) / 0.4 + 1


def test_of_two_companions_of_one_name_the_younger_steps_back_until_the_other_is_silent():
    wire, leader, one, other = formation(12.0)
    twin = wire.station("f1", session=60, skew_s=3.0)
    wire.fly(leader, 3.0, one, other, twin)
    assert twin.member.stands_back
    assert not one.member.stands_back
    said = twin.member.counters[NOT_SAID]
    leader.neighbours.clear()
    wire.fly(leader, 2.0, one, other, twin)
    assert twin.member.counters[NOT_SAID] == said + 10
    # The older one goes: after its silence, and some chance, the younger speaks.
    wire.stations.remove(one)
    wire.fly(leader, TWIN_QUIET_S + TWIN_SPREAD_S + 0.5, other, twin)
    assert not twin.member.stands_back
    assert leader.neighbours[-1][0] in {"f1", "f2"}
    assert "f1" in {name for name, _ in leader.neighbours[-4:]}


def test_a_recording_of_its_own_run_before_makes_no_companion_step_back():
    wire, leader, one, other = formation(12.0)
    old = [p.data for p in wire.sent if decode_envelope(p.data).sender == "f1"]
    wire.stations.remove(one)
    again = wire.station("f1", session=60, skew_s=3.0)
    wire.fly(leader, 3.0, again, other)
    for data in old:
        wire.inject(data)
    wire.run(1.0)
    assert again.counters["refused: another companion of this name"] > 0
    assert not again.member.stands_back


def test_of_two_programs_of_one_operator_none_steps_back_and_each_hears_the_others_orders(caplog):
    """All of an operator's programs use one key."""
    wire, leader, one, other = formation()
    desk, second = (wire.station("eye", session=session) for session in (60, 61))
    for station in (desk, second):
        station.member.ask()
    wire.fly(leader, 3.0, one, other)
    desk.member.say(Kind.ORDER, b"vee")
    wire.run(0.1)
    assert [data for data, *_ in second.orders] == [b"vee"]
    assert desk.orders == []
    assert not second.member.stands_back
    said = len(wire.sent)
    second.member.say(Kind.REPLY, b"which order is flown?")
    assert len(wire.sent) == said + 1
    # Nobody without the key can make an order up.
    true = decode_envelope(desk.member.say(Kind.ORDER, b"trail").data)
    wire.inject(true.signed + bytes(64))
    wire.run(0.1)
    assert [data for data, *_ in second.orders] == [b"vee", b"trail"]
    assert not caplog.messages


def test_a_sender_may_only_say_what_its_part_may_say():
    """Each of these is signed by a true key of the formation."""
    leader, follower = trust_of(LEADER, 1), proven("f2", 2)
    for name, kind in (("f1", Kind.ANSWER), ("f1", Kind.ORDER), ("eye", Kind.STATE)):
        data = sealed(proven(name, 3), kind)
        assert refused(follower, data) == "not for its sender to say"
        assert refused(leader, data) == "not for its sender to say"
    assert refused(follower, sealed(leader, Kind.ORDER)) == "not for its sender to say"
    assert refused(follower, sealed(proven("eye", 4), Kind.ORDER)) == ""


def test_two_formations_on_one_wire_do_not_hear_each_other():
    own, other = proven("f1", 1, leader=2), trust_of(LEADER, 2)
    elsewhere = trust_of(LEADER, 2, formation="line", roster=replace(ROSTER, formation="line"))
    assert refused(own, sealed(elsewhere)) == "another formation"
    assert refused(own, sealed(other)) == ""
    assert formation_number("line") != formation_number(FORMATION)


def test_who_signs_and_who_does_not_do_not_hear_each_other():
    signed, insecure = trust_of(LEADER, 1), trust_of(LEADER, 1, signed=False)
    careful, careless = proven("f1", 2), proven("f1", 2, signed=False)
    assert refused(careful, sealed(insecure)) == "not signed"
    assert refused(careless, sealed(signed)) == "signed, where --insecure was typed"
    assert refused(careless, sealed(insecure)) == ""


def test_a_watcher_without_a_key_believes_what_is_signed_and_with_one_what_is_of_today():
    old, new = trust_of(LEADER, 1), trust_of(LEADER, 2)
    keyless = trust_of("-", 9, watches=True)
    for trust in (old, new):
        assert refused(keyless, sealed(trust, Kind.PRESENCE)) == ""
    watcher = proven("eye", 9, leader=2, watches=True)
    assert refused(watcher, sealed(old, Kind.PRESENCE)) != ""
    assert refused(watcher, sealed(new, Kind.PRESENCE)) == ""
    # A vehicle that has not found its leader says so under no session at all.
    assert refused(watcher, sealed(trust_of("f1", 5), Kind.PRESENCE)) == ""


def test_a_will_is_believed_as_late_as_the_broker_says_it_and_a_later_presence_too():
    vehicle, watcher = trust_of("f1", 1), trust_of("eye", 2, watches=True)
    will = sealed(vehicle, Kind.WILL)
    for _ in range(3):
        assert refused(watcher, sealed(vehicle, Kind.PRESENCE, 2.0)) == ""
    assert refused(watcher, will) == ""
    assert refused(watcher, sealed(vehicle, Kind.PRESENCE, 3.0)) == ""


@pytest.mark.parametrize(
    ("roster", "text"),
    [
        (replace(ROSTER, formation="line"), "of the formation 'line', the mission's is 'circle'"),
        (Roster(formation=FORMATION), "no key of the leader 'lead'"),
        (
            replace(ROSTER, vehicles={**ROSTER.vehicles, "f1": ROSTER.vehicles["f2"]}),
            "the private key of 'f1' is not the one that the roster names",
        ),
    ],
)
def test_a_roster_that_does_not_fit_is_one_clear_line(roster, text):
    with pytest.raises(InputError, match=text):
        trust_of("f1", 1, roster=roster)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(
    kind=st.sampled_from(Kind),
    body=st.binary(max_size=200),
    sequence=st.integers(0, 2**32 - 1),
    session=st.integers(0, 2**64 - 1),
    sender=st.text(min_size=1, max_size=40),
    time_s=st.floats(-1e10, 1e10) | st.just(float("nan")),
)
def test_what_goes_into_an_envelope_comes_out(kind, body, sequence, session, sender, time_s):
    said = {"sender": sender, "session": session, "epoch": session ^ 1, "sequence": sequence}
    signed = encode_signed(Scheme.UNSIGNED, kind, formation=7, time_s=time_s, body=body, **said)
    found = decode_envelope(signed + checksum(signed))
    assert (found.kind, found.body, found.sequence) == (kind, body, sequence)
    assert (found.session, found.epoch, found.sender) == (session, session ^ 1, sender)
    assert found.time_s == time_s or (math.isnan(found.time_s) and math.isnan(time_s))
    assert found.tag == checksum(found.signed)


STATE = trust_of(LEADER, 1).seal(Kind.STATE, b"a state", time_s=1.0)


@settings(deadline=None, derandomize=True, max_examples=500)
@given(data=st.binary(max_size=300) | st.binary(max_size=200).map(lambda end: STATE[:40] + end))
def test_random_bytes_are_counted_and_nothing_else(data):
    _, _, one, _ = formation()
    one.member.take(data)
    assert one.heard == []
    assert sum(one.counters.values()) <= 1
    assert "failed to use" not in one.counters


def test_what_is_too_long_is_refused_on_both_sides():
    trust = trust_of("f1", 1)
    with pytest.raises(ValueError, match="too long"):
        trust.seal(Kind.PRESENCE, bytes(LARGEST), time_s=0.0)
    with pytest.raises(RefusedError, match="malformed"):
        trust.read(STATE + bytes(LARGEST))


def test_a_flood_of_made_up_names_does_not_grow_memory_where_nothing_is_signed():
    trust, random = proven("f1", 1, leader=5, signed=False), Random(1)
    reasons: Counter[str] = Counter()
    for number in range(2000):
        stranger = proven(f"n{number}", random.getrandbits(64), leader=5, signed=False)
        reasons[refused(trust, sealed(stranger))] += 1
    assert reasons == {"": 256, "too many senders": 1744}
