"""Members that share a radio, in virtual time: what they hear, and what hostile packets come to."""

from collections import Counter
from random import Random

import pytest
from msgspec.structs import replace

from tests.kit.link import FORMATION, LEADER
from tests.kit.radio import state_at
from tests.unit.link.radio_crafts import (
    CHANNEL,
    KEY,
    NAMES,
    STEP_S,
    Shared,
    formation,
    last_of,
    packets_of,
    together,
)
from vfguide.lab.rehearsal.emulated_radio import RadioQuality
from vfguide.link.codec import decode
from vfguide.link.packed import (
    BEAT_ALONE,
    BeatInfo,
    PackedKind,
    encode_beat,
    encode_motion,
    encode_packet,
    formation_key,
    formation_mark,
    tag_of,
    ticks_of,
)
from vfguide.link.radio_schedule import DAMAGED, Framer, Timetable, encode_frame


def test_a_formation_hears_itself_without_a_collision_and_knows_the_leaders_clock():
    channel, leader, one, other = formation(20.0)
    # Ten states a second of the leader; 2.5 of each follower, less what questions and presences take.
    assert len(one.heard) > 10 * 18
    assert len([1 for vehicle, _ in other.neighbours if vehicle == "f1"]) > 2.5 * 20 * 0.6
    assert {vehicle for vehicle, _ in leader.neighbours} == {"f1", "f2"}
    assert channel.air.counters["in collisions"] == 0
    assert one.refused <= {"another session or forged"}
    # Though questions wait for their turns, to a millisecond and what the clocks run apart.
    for craft, offset_s in ((one, 950.0), (other, 993.0)):
        assert craft.peer_clock.offset_s == pytest.approx(offset_s, abs=0.001 + 20.0 * 50e-6)


def test_states_are_the_newest_there_were_when_their_turn_came():
    """On the way for 56 bytes twice over the line and once over the air; made every 50 ms."""
    channel, _, one, _ = formation(10.0)
    ages = [arrived + 1000.0 - time_s for time_s, arrived in one.heard]
    assert max(ages) < CHANNEL.latency_s(56) + STEP_S + 1e-3
    # What gave way to a newer one was not sent: half of the leader's 200.
    assert 90 <= channel.crafts[0].counters["radio: replaced before its turn"] <= 110


def test_a_state_that_has_waited_for_a_second_is_not_sent():
    _, leader = together(LEADER)
    station = leader.station
    for waited_s, kind in ((0.9, PackedKind.STATE), (1.1, PackedKind.BEAT)):
        leader.member.publish(state_at(0.0))
        turn = station.next_turn(waited_s)
        frame = station.speak(replace(turn, at_s=waited_s, beat=1), waited_s)
        assert packets_of([frame]) == [kind]
    assert leader.counters["radio: too old for its turn"] == 1


def test_a_turn_that_comes_too_late_is_let_go():
    """The processor was elsewhere: a slot of 33.3 ms less the 16.6 ms that a packet may take."""
    _, leader = together(LEADER)
    turn = leader.station.next_turn(0.0)
    assert leader.station.speak(turn, turn.at_s + 0.0165)
    assert not leader.station.speak(turn, turn.at_s + 0.0168)
    assert leader.counters["radio: late for its turn"] == 1


def test_the_leader_alone_gives_the_beat_and_a_follower_alone_is_silent():
    channel, _ = together(LEADER)
    taken = channel.record()
    channel.fly(1.95)
    # 20 beats, and a presence in the answer's turn.
    assert Counter(packets_of(taken)) == {PackedKind.STATE: 20, PackedKind.PRESENCE: 1}
    alone, _ = together("f1")
    taken = alone.record()
    alone.fly(20.0)
    assert not taken


def test_a_leader_without_telemetry_still_gives_the_beat_and_its_clock():
    channel, leader, one, _ = formation()
    leader.publishes = False
    channel.fly(5.0)
    assert one.peer_clock.ready
    assert not one.heard


def test_a_late_joiner_asks_in_its_turn_and_disturbs_nobody():
    channel, *_ = together(LEADER, "f1")
    channel.fly(10.0)
    late = channel.craft("f2", session=3, offset_s=3.0)
    channel.fly(3.0)
    assert late.heard
    assert late.neighbours
    assert channel.air.counters["in collisions"] == 0


def test_a_late_joiner_need_not_wait_until_others_have_asked_enough():
    """Another one asks in every second turn, and is answered every 0.8 s: what the late one hears first."""
    channel, leader, asker = together(LEADER, "f1")
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


def test_followers_go_on_in_their_turns_while_the_leader_is_silent():
    """For ten minutes, on clocks that run apart by 60 ms in that time: more than a slot."""
    channel, leader, one, other = formation(5.0)
    channel.gone(leader)
    one.neighbours.clear()
    channel.fly(600.0)
    assert channel.air.counters["in collisions"] == 0
    assert len(one.neighbours) > 2.5 * 600 * 0.6
    assert {vehicle for vehicle, _ in other.neighbours} >= {"f1"}


def test_a_leader_that_starts_anew_is_believed_once_it_has_answered():
    channel, leader, one, _ = formation(5.0)
    channel.gone(leader)
    channel.fly(1.37)
    channel.crafts.remove(leader)
    channel.craft(LEADER, session=77, offset_s=2000.0)
    one.heard.clear()
    channel.fly(6.0)
    assert one.heard[-1][0] > 2000.0
    assert one.peer_clock.offset_s == pytest.approx(1950.0, abs=0.005)


def test_what_is_lost_is_not_sent_again_and_the_beat_goes_on():
    lossy = RadioQuality(channel=CHANNEL, loss=0.3, burst_share=0.2, burst_s=2.0)
    channel, _, one, other = formation(300.0, lossy)
    assert channel.air.counters["in collisions"] <= 2
    share = len(one.heard) / 3000
    # 0.7 of 0.8, less what the first seconds take.
    assert 0.45 < share < 0.65
    assert other.counters[f"refused: {DAMAGED}"] > 50
    assert one.counters["failed to use"] == 0


def test_packets_that_meet_on_the_air_are_lost_and_the_next_ones_are_heard():
    channel, _, one, _ = formation(5.0)
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


def test_two_formations_on_one_channel_never_hear_each_other():
    """Not even with the same radio key: its name is in the key of each."""
    channel, _, one, _ = formation(1.013)
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
def test_who_disagrees_about_the_formation_hears_nothing_of_it(difference, reason):
    channel, _ = together(LEADER)
    one = channel.craft("f1", session=2, **difference)
    channel.fly(10.0)
    assert not one.heard
    assert not one.member.trust.proven
    assert reason in one.refused


def test_a_leader_that_starts_listens_for_two_cycles_before_it_speaks():
    """Of 0.4 s each."""
    channel = Shared()
    channel.craft(LEADER, session=1, listens_first=True)
    one = channel.craft("f1", session=2)
    channel.fly(0.75)
    assert not one.refused
    channel.fly(0.2)
    assert "another session or forged" in one.refused


def test_who_watches_hears_presences_is_silent_and_is_told_nothing_by_a_repeated_one():
    channel, _, one, _ = formation()
    watcher = channel.craft("eye", session=8, watches=True)
    frames = channel.record()
    channel.fly(10.0)
    kept = dict(watcher.presences)
    assert set(kept) == set(NAMES)
    assert kept["f1"].mode == "tracking"
    assert watcher.station.next_turn(channel.air.now) is None
    said = [frame for frame in frames if packets_of([frame]) == [PackedKind.PRESENCE]]
    for frame in said[:-2]:
        watcher.station.hear(frame, channel.air.now)
    assert watcher.presences == kept
    assert watcher.counters["copies"] == len(said[:-2]) > 3
    assert one.member.trust.proven


def test_a_formation_of_twelve_takes_half_of_4000_bytes_a_second():
    names = (LEADER, *(f"v{number:02}" for number in range(11)))
    channel, *_ = together(*names, formation="dozen", vehicles=names)
    channel.fly(10.0)
    channel.air.counters.clear()
    for one in channel.crafts:
        one.heard.clear()
    channel.fly(20.0)
    assert channel.air.counters["bytes"] / 20.0 < 2100.0
    assert channel.air.counters["in collisions"] == 0
    assert all(len(one.heard) >= 199 for one in channel.crafts[1:])


def test_a_recording_of_another_session_is_refused_and_one_of_this_session_was_heard_before():
    """Both flights in one place with the same keys and clocks; the recording begins later in its flight."""
    before, *_ = formation(30.0)
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


def test_a_follower_that_has_just_started_believes_no_recording_and_no_leader_unasked():
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


def test_another_companion_of_ones_name_is_told(caplog):
    """Heard by a twin that is under the same leader's session, from another place."""
    _, _, one, _ = formation(5.0)
    elsewhere, *_ = formation()
    frames = elsewhere.record()
    elsewhere.fly(9.0)
    one.station.hear(last_of(frames, sender=1), one.member.clock())
    assert "another companion of this name" in one.refused
    assert "a companion calls itself 'f1', too" in caplog.text


def test_the_younger_of_two_companions_of_one_name_is_silent_until_the_other_is_gone(caplog):
    channel, leader, one, _ = formation(8.0)
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
def test_the_younger_of_two_companions_of_the_leader_falls_silent_on_the_radio(seed):
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


def test_a_recording_keeps_a_leader_that_starts_silent_for_five_seconds_at_most():
    """Its beats are right but for the session, and none of them answers."""
    yesterday, *_ = formation(3.0)
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


def test_a_recording_of_this_very_run_makes_no_leader_step_back_on_a_radio():
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


def test_own_packets_that_a_radio_sends_back_are_passed_over():
    channel, leader, _, _ = formation()
    frames = channel.record()
    channel.fly(3.0)
    assert not leader.station.hear(last_of(frames, sender=0), leader.member.clock())
    assert leader.counters["own packets heard"] == 1
    assert not leader.refused


def test_a_hundred_thousand_hostile_packets_raise_nothing_and_are_counted_by_reason():
    """Noise, cut, changed, repeated, of another formation and another session, and beats at will."""
    channel, _, one, _ = formation()
    frames = channel.record()
    channel.fly(10.0)
    stranger, *_ = formation()
    others = stranger.record()
    stranger.fly(3.0)
    # What is still on its way was not heard before.
    frames, random, framer = frames[:-5], Random(5), Framer(Counter())
    real, foreign = ([framer.feed(frame)[0] for frame in said] for said in (frames, others))

    def changed(packet: bytes) -> bytes:
        data = bytearray(packet)
        data[random.randrange(len(data))] ^= random.randrange(1, 256)
        return bytes(data)

    def elsewhere(packet: bytes) -> bytes:
        return packet[:1] + b"\xee\xee" + packet[3:]

    kinds = (
        lambda: random.randbytes(random.randrange(1, 120)),
        lambda: random.choice(frames)[: random.randrange(40)],
        *(
            lambda: encode_frame(changed(random.choice(real))),
            lambda: encode_frame(random.choice(real)),
        ),
        lambda: encode_frame(elsewhere(random.choice(real))),
        lambda: encode_frame(random.choice(foreign)),
    )
    one.heard.clear()
    one.neighbours.clear()
    clock_s, offset_s = one.member.clock(), one.peer_clock.offset_s
    for number in range(100_000):
        one.station.hear(kinds[number % 6](), clock_s + number * 1e-3)
    assert not one.heard
    assert not one.neighbours
    assert one.peer_clock.offset_s == offset_s
    assert one.counters["failed to use"] == 0
    for reason in (DAMAGED, "malformed", "another formation", "another session or forged"):
        assert one.counters[f"refused: {reason}"] > 100, reason
    assert one.counters["copies"] > 10_000
    station = one.station
    trust = one.member.trust
    known = len(trust._heard) + len(trust._asked)  # noqa: SLF001 - nothing grows with what comes
    assert known <= 6
    assert len(station._questions._open) <= 8  # noqa: SLF001
    assert len(one.counters) < 25
    # And the formation is heard again once it is over.
    channel.fly(3.0)
    assert one.heard


@pytest.mark.parametrize("ahead_s", [3.0, 1e6])
def test_who_has_the_radio_key_does_not_make_a_vehicle_a_copy_of_itself(ahead_s):
    """By a state of a later time, after which none of now would be newer."""
    channel, _, _, other = formation(6.0)
    key = formation_key(KEY, FORMATION, NAMES)
    state = decode(state_at(1.0))
    packet = encode_packet(
        PackedKind.STATE,
        formation=formation_mark(FORMATION),
        sender=1,
        ticks=ticks_of(other.member.formation_time() + ahead_s),
        body=encode_motion(state),
    )
    frame = encode_frame(packet + tag_of(key, 1, packet))
    other.station.hear(frame, other.member.clock())
    assert "of a time to come" in other.refused
    other.neighbours.clear()
    channel.fly(2.0)
    assert "f1" in {name for name, _ in other.neighbours}


@pytest.mark.parametrize(("beats", "period_ms"), [(255, 65_000), (1, 65_000), (1, 8_000)])
def test_one_forged_slow_beat_does_not_silence_a_member_that_starts(beats, period_ms):
    channel = Shared()
    table = Timetable(members=len(NAMES), beats=beats, period_ms=period_ms)
    forged = encode_packet(
        PackedKind.BEAT,
        formation=formation_mark(FORMATION),
        sender=0,
        ticks=0,
        body=encode_beat(BeatInfo(0, table), BEAT_ALONE),
    )
    one = channel.craft("f1", session=12)
    channel.air.transmit(encode_frame(forged + bytes(8)))
    channel.fly(0.5)
    channel.craft(LEADER, session=11)
    channel.craft("f2", session=13)
    channel.fly(10.0)
    # Ten states a second, from when the leader's answer has come.
    assert len(one.heard) > 50
