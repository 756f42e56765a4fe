"""Packets on a stream of bytes that arrive cut and damaged."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from tests.kit.wire import cut
from vfguide.link.radio_schedule import (
    LARGEST_FRAME,
    LARGEST_PACKET,
    OVERHEAD,
    Framer,
    decode_frame,
    encode_frame,
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


def test_a_changed_packet_is_counted_as_damaged():
    counters = Counter[str]()
    frame = bytearray(encode_frame(b"some state"))
    frame[4] ^= 0x10
    assert not Framer(counters).feed(bytes(frame))
    assert counters == {DAMAGED: 1}
