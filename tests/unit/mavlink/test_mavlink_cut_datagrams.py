"""A stream is a stream, however its sender cuts it into datagrams."""

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import position_report
from vfguide.mavlink.framing import holds_whole_frames
from vfguide.mavlink.stream import DatagramFramer


def said(count: int) -> bytes:
    """Heartbeats and positions of one sender, one after the other."""
    sender = mavlink.MAVLink(None, 1, 1)
    out = b""
    for number in range(count):
        sender.seq = number % 256
        out += bytes(mavlink.MAVLink_heartbeat_message(1, 3, 129, 12, 4, 3).pack(sender))
        out += bytes(position_report(time_boot_ms=number).pack(sender))
    return out


@pytest.mark.parametrize("size", [1, 7, 32, 128, 279])
def test_every_frame_arrives_whatever_the_size_of_a_datagram(size):
    stream, framer = said(50), DatagramFramer(Counter())
    heard = b"".join(framer.feed(stream[at : at + size]) for at in range(0, len(stream), size))
    assert heard == stream


@given(st.lists(st.integers(1, 300), max_size=60))
def test_every_frame_arrives_however_it_is_cut(sizes):
    stream, framer, at, heard = said(40), DatagramFramer(Counter()), 0, b""
    for size in [*sizes, len(stream)]:
        heard += framer.feed(stream[at : at + size]) if at < len(stream) else b""
        at += size
    assert heard == stream


def test_after_a_lost_piece_the_next_whole_datagram_is_heard_at_once():
    framer, one = DatagramFramer(Counter()), said(1)
    assert framer.feed(one[:30]) == one[:21]
    assert framer.feed(one) == one
    assert framer.feed(one) == one


def test_what_nobody_here_knows_is_handed_on_where_it_comes_whole():
    unknown = bytes([0xFD, 2, 0, 0, 0, 1, 1, 0xFF, 0xFF, 0x7F, 1, 2, 3, 4])
    assert holds_whole_frames(unknown)
    assert DatagramFramer(Counter()).feed(unknown) == unknown


@given(st.lists(st.binary(max_size=300), max_size=20))
def test_any_datagrams_are_taken_and_a_true_one_after_them_is_heard(noise):
    framer = DatagramFramer(Counter())
    for datagram in noise:
        framer.feed(datagram)
    assert framer.feed(said(1)) == said(1)
