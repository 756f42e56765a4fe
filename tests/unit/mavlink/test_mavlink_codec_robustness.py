"""Bytes into reports and messages into bytes, whatever comes over the wire."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import frame_of, framed, parsed, position_report, types_of
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import Report


def is_finite(report: Report) -> bool:
    return all(math.isfinite(value) for value in astuple(report) if isinstance(value, float))


HEARD = {0: 9, 33: 28, 74: 20, 77: 10, 253: 54}
"""What is listened to, with the full size of each payload."""

HEARD_FRAMES = st.sampled_from(sorted(HEARD)).flatmap(
    lambda message_id: st.binary(min_size=1, max_size=HEARD[message_id]).map(
        lambda payload: frame_of(message_id, payload)
    )
)


POSITION = framed(position_report())


@pytest.mark.parametrize(
    ("data", "counted"),
    [
        *(
            (framed(position_report(), system_id=system, component_id=part), "not this vehicle's")
            for system, part in ((8, 1), (7, 2), (0, 1), (7, 0), (255, 190))
        ),
        (framed(mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)), "not used"),
        # The checksum of an unknown message is never looked at, so neither is anything else in it.
        (frame_of(0x01_ABCD, b"\x01\x02\x03", 0), "not used"),
        (POSITION[:-1] + bytes([POSITION[-1] ^ 0xFF]), "not MAVLink"),
    ],
)
def test_what_is_not_for_this_companion_is_counted_and_not_delivered(codec, data, counted):
    assert codec.decode(data) == []
    assert dict(codec.counters) == {counted: 1}


def test_garbage_before_a_frame_in_the_same_datagram_is_skipped_and_an_empty_one_is_nothing(codec):
    assert codec.decode(b"") == []
    assert not codec.counters
    assert len(codec.decode(b"\x00\x01garbage" + POSITION)) == 1
    assert dict(codec.counters) == {"not MAVLink": 1}


def test_mavlink_1_frames_are_understood(codec):
    data = framed(position_report(vx=2000), version_1=True)
    assert data[0] == 0xFE
    (report,) = codec.decode(data)
    assert report.velocity_north == pytest.approx(20.0)


def test_no_frame_with_one_bit_flipped_is_delivered(codec):
    good = framed(position_report(vx=2000, vy=-300, hdg=4500))
    for bit in range(8 * len(good)):
        data = bytearray(good)
        data[bit // 8] ^= 1 << bit % 8
        assert codec.decode(bytes(data)) == []
    assert len(codec.decode(good)) == 1


def test_every_truncated_frame_is_counted_and_forgotten(codec):
    good = framed(position_report(vx=2000))
    for length in range(1, len(good)):
        before = codec.counters["not MAVLink"]
        assert codec.decode(good[:length]) == []
        assert codec.counters["not MAVLink"] > before
        # Neither half swallows, nor completes, what the next datagram holds.
        assert codec.decode(good[length:]) == []
        assert len(codec.decode(good)) == 1


def test_concatenated_frames_are_delivered_in_order(codec):
    times = [1000, 1050, 1100, 1150]
    reports = codec.decode(b"".join(framed(position_report(time_boot_ms=time)) for time in times))
    assert [one.boot_time_s for one in reports] == pytest.approx([1.0, 1.05, 1.1, 1.15])


@settings(deadline=None, derandomize=True)
@given(magic=st.sampled_from([b"\xfd", b"\xfe"]), garbage=st.binary(max_size=40))
def test_garbage_does_not_swallow_the_next_datagram(magic, garbage):
    codec = Codec(7, 1)
    codec.decode(magic + garbage)
    assert len(codec.decode(framed(position_report()))) == 1


@settings(deadline=None, derandomize=True, max_examples=300)
@given(data=st.binary(max_size=400))
def test_random_bytes_deliver_nothing_and_never_raise(data):
    assert Codec(7, 1).decode(data) == []


@settings(deadline=None, derandomize=True, max_examples=300)
@given(frames=st.lists(HEARD_FRAMES, min_size=1, max_size=4))
def test_no_content_of_a_sound_frame_makes_a_report_that_is_not_finite(frames):
    codec = Codec(7, 1)
    reports = codec.decode(b"".join(frames))
    assert all(is_finite(report) for report in reports)
    assert len(reports) + codec.counters.total() == len(frames)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(
    frames=st.lists(HEARD_FRAMES, min_size=1, max_size=3),
    changes=st.lists(st.tuples(st.integers(0, 500), st.integers(1, 255)), min_size=1, max_size=5),
)
def test_mutated_frames_never_raise(frames, changes):
    data = bytearray(b"".join(frames))
    for place, change in changes:
        data[place % len(data)] ^= change
    reports = Codec(7, 1).decode(bytes(data))
    assert len(reports) <= len(frames)
    assert all(is_finite(report) for report in reports)


def beat() -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


def test_a_datagram_holds_all_messages_in_order_from_the_onboard_computer_of_the_vehicle(codec):
    assert codec.encode([]) == b""
    data = codec.encode([beat(), mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), beat()])
    # MAVLink 2.
    assert data[0] == 0xFD
    assert types_of(parsed(data)) == ["HEARTBEAT", "ATTITUDE", "HEARTBEAT"]
    assert {(one.get_srcSystem(), one.get_srcComponent()) for one in parsed(data)} == {(7, 191)}


def test_sequence_numbers_are_consecutive_whatever_is_received_and_wrap_at_256(codec):
    numbers = []
    for _ in range(100):
        numbers += [message.get_seq() for message in parsed(codec.encode([beat()] * 3))]
        codec.decode(POSITION + b"\xfdgarbage")
    assert numbers == [number % 256 for number in range(300)]
