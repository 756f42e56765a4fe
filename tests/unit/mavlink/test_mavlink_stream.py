"""Frames out of a stream of bytes, however it is cut: the companion's framers and the emulator's."""

from collections import Counter

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.codec import EmulatorFramer
from tests.kit.wire import cut, framed, position_report, signing_sender
from vfguide.mavlink.framing import frames_of, holds_whole_frames
from vfguide.mavlink.stream import LARGEST_FRAME, DatagramFramer, StreamFramer


def signed(message: mavlink.MAVLink_message) -> bytes:
    return bytes(message.pack(signing_sender(bytes(32), 1.8e9)))


def tunnel(content: bytes) -> mavlink.MAVLink_message:
    """A message that carries any bytes."""
    return mavlink.MAVLink_tunnel_message(1, 1, 0, len(content), content.ljust(128, b"\0"))


# In no message set: nobody can say what its checksum should be.
UNKNOWN = bytes.fromhex("fd 04 00 00 00 07 01 fe ff ff") + b"data" + b"CC"

HEARTBEAT = framed(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3))
WIND = framed(mavlink.MAVLink_wind_message(10.0, 5.0, 0.0))

CONTENTS = st.binary(max_size=128) | st.binary(max_size=60).map(
    lambda some: some.replace(b"\0", b"\xfd").replace(b"\1", b"\xfe")
)
FRAMES = st.one_of(
    st.sampled_from([HEARTBEAT, WIND]),
    st.builds(framed, CONTENTS.map(tunnel)),
    st.builds(signed, CONTENTS.map(tunnel)),
    st.builds(
        lambda text: framed(mavlink.MAVLink_statustext_message(6, text), version_1=True),
        st.binary(max_size=50).map(lambda some: some.replace(b"\0", b"\xfe")),
    ),
)
GARBAGE = st.binary(max_size=400) | st.lists(
    st.sampled_from([b"\xfd", b"\xfe", b"\xfd\xff\0", b"\xfe\xff", b"\xfd\xff\1", b"x"]),
    max_size=40,
).map(b"".join)


def fed(framer: StreamFramer, pieces: list[bytes]) -> list[bytes]:
    return [frame for piece in pieces for frame in framer.feed(piece)]


class Emulators(EmulatorFramer):
    """The emulator's framer, whose frames are taken out one by one."""

    def feed(self, data: bytes) -> list[bytes]:
        return [frame.content for frame in frames_of(super().feed(data)) if frame]


FRAMERS = [StreamFramer, Emulators]


PLACES = st.lists(st.integers(0, 10_000), max_size=30)


@pytest.mark.parametrize("kind", FRAMERS)
@settings(deadline=None, derandomize=True, max_examples=300)
@given(frames=st.lists(FRAMES, max_size=8), places=PLACES)
def test_frames_come_whole_however_the_stream_is_cut(kind, frames, places):
    assert fed(kind(), cut(b"".join(frames), places)) == frames


@settings(deadline=None, derandomize=True, max_examples=400)
@given(garbage=GARBAGE, frames=st.lists(FRAMES, min_size=1, max_size=8), places=PLACES)
@example(garbage=b"\xfd\xff\0", frames=[HEARTBEAT], places=[])
@example(garbage=b"\xfe" * 300, frames=[WIND] * 8, places=list(range(200)))
def test_garbage_in_front_costs_no_frame_and_no_time(garbage, frames, places):
    framer = StreamFramer()
    assert fed(framer, cut(garbage + b"".join(frames), places)) == frames
    assert framer.counters["bytes left out"] == len(garbage)


@pytest.mark.parametrize("kind", FRAMERS)
@settings(deadline=None, derandomize=True, max_examples=400)
@given(
    before=st.lists(FRAMES, min_size=1, max_size=4),
    garbage=GARBAGE,
    after=st.lists(FRAMES, min_size=1, max_size=4),
    places=PLACES,
)
@example(before=[HEARTBEAT], garbage=b"\xfd\xff\1", after=[WIND], places=[])
def test_noise_in_between_costs_no_frame_and_at_most_280_bytes_of_patience(
    kind, before, garbage, after, places
):
    rest = [HEARTBEAT] * (LARGEST_FRAME // len(HEARTBEAT) + 1)
    stream = b"".join([*before, garbage, *after, *rest])
    assert fed(kind(), cut(stream, places)) == [*before, *after, *rest]


@settings(deadline=None, derandomize=True, max_examples=300)
@given(pieces=st.lists(st.binary(max_size=2000) | GARBAGE | FRAMES, max_size=8))
def test_what_comes_out_went_in_and_the_rest_is_counted(pieces):
    framer = StreamFramer()
    stream, place = b"".join(pieces), 0
    for frame in fed(framer, pieces):
        place = stream.index(frame, place) + len(frame)
    taken = sum(map(len, fed(StreamFramer(), pieces)))
    waiting = len(stream) - taken - framer.counters["bytes left out"]
    assert 0 <= waiting < LARGEST_FRAME


@pytest.mark.parametrize("kind", FRAMERS)
def test_a_frame_is_delivered_with_its_last_byte(kind):
    framer = kind()
    assert fed(framer, [b"garbage" + HEARTBEAT[:-1]]) == []
    assert framer.feed(HEARTBEAT[-1:]) == [HEARTBEAT]


@pytest.mark.parametrize("kind", FRAMERS)
def test_a_damaged_or_cut_off_frame_is_dropped_and_the_next_is_not(kind):
    rest = [HEARTBEAT] * 15
    for place in range(len(WIND)):
        damaged = WIND[:place] + bytes([WIND[place] ^ 0x10]) + WIND[place + 1 :]
        for broken in (damaged, WIND[:place]):
            framer = kind()
            assert framer.feed(HEARTBEAT + broken + b"".join(rest)) == [HEARTBEAT, *rest]
            if kind is StreamFramer:
                assert framer.counters["bytes left out"] == len(broken)


@pytest.mark.parametrize("kind", FRAMERS)
def test_in_step_frames_within_a_frame_are_its_content(kind):
    outer = framed(tunnel(HEARTBEAT + WIND))
    stream = HEARTBEAT + outer + WIND
    bytewise = [stream[i : i + 1] for i in range(len(stream))]
    assert fed(kind(), bytewise) == [HEARTBEAT, outer, WIND]


def test_a_message_that_is_not_known_is_left_out():
    framer = StreamFramer()
    assert framer.feed(HEARTBEAT + UNKNOWN + WIND) == [HEARTBEAT, WIND]
    assert (framer.counters["unknown message"], framer.counters["out of step"]) == (1, 0)
    # An unknown message's header with a length that reaches into the next frame.
    false = bytes.fromhex("fd 10 00 00 00 07 01 fe ff ff")
    assert StreamFramer().feed(HEARTBEAT + false + WIND + HEARTBEAT) == [HEARTBEAT, WIND, HEARTBEAT]


def test_no_amount_of_false_beginnings_hides_the_frame_behind_them():
    framer = StreamFramer()
    assert framer.feed(b"\xfe" * 100_000) == []
    assert framer.feed(HEARTBEAT) == [HEARTBEAT]
    assert framer.counters["bytes left out"] == 100_000


def said(count: int) -> bytes:
    """Heartbeats and positions of one sender, one after the other."""
    sender = mavlink.MAVLink(None, 1, 1)
    out = b""
    for number in range(count):
        sender.seq = number % 256
        out += bytes(mavlink.MAVLink_heartbeat_message(1, 3, 129, 12, 4, 3).pack(sender))
        out += bytes(position_report(time_boot_ms=number).pack(sender))
    return out


@example([1] * 2000)
@example([7] * 300)
@example([32] * 70)
@example([128] * 20)
@example([279] * 10)
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
