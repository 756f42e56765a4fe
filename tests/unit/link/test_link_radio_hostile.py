"""Recordings, companions of one name, forged and damaged packets on a shared radio."""

from collections import Counter
from random import Random

import pytest

from tests.kit.link import FORMATION, LEADER
from tests.unit.link.radio_crafts import NAMES, Shared, formation, last_of, packets_of
from vfguide.link.packed import (
    BeatInfo,
    PackedKind,
    encode_beat_alone,
    encode_packet,
    formation_mark,
)
from vfguide.link.radio_schedule import DAMAGED, Framer, encode_frame


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
    offset_s = one.peer_clock.offset_s
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
def test_one_forged_slow_beat_does_not_silence_a_member_that_starts(beats, period_ms):
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
