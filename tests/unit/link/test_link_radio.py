"""Members that share a radio, in virtual time: what they hear, and what becomes of everything else."""

from collections import Counter
from dataclasses import replace
from itertools import count
from random import Random

import pytest

from tests.unit.link.shared_radio import state_at
from tests.unit.link.wire import FORMATION, KEYS, LEADER, trust_of
from vfguide.lab.rehearsal.emulated_radio import Air, Radio, RadioQuality
from vfguide.link.codec import decode
from vfguide.link.envelope import Kind
from vfguide.link.member import Member, ignore
from vfguide.link.order_codec import Reply, Verdict, decode_reply, encode_reply
from vfguide.link.packed import (
    BeatInfo,
    PackedKind,
    decode_packet,
    encode_beat_alone,
    encode_packet,
    formation_mark,
)
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.radio_framing import DAMAGED, Framer, encode_frame
from vfguide.link.radio_schedule import Channel, make_timetable
from vfguide.link.radio_station import Station
from vfguide.link.trust import Trust

CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)
KEY = bytes(range(32))
NAMES = (LEADER, "f1", "f2")

STEP_S = 0.05
ASK_S = 0.2


class Craft:
    """One member with its station on the air."""

    def __init__(
        self,
        channel: "Shared",
        name: str,
        *,
        session: int,
        key: bytes = KEY,
        formation: str = FORMATION,
        vehicles: tuple[str, ...] = NAMES,
        watches: bool = False,
        orders: bool = False,
        offset_s: float = 0.0,
        rate: float = 1.0,
        listens_first: bool | None = None,
    ) -> None:
        leads = name == LEADER
        air = channel.air
        self.name = name
        self.heard: list[tuple[float, float]] = []
        """Times of the leader's states, and when they came, s of virtual time."""
        self.neighbours: list[tuple[str, float]] = []
        self.presences: dict[str, Presence] = {}
        self.orders: list[tuple[bytes, bool]] = []
        """Orders, and whether each was repeated by a vehicle."""
        self.replies: list[tuple[str, bytes]] = []
        self.publishes = not (watches or orders)
        self.peer_clock = (
            None if leads or watches else PeerClock(chance=count(1 + 1000 * session).__next__)
        )
        trust = (
            trust_of(name, session)
            if formation == FORMATION and not watches and name in KEYS
            else Trust(
                formation=formation,
                name=name,
                leader=LEADER,
                session=session,
                roster=None,
                watches=watches,
            )
        )

        def note(data: bytes) -> None:
            self.heard.append((decode(data).time_s, air.now))

        def note_neighbour(vehicle: str, data: bytes) -> None:
            self.neighbours.append((vehicle, decode(data).time_s))

        def note_presence(vehicle: str, presence: Presence) -> None:
            self.presences[vehicle] = presence

        def note_order(data: bytes, sealed: bytes, repeated: bool) -> None:
            self.sealed = sealed
            self.orders.append((data, repeated))

        self.member = Member(
            trust,
            clock=lambda: offset_s + rate * air.now,
            receive=ignore if leads or watches else note,
            neighbours=[one for one in vehicles[1:] if one != name],
            receive_neighbour=note_neighbour,
            receive_presence=note_presence if watches or orders else None,
            receive_order=None if watches else note_order,
            receive_reply=None
            if watches
            else lambda vehicle, data: self.replies.append((vehicle, data)),
            peer_clock=self.peer_clock,
        )
        self.station = Station(
            self.member,
            formation=formation,
            vehicles=vehicles,
            key=key,
            channel=CHANNEL,
            timetable=make_timetable(
                len(vehicles), leader_hz=10.0, followers_hz=2.5, channel=CHANNEL
            )
            if leads
            else None,
            listens_first=not leads if listens_first is None else listens_first,
        )
        self.member.send = lambda parcel: self.station.post(parcel, self.member.clock())
        self.station.announce(Presence(status="online", mode="tracking", time_s=0.0, version="1"))
        self.asks_s = air.now
        self.radio: Radio = air.add(self.station, offset_s=offset_s, rate=rate)

    @property
    def counters(self) -> Counter[str]:
        return self.member.counters

    @property
    def refused(self) -> set[str]:
        return {one.removeprefix("refused: ") for one in self.counters if "refused" in one}

    def step(self, now: float) -> None:
        """Publish a state of now, and ask where that is due."""
        if self.publishes:
            time_s = self.member.formation_time()
            if time_s >= 0.0:
                self.member.publish(state_at(time_s))
        if self.peer_clock is not None and now >= self.asks_s:
            self.member.ask()
            self.asks_s = now + self.peer_clock.pause_s


class Shared:
    """The air with those who are on it."""

    def __init__(self, quality: RadioQuality | None = None) -> None:
        self.air = Air(quality or RadioQuality(channel=CHANNEL), seed=3)
        self.crafts: list[Craft] = []

    def craft(self, name: str, *, session: int, **options: object) -> Craft:
        one = Craft(self, name, session=session, **options)  # type: ignore[arg-type]
        self.crafts.append(one)
        return one

    def fly(self, seconds: float) -> None:
        """Let time pass; 20 states a second of each."""
        ends = self.air.now + seconds
        while self.air.now < ends - 1e-9:
            for one in self.crafts:
                if one.radio.on:
                    one.step(self.air.now)
            self.air.run(self.air.now + STEP_S)

    def gone(self, craft: Craft) -> None:
        craft.radio.on = False

    def record(self) -> list[bytes]:
        """A list that everything on the air goes to from now on."""
        taken: list[bytes] = []
        transmit = self.air.transmit

        def note(data: bytes, *, sender: Radio | None = None) -> None:
            taken.append(data)
            transmit(data, sender=sender)

        self.air.transmit = note  # type: ignore[method-assign]
        return taken


def formation(quality: RadioQuality | None = None) -> tuple[Shared, Craft, Craft, Craft]:
    channel = Shared(quality)
    return (
        channel,
        channel.craft(LEADER, session=1, offset_s=1000.0),
        channel.craft("f1", session=2, offset_s=50.0, rate=1.00005),
        channel.craft("f2", session=3, offset_s=7.0, rate=0.99995),
    )


def packets_of(frames: list[bytes]) -> list[PackedKind]:
    framer = Framer(Counter())
    return [decode_packet(packet).kind for frame in frames for packet in framer.feed(frame)]


def last_of(frames: list[bytes], *, sender: int) -> bytes:
    """The last that a vehicle of this number has sent."""
    packets = [(Framer(Counter()).feed(frame)[0], frame) for frame in frames]
    return [frame for packet, frame in packets if decode_packet(packet).sender == sender][-1]


def test_a_formation_hears_itself_without_a_collision() -> None:
    channel, leader, one, other = formation()
    channel.fly(20.0)
    # Ten states a second of the leader; 2.5 of each follower, less what questions and presences take.
    assert len(one.heard) > 10 * 18
    assert len([1 for vehicle, _ in other.neighbours if vehicle == "f1"]) > 2.5 * 20 * 0.6
    assert {vehicle for vehicle, _ in leader.neighbours} == {"f1", "f2"}
    assert channel.air.counters["in collisions"] == 0
    assert one.refused <= {"another session or forged"}


def test_the_leaders_clock_is_known_to_milliseconds_though_questions_wait_for_their_turns() -> None:
    channel, _, one, other = formation()
    channel.fly(20.0)
    for craft, offset_s in ((one, 950.0), (other, 993.0)):
        assert craft.peer_clock is not None
        drift_s = 20.0 * 50e-6
        assert craft.peer_clock.offset_s == pytest.approx(offset_s, abs=0.001 + drift_s)


def test_states_are_the_newest_there_were_when_their_turn_came() -> None:
    """On the way for 56 bytes twice over the line and once over the air; made every 50 ms."""
    channel, _, one, _ = formation()
    channel.fly(10.0)
    ages = [arrived + 1000.0 - time_s for time_s, arrived in one.heard]
    assert max(ages) < CHANNEL.latency_s(56) + STEP_S + 1e-3
    # What gave way to a newer one was not sent: half of the leader's 200.
    assert 90 <= channel.crafts[0].counters["radio: replaced before its turn"] <= 110


def test_a_state_that_has_waited_for_a_second_is_not_sent() -> None:
    channel = Shared()
    leader = channel.craft(LEADER, session=1)
    station = leader.station
    for waited_s, kind in ((0.9, PackedKind.STATE), (1.1, PackedKind.BEAT)):
        leader.member.publish(state_at(0.0))
        turn = station.next_turn(waited_s)
        assert turn is not None
        frame = station.speak(replace(turn, at_s=waited_s, beat=1), waited_s)
        assert packets_of([frame]) == [kind]
    assert leader.counters["radio: too old for its turn"] == 1


def test_a_turn_that_comes_too_late_is_let_go() -> None:
    """The processor was elsewhere: a slot of 33.3 ms less the 16.6 ms that a packet may take."""
    channel = Shared()
    leader = channel.craft(LEADER, session=1)
    turn = leader.station.next_turn(0.0)
    assert turn is not None
    assert leader.station.speak(turn, turn.at_s + 0.0165)
    assert not leader.station.speak(turn, turn.at_s + 0.0168)
    assert leader.counters["radio: late for its turn"] == 1


def test_the_leader_alone_gives_the_beat_and_a_follower_alone_is_silent() -> None:
    channel = Shared()
    channel.craft(LEADER, session=1)
    taken = channel.record()
    channel.fly(1.95)
    # 20 beats, and a presence in the answer's turn.
    assert Counter(packets_of(taken)) == {PackedKind.STATE: 20, PackedKind.PRESENCE: 1}
    alone = Shared()
    alone.craft("f1", session=2)
    taken = alone.record()
    alone.fly(20.0)
    assert not taken


def test_a_leader_without_telemetry_still_gives_the_beat_and_its_clock() -> None:
    channel, leader, one, _ = formation()
    leader.publishes = False
    channel.fly(5.0)
    assert one.peer_clock is not None
    assert one.peer_clock.ready
    assert not one.heard


def test_a_late_joiner_asks_in_its_turn_and_disturbs_nobody() -> None:
    channel = Shared()
    channel.craft(LEADER, session=1)
    channel.craft("f1", session=2)
    channel.fly(10.0)
    late = channel.craft("f2", session=3, offset_s=3.0)
    channel.fly(3.0)
    assert late.heard
    assert late.neighbours
    assert channel.air.counters["in collisions"] == 0


def test_a_late_joiner_need_not_wait_until_others_have_asked_enough() -> None:
    """Another one asks in every second turn, and is answered every 0.8 s: what the late one hears first."""
    channel = Shared()
    leader = channel.craft(LEADER, session=1)
    asker = channel.craft("f1", session=2)
    frames = channel.record()
    channel.fly(5.0)
    late = channel.craft("f2", session=3, offset_s=3.0)
    answer = next(one for one in reversed(frames) if packets_of([one]) == [PackedKind.ANSWER])
    late.station.hear(answer, late.member.clock())
    for _ in range(60):
        asker.member.hurry.set()
        asker.member.ask()
        asker.member.hurry.set()
        channel.fly(0.05)
    assert leader.station._questions._answered_s[1] > channel.air.now - 1.0  # noqa: SLF001
    assert late.heard


def test_followers_go_on_in_their_turns_while_the_leader_is_silent() -> None:
    """For ten minutes, on clocks that run apart by 60 ms in that time: more than a slot."""
    channel, leader, one, other = formation()
    channel.fly(5.0)
    channel.gone(leader)
    one.neighbours.clear()
    channel.fly(600.0)
    assert channel.air.counters["in collisions"] == 0
    assert len(one.neighbours) > 2.5 * 600 * 0.6
    assert {vehicle for vehicle, _ in other.neighbours} >= {"f1"}


def test_a_leader_that_starts_anew_is_believed_once_it_has_answered() -> None:
    channel, leader, one, _ = formation()
    channel.fly(5.0)
    channel.gone(leader)
    channel.fly(1.37)
    channel.crafts.remove(leader)
    channel.craft(LEADER, session=77, offset_s=2000.0)
    one.heard.clear()
    channel.fly(6.0)
    assert one.heard[-1][0] > 2000.0
    assert one.peer_clock is not None
    assert one.peer_clock.offset_s == pytest.approx(1950.0, abs=0.005)


def test_what_is_lost_is_not_sent_again_and_the_beat_goes_on() -> None:
    lossy = RadioQuality(channel=CHANNEL, loss=0.3, burst_share=0.2, burst_s=2.0)
    channel, _, one, other = formation(lossy)
    channel.fly(300.0)
    assert channel.air.counters["in collisions"] <= 2
    share = len(one.heard) / 3000
    # 0.7 of 0.8, less what the first seconds take.
    assert 0.45 < share < 0.65
    assert other.counters[f"refused: {DAMAGED}"] > 50
    assert one.counters["failed to use"] == 0


def test_packets_that_meet_on_the_air_are_lost_and_the_next_ones_are_heard() -> None:
    channel, _, one, _ = formation()
    channel.fly(5.0)
    heard = len(one.heard)
    jammer = Random(4)
    for _ in range(40):
        channel.air.transmit(jammer.randbytes(50))
        channel.fly(0.05)
    assert channel.air.counters["in collisions"] > 20
    during = len(one.heard) - heard
    assert during < 20
    channel.fly(2.0)
    assert len(one.heard) - heard - during > 15


def test_a_recording_of_another_session_is_refused_and_one_of_this_session_was_heard_before() -> (
    None
):
    """Both flights in one place with the same keys and clocks; the recording begins later in its flight."""
    before, *_ = formation()
    before.fly(30.0)
    yesterday = before.record()
    before.fly(2.0)
    channel = Shared()
    leader = channel.craft(LEADER, session=11, offset_s=1000.0)
    one = channel.craft("f1", session=12, offset_s=50.0)
    other = channel.craft("f2", session=13, offset_s=7.0)
    today = channel.record()
    channel.fly(10.0)
    recorded = list(today)
    channel.fly(0.2)
    channel.gone(leader)
    channel.gone(other)
    one.heard.clear()
    one.neighbours.clear()
    for frame in yesterday + recorded:
        channel.air.transmit(frame)
        channel.air.run(channel.air.now + 0.05)
    assert not one.heard
    assert not one.neighbours
    assert one.counters["refused: another session or forged"] > 20
    assert one.counters["copies"] > 100


def test_a_follower_that_has_just_started_believes_no_recording_and_no_leader_unasked() -> None:
    before, *_ = formation()
    yesterday = before.record()
    before.fly(5.0)
    channel = Shared()
    one = channel.craft("f1", session=12)
    for frame in yesterday:
        channel.air.transmit(frame)
        channel.fly(0.05)
    assert not one.heard
    assert not one.neighbours
    assert not one.member.trust.proven


def test_two_formations_on_one_channel_never_hear_each_other() -> None:
    """Not even with the same radio key: its name is in the key of each."""
    channel, _, one, _ = formation()
    channel.fly(1.013)
    channel.craft(LEADER, session=21, formation="line", offset_s=5000.0)
    stranger = channel.craft("f1", session=22, formation="line", offset_s=4000.0)
    channel.fly(30.0)
    assert "another formation" in one.refused
    assert "another formation" in stranger.refused
    assert all(time_s < 2000.0 for time_s, _ in one.heard)
    assert all(time_s > 2000.0 for time_s, _ in stranger.heard)
    assert one.heard


@pytest.mark.parametrize(
    ("difference", "reason"),
    [
        ({"key": bytes(32)}, "another session or forged"),
        ({"vehicles": (LEADER, "f2", "f1")}, "another session or forged"),
        ({"vehicles": (LEADER, "f1", "f2", "f3")}, "another number of vehicles"),
    ],
    ids=["another key", "another order", "another mission"],
)
def test_who_disagrees_about_the_formation_hears_nothing_of_it(
    difference: dict[str, object], reason: str
) -> None:
    channel = Shared()
    channel.craft(LEADER, session=1)
    one = channel.craft("f1", session=2, **difference)
    channel.fly(10.0)
    assert not one.heard
    assert not one.member.trust.proven
    assert reason in one.refused


def test_another_companion_of_ones_name_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """Heard by a twin that is under the same leader's session, from another place."""
    channel, _, one, _ = formation()
    channel.fly(5.0)
    elsewhere, *_ = formation()
    frames = elsewhere.record()
    elsewhere.fly(9.0)
    one.station.hear(last_of(frames, sender=1), one.member.clock())
    assert "another companion of this name" in one.refused
    assert "a companion calls itself 'f1', too" in caplog.text


def ordering(quality: RadioQuality | None = None) -> tuple[Shared, Craft, list[Craft]]:
    """A formation that flies, and an operator who has joined it late."""
    channel, *vehicles = formation(quality)
    channel.fly(5.0)
    operator = channel.craft("eye", session=9, orders=True, offset_s=333.0)
    channel.fly(4.0)
    assert operator.peer_clock is not None
    assert operator.peer_clock.offset_s == pytest.approx(667.0, abs=0.002)
    return channel, operator, vehicles


def insist(channel: Shared, operator: Craft, body: bytes, seconds: float) -> None:
    """Give an order again and again, as operators do, for some seconds."""
    for _ in range(round(2 * seconds)):
        operator.member.say(Kind.ORDER, body)
        channel.fly(0.5)


def test_an_operator_joins_late_and_its_order_is_heard_by_all_and_answered() -> None:
    """300 bytes and an envelope of 111: 15 pieces, of which an operator says 12.5 in a second."""
    channel, operator, vehicles = ordering()
    body = Random(3).randbytes(300)
    insist(channel, operator, body, 3.0)
    for one in vehicles:
        assert one.orders[0] == (body, False)
        # Said on and on, in one envelope: once is enough.
        assert len(one.orders) == 1
        one.member.say(Kind.REPLY, encode_reply(Reply(number=7, verdict=Verdict.READY, check=9)))
    channel.fly(3.0)
    for hearer in (operator, *vehicles):
        said = {(name, decode_reply(data).number) for name, data in hearer.replies}
        assert said == {(one.name, 7) for one in vehicles if one is not hearer}
    assert channel.air.counters["in collisions"] == 0
    assert not operator.presences or set(operator.presences) <= set(NAMES)
    # States go on meanwhile, every second turn at least.
    assert all(one.counters["refused: not for its sender to say"] == 0 for one in vehicles)


def test_lost_pieces_of_an_order_are_heard_in_a_later_round() -> None:
    channel, operator, vehicles = ordering(RadioQuality(channel=CHANNEL, loss=0.3))
    body = Random(3).randbytes(300)
    insist(channel, operator, body, 2.0)
    assert not all(one.orders for one in vehicles)
    insist(channel, operator, body, 20.0)
    assert all(one.orders == [(body, False)] for one in vehicles)


def test_an_order_whose_last_piece_never_comes_is_heard_by_nobody() -> None:
    channel, operator, vehicles = ordering()
    operator.member.say(Kind.ORDER, Random(3).randbytes(300))
    # Fifteen pieces at five turns in each cycle of 0.4 s take 1.2 s; the operator falls silent before.
    channel.fly(0.8)
    channel.gone(operator)
    channel.fly(5.0)
    assert not any(one.orders for one in vehicles)
    partial = [part for one in vehicles for part in one.station._ordered]  # noqa: SLF001
    assert len(partial) == 3
    assert all(1 < len(part.parts) < 15 for part in partial)


def test_a_vehicle_repeats_an_order_as_its_operator_has_signed_it() -> None:
    channel, operator, (_, one, other) = ordering()
    insist(channel, operator, b"an order", 2.0)
    channel.gone(operator)
    channel.fly(3.0)
    other.orders.clear()
    one.member.say(Kind.REPEAT, one.sealed)
    channel.fly(8.0)
    assert other.orders
    assert set(other.orders) == {(b"an order", True)}
    changed = bytes([*one.sealed[:-1], one.sealed[-1] ^ 1])
    other.orders.clear()
    one.member.say(Kind.REPEAT, changed)
    channel.fly(8.0)
    assert not other.orders
    assert other.counters["refused: a forged order"] > 0


def test_whoever_has_the_radio_key_alone_cannot_order() -> None:
    """The tags of the pieces are right, the signature is that of a vehicle."""
    channel, operator, vehicles = ordering()
    operator.member.trust._key = KEYS["f2"]  # noqa: SLF001 - as one who has stolen the radio key
    insist(channel, operator, b"an order", 4.0)
    assert not any(one.orders for one in vehicles)
    assert all(one.counters["refused: forged"] > 0 for one in vehicles)


def test_an_order_that_is_too_long_for_a_radio_is_counted_and_not_sent() -> None:
    channel, operator, vehicles = ordering()
    insist(channel, operator, bytes(700), 2.0)
    assert operator.counters["radio: too long for its pieces"] == 4
    assert not any(one.orders for one in vehicles)


def test_the_younger_of_two_companions_of_one_name_is_silent_until_the_other_is_gone(
    caplog: pytest.LogCaptureFixture,
) -> None:
    channel, leader, one, _ = formation()
    channel.fly(8.0)
    twin = channel.craft("f1", session=44, offset_s=9.0)
    heard = len(leader.neighbours)
    channel.fly(6.0)
    assert "a companion calls itself 'f1', too" in caplog.text
    assert not twin.member.trust.proven
    assert channel.air.counters["in collisions"] == 0
    assert len(leader.neighbours) > heard + 6 * 2 * 2.5 * 0.6
    channel.gone(one)
    channel.fly(8.0)
    assert twin.member.trust.proven
    assert leader.neighbours[-1][1] > 0.0


@pytest.mark.parametrize("seed", range(4))
def test_the_younger_of_two_companions_of_the_leader_falls_silent_on_the_radio(seed: int) -> None:
    channel, leader, one, _ = formation()
    channel.fly(12.0 + 0.0371 * seed)
    rival = channel.craft(LEADER, session=44 + seed, offset_s=9.0, listens_first=True)
    channel.fly(6.0)
    assert rival.member.stands_back
    assert not leader.member.stands_back
    assert not [time_s for time_s, _ in one.heard if time_s < 1000.0]
    heard = len(one.heard)
    channel.fly(20.0)
    assert rival.member.stands_back
    # What it still says are questions, one in 1.5 s, in the turn of the leader's answers and presences.
    assert len(one.heard) > heard + 20.0 * 10.0 * 0.98
    channel.gone(leader)
    channel.fly(14.0)
    assert not rival.member.stands_back
    assert one.heard[-1][1] > channel.air.now - 1.0


def test_a_leader_that_starts_listens_for_two_cycles_before_it_speaks() -> None:
    """Of 0.4 s each."""
    channel = Shared()
    channel.craft(LEADER, session=1, listens_first=True)
    one = channel.craft("f1", session=2)
    channel.fly(0.75)
    assert not one.refused
    channel.fly(0.2)
    assert "another session or forged" in one.refused


def test_a_recording_keeps_a_leader_that_starts_silent_for_five_seconds_at_most() -> None:
    """Its beats are right but for the session, and none of them answers."""
    yesterday, *_ = formation()
    yesterday.fly(3.0)
    frames = yesterday.record()
    yesterday.fly(8.0)
    channel = Shared()
    leader = channel.craft(LEADER, session=31, offset_s=5.0, listens_first=True)
    one = channel.craft("f1", session=32)
    for frame in frames:
        channel.air.transmit(frame)
        channel.fly(0.05)
        if channel.air.now > 9.0:
            break
    assert not leader.member.stands_back
    # The follower, too, has heard its own name, and lets the other one speak for a while.
    channel.fly(8.0)
    assert one.member.trust.proven


def test_a_recording_of_this_very_run_makes_no_leader_step_back_on_a_radio() -> None:
    """Packets of another day have it ask, and its own questions and answers are played to it later."""
    yesterday = Shared()
    yesterday.craft(LEADER, session=90)
    foreign = yesterday.record()
    yesterday.fly(6.0)
    channel, leader, *_ = formation()
    frames = channel.record()
    channel.fly(5.0)
    for number in range(240):
        channel.air.transmit(foreign[number % len(foreign)])
        channel.fly(0.1)
        # What was sent longer ago than own packets are remembered, the newest last.
        for frame in frames[-200:-90][number % 10 :: 10]:
            leader.station.hear(frame, leader.member.clock())
    assert "another session or forged" in leader.refused
    asked = [kind for frame in frames for kind in packets_of([frame])]
    assert PackedKind.QUESTION in asked
    assert not leader.member.stands_back


def test_own_packets_that_a_radio_sends_back_are_passed_over() -> None:
    channel, leader, _, _ = formation()
    frames = channel.record()
    channel.fly(3.0)
    assert not leader.station.hear(last_of(frames, sender=0), leader.member.clock())
    assert leader.counters["own packets heard"] == 1
    assert not leader.refused


def test_who_watches_hears_presences_and_is_silent() -> None:
    channel, *_ = formation()
    watcher = channel.craft("eye", session=8, watches=True)
    channel.fly(10.0)
    assert set(watcher.presences) == set(NAMES)
    assert watcher.presences["f1"].mode == "tracking"
    assert watcher.station.next_turn(channel.air.now) is None


def test_who_watches_is_told_nothing_by_a_repeated_presence() -> None:
    channel, _, one, _ = formation()
    watcher = channel.craft("eye", session=8, watches=True)
    frames = channel.record()
    channel.fly(10.0)
    kept = dict(watcher.presences)
    said = [frame for frame in frames if packets_of([frame]) == [PackedKind.PRESENCE]]
    for frame in said[:-2]:
        watcher.station.hear(frame, channel.air.now)
    assert watcher.presences == kept
    assert watcher.counters["copies"] == len(said[:-2]) > 3
    assert one.member.trust.proven


def test_a_formation_of_twelve_takes_half_of_4000_bytes_a_second() -> None:
    channel = Shared()
    names = (LEADER, *(f"v{number:02}" for number in range(11)))
    for session, name in enumerate(names, start=1):
        channel.craft(name, session=session, formation="dozen", vehicles=names)
    channel.fly(10.0)
    channel.air.counters.clear()
    for one in channel.crafts:
        one.heard.clear()
    channel.fly(20.0)
    assert channel.air.counters["bytes"] / 20.0 < 2100.0
    assert channel.air.counters["in collisions"] == 0
    assert all(len(one.heard) >= 199 for one in channel.crafts[1:])


def test_a_hundred_thousand_hostile_packets_raise_nothing_and_are_counted_by_reason() -> None:
    """Noise, cut, changed, repeated, of another formation and another session, and beats at will."""
    channel, _, one, _ = formation()
    frames = channel.record()
    channel.fly(10.0)
    frames = frames[:-5]  # what is still on its way was not heard before
    stranger, *_ = formation()
    others = stranger.record()
    stranger.fly(3.0)
    random, framer = Random(5), Framer(Counter())
    real = [framer.feed(frame)[0] for frame in frames]
    foreign = [framer.feed(frame)[0] for frame in others]
    changed_mark = [one_[:1] + b"\xee\xee" + one_[3:] for one_ in real]

    def changed(packet: bytes) -> bytes:
        data = bytearray(packet)
        data[random.randrange(len(data))] ^= random.randrange(1, 256)
        return bytes(data)

    one.heard.clear()
    one.neighbours.clear()
    clock_s = one.member.clock()
    offset_s = one.peer_clock.offset_s if one.peer_clock is not None else 0.0
    for number in range(100_000):
        now = clock_s + number * 1e-3
        match number % 6:
            case 0:
                data = random.randbytes(random.randrange(1, 120))
            case 1:
                frame = random.choice(frames)
                data = frame[: random.randrange(len(frame))]
            case 2:
                data = encode_frame(changed(random.choice(real)))
            case 3:
                data = encode_frame(random.choice(real))
            case 4:
                data = encode_frame(random.choice(changed_mark))
            case _:
                data = encode_frame(random.choice(foreign))
        one.station.hear(data, now)
    assert not one.heard
    assert not one.neighbours
    assert one.peer_clock is not None
    assert one.peer_clock.offset_s == offset_s
    assert one.counters["failed to use"] == 0
    for reason in (DAMAGED, "malformed", "another formation", "another session or forged"):
        assert one.counters[f"refused: {reason}"] > 100, reason
    assert one.counters["copies"] > 10_000
    station = one.station
    assert len(station._trust._newest) <= 15  # noqa: SLF001 - nothing grows with what comes
    assert len(station._questions._open) <= 8  # noqa: SLF001
    assert len(one.counters) < 25
    # And the formation is heard again once it is over.
    channel.fly(3.0)
    assert one.heard


@pytest.mark.parametrize(("beats", "period_ms"), [(255, 65_000), (1, 65_000), (1, 8_000)])
def test_one_forged_slow_beat_does_not_silence_a_member_that_starts(
    beats: int, period_ms: int
) -> None:
    channel = Shared()
    info = BeatInfo(beat=0, beats=beats, members=len(NAMES), period_ms=period_ms)
    forged = encode_packet(
        PackedKind.BEAT,
        formation=formation_mark(FORMATION),
        sender=0,
        ticks=0,
        body=encode_beat_alone(info),
    )
    one = channel.craft("f1", session=12)
    channel.air.transmit(encode_frame(forged + bytes(8)))
    channel.fly(0.5)
    channel.craft(LEADER, session=11)
    channel.craft("f2", session=13)
    channel.fly(10.0)
    # Ten states a second, from when the leader's answer has come.
    assert len(one.heard) > 50
