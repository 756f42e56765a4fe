"""Packets on a stream of bytes that is cut and damaged, and who may speak when."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.wire import cut
from vfguide.errors import InputError
from vfguide.link.radio_schedule import (
    HANDOVER_S,
    LARGEST_FRAME,
    LARGEST_PACKET,
    LEADER,
    OPERATOR,
    OVERHEAD,
    Beat,
    Channel,
    Framer,
    Timetable,
    Turn,
    decode_frame,
    encode_frame,
    make_timetable,
    stuffed,
    unstuffed,
)

PACKETS = st.binary(min_size=1, max_size=LARGEST_PACKET)
DAMAGED = "refused: damaged on the air"


def test_zeros_are_stuffed_as_cheshire_and_baker_have_it():
    assert stuffed(bytes([0x11, 0x22, 0x00, 0x33])) == bytes([0x03, 0x11, 0x22, 0x02, 0x33])
    assert stuffed(bytes([0x00])) == bytes([0x01, 0x01])


@given(PACKETS)
def test_a_packet_has_no_zero_inside_and_comes_out_as_it_went_in(packet):
    frame = encode_frame(packet)
    assert len(frame) == len(packet) + OVERHEAD <= LARGEST_FRAME
    assert frame[0] == frame[-1] == 0
    assert 0 not in frame[1:-1]
    assert decode_frame(frame[1:-1]) == packet


@given(st.binary(max_size=200))
def test_whatever_comes_is_unstuffed_or_refused(data):
    content = unstuffed(data)
    assert content is None or len(content) < len(data)


@given(st.lists(PACKETS, max_size=6), st.lists(st.integers(0, 10**6), max_size=12))
def test_a_stream_may_be_cut_anywhere(packets, places):
    counters = Counter[str]()
    framer = Framer(counters)
    stream = b"".join(encode_frame(packet) for packet in packets)
    assert [packet for part in cut(stream, places) for packet in framer.feed(part)] == packets
    assert not counters


@given(st.binary(max_size=300), st.lists(st.integers(0, 10**6), max_size=6), PACKETS)
def test_noise_before_a_packet_does_not_hide_it(noise, places, packet):
    framer = Framer(Counter())
    for part in cut(noise, places):
        framer.feed(part)
    assert framer.feed(encode_frame(packet))[-1] == packet


@given(PACKETS, PACKETS, st.integers(0, 10**6), st.integers(1, 255))
def test_a_damaged_byte_costs_one_packet(first, second, place, flip):
    framer = Framer(Counter())
    damaged = bytearray(encode_frame(first))
    damaged[place % len(damaged)] ^= flip
    assert framer.feed(bytes(damaged) + encode_frame(second))[-1] == second


def test_noise_without_a_zero_does_not_grow_anything():
    counters = Counter[str]()
    framer = Framer(counters)
    for _ in range(10_000):
        assert not framer.feed(b"\x55" * 100)
    assert len(framer._buffer) <= LARGEST_FRAME  # noqa: SLF001 - what it holds
    assert framer.feed(encode_frame(b"good")) == [b"good"]
    assert counters == {DAMAGED: 1}


CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)
TWELVE = Timetable(members=12, beats=4, period_ms=100)


def turns(one: Beat, begins_s: float, count: int) -> list[Turn]:
    """Turns, one after the other, each taken."""
    found, now = [], begins_s
    for _ in range(count):
        turn = one.next_turn(now)
        assert turn is not None
        one.spoken(turn)
        found.append(turn)
        now = turn.at_s
    return found


def test_twelve_at_10_and_2_5_hz_have_slots_of_20_ms():
    """11 followers, an answer and 2 turns of an operator in 4 beats: 4 after each; 100 ms / 5."""
    table = make_timetable(12, leader_hz=10.0, followers_hz=2.5, channel=CHANNEL)
    assert table == TWELVE
    assert (table.slots, table.slot_s, table.cycle_s) == (5, 0.02, 0.4)
    offsets = [table.offset_s(number) for number in (1, 2, 4, 5, 11, 12)]
    assert offsets == pytest.approx([0.02, 0.12, 0.32, 0.04, 0.26, 0.36])


def test_the_way_of_a_packet_is_two_lines_and_the_air():
    """50 bytes: twice 500 bits at 57600, and 50 / 4000 s."""
    assert CHANNEL.latency_s(50) == pytest.approx(2 * 500 / 57_600 + 0.0125)


@pytest.mark.parametrize(
    ("members", "leader_hz", "followers_hz"), [(17, 20.0, 2.5), (40, 10.0, 2.5), (4, 50.0, 50.0)]
)
def test_what_does_not_fit_is_one_line(members, leader_hz, followers_hz):
    with pytest.raises(InputError, match="do not fit 4000 bytes a second at 57600 baud; write"):
        make_timetable(members, leader_hz=leader_hz, followers_hz=followers_hz, channel=CHANNEL)


@given(st.integers(1, 60), st.floats(0.5, 30.0), st.floats(0.1, 30.0))
def test_no_two_turns_of_a_timetable_meet(members, leader_hz, followers_hz):
    try:
        table = make_timetable(
            members, leader_hz=leader_hz, followers_hz=followers_hz, channel=CHANNEL
        )
    except InputError:
        return
    places = [number * table.period_s for number in range(table.beats)]
    places += [table.offset_s(number) for number in range(1, members + 1)]
    places += [table.offset_s(number) for number in table.operator_turns]
    assert len(table.operator_turns) >= table.beats / 2
    ordered = sorted(places)
    ends = [*ordered[1:], table.cycle_s]
    assert all(b - a >= table.slot_s - 1e-9 for a, b in zip(ordered, ends, strict=True))


def test_the_leader_has_each_beat_and_one_turn_more_in_a_cycle_and_nobody_speaks_before_it():
    assert Beat(3).next_turn(5.0) is None
    assert Beat(None).next_turn(5.0) is None
    one = Beat(LEADER)
    one.begin(TWELVE, 7.0)
    found = turns(one, 7.0, 6)
    assert [turn.at_s for turn in found] == pytest.approx([7.0, 7.1, 7.2, 7.3, 7.36, 7.4])
    assert [turn.beat for turn in found] == [0, 1, 2, 3, None, 0]


@pytest.mark.parametrize(
    ("number", "heard", "from_s", "turns_s"),
    [
        # 16 places behind the beats, 12 of them of 11 followers and the answer: the last of each beat.
        (OPERATOR, (0, 7.0), 7.0, [7.08, 7.18, 7.28, 7.38, 7.48]),
        # Beat 2 began at 7.2 on its clock: the cycle at 7.0, and follower 5 has its second slot.
        (5, (2, 7.2), 7.2, [7.44, 7.84, 8.24]),
        # A missed beat moves no turn.
        (5, (2, 7.2), 100.0, [100.24]),
    ],
)
def test_turns_count_from_the_beat_that_was_heard(number, heard, from_s, turns_s):
    one = Beat(number)
    one.hear_leader(heard[0], TWELVE, heard[1])
    found = turns(one, from_s, len(turns_s))
    assert [turn.at_s for turn in found] == pytest.approx(turns_s)


@pytest.mark.parametrize(
    ("number", "heard"),
    [
        # A beat that comes late moves turns by a tenth, and one that comes early wholly.
        (5, [(7.0, 100, 7.0, 7.04), (7.408, 100, 7.408, 7.4408), (7.79, 100, 7.79, 7.83)]),
        # A turn that a later beat moves is not taken twice.
        (1, [(7.0, 100, 7.0, 7.02), (7.01, 100, 7.021, 7.421)]),
        # A leader that starts anew is followed at once: five slots of 40 ms in each beat of 200 ms.
        (5, [(7.0, 100, 7.0, 7.04), (7.2, 100, 7.2, 7.24), (8.0, 200, 8.0, 8.08)]),
    ],
)
def test_a_later_beat_moves_the_turns(number, heard):
    one = Beat(number)
    for begins_s, period_ms, from_s, turn_s in heard:
        one.hear_leader(0, replace(TWELVE, period_ms=period_ms), begins_s)
        assert turns(one, from_s, 1)[0].at_s == pytest.approx(turn_s)


def test_without_the_leader_the_follower_of_the_least_number_keeps_the_beat():
    third, fifth = Beat(3), Beat(5)
    for one in (third, fifth):
        one.hear_leader(0, TWELVE, 0.0)
    late_s = HANDOVER_S + 0.8
    # The third is heard 8 ms after its turn by the fifth, which follows it; not the other way round.
    fifth.hear_follower(3, late_s + 0.220 + 0.008)
    third.hear_follower(5, late_s + 0.040 + 0.008)
    assert turns(fifth, late_s, 1)[0].at_s == pytest.approx(late_s + 0.048)
    assert turns(third, late_s, 1)[0].at_s == pytest.approx(late_s + 0.22)


def test_while_the_leader_is_heard_no_follower_keeps_the_beat_though_it_is_slow():
    one = Beat(5)
    one.hear_leader(0, TWELVE, 7.0)
    one.hear_follower(3, 7.3)
    assert turns(one, 7.3, 1)[0].at_s == pytest.approx(7.44)
    slow = Beat(5)
    slow.hear_leader(0, replace(TWELVE, period_ms=2000), 0.0)
    assert not slow.is_silent(5.9)
    assert slow.is_silent(6.1)
