"""A companion unpacks and packs frames just as pymavlink does, whatever they hold."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.framing import frame_of, frames_of, message_in

KINDS = sorted(mavlink.mavlink_map)
OLD_KINDS = [number for number in KINDS if number < 256]


def checked(frame, kind):
    """Return a frame with the checksum that its kind asks for."""
    checksum = mavlink.x25crc(frame[1:])
    checksum.accumulate(bytes((kind.crc_extra,)))
    return frame + checksum.crc.to_bytes(2, "little")


@st.composite
def frames(draw):
    """Draw a frame of any kind, of MAVLink 1 or 2, with any payload, and at times a damaged byte."""
    sequence, system_id, component_id = draw(st.tuples(*[st.integers(0, 255)] * 3))
    payload = draw(st.binary(max_size=255)).rstrip(b"\0")[: draw(st.integers(0, 255))]
    if draw(st.booleans()):
        number = draw(st.sampled_from(OLD_KINDS))
        head = bytes((254, len(payload), sequence, system_id, component_id, number))
    else:
        number = draw(st.sampled_from(KINDS))
        source = bytes((sequence, system_id, component_id))
        head = bytes((253, len(payload), 0, 0)) + source + number.to_bytes(3, "little")
    frame = checked(head + payload, mavlink.mavlink_map[number])
    if draw(st.integers(0, 3)) == 0:
        place = draw(st.integers(len(head), len(frame) - 1))
        frame = (
            frame[:place] + bytes((frame[place] ^ draw(st.integers(1, 255)),)) + frame[place + 1 :]
        )
    return frame


def as_pymavlink(frame):
    """Return what pymavlink makes of a frame, None where it refuses it."""
    try:
        return mavlink.MAVLink(None).decode(bytearray(frame))
    except mavlink.MAVError:
        return None


def told(message):
    """Return what a message says and who says it; NaN as a word, since it equals nothing."""
    if message is None:
        return None
    values = [
        [repr(one) for one in value] if isinstance(value, list) else repr(value)
        for value in (getattr(message, name) for name in message.fieldnames)
    ]
    return message.get_type(), message.get_srcSystem(), message.get_srcComponent(), values


@given(frames())
def test_a_companion_reads_a_frame_as_pymavlink_does(frame):
    [found] = frames_of(frame)
    assert told(message_in(found)) == told(as_pymavlink(frame))


@given(frame=frames(), sequence=st.integers(0, 255), system_id=st.integers(0, 255))
def test_a_message_is_packed_as_pymavlink_does(frame, sequence, system_id):
    message = as_pymavlink(frame)
    if message is None:
        return
    one, other = (mavlink.MAVLink(None, srcSystem=system_id, srcComponent=191) for _ in range(2))
    one.seq = other.seq = sequence
    assert frame_of(message, one) == bytes(message.pack(other))


@pytest.mark.parametrize("custom_mode", [-1, 2**32, math.nan])
def test_what_is_beyond_a_field_is_refused(custom_mode):
    message = mavlink.MAVLink_heartbeat_message(1, 3, 0, custom_mode, 4, 3)
    with pytest.raises(struct.error):
        frame_of(message, mavlink.MAVLink(None))
