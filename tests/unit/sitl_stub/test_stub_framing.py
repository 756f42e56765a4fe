from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.codec import EmulatorFramer
from tests.kit.wire import command_long, cut, packed, signing_sender

HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
COMMAND = command_long(511, 33, 1e6, system_id=7)

FRAMES = [
    packed(HEARTBEAT),
    packed(COMMAND),
    packed(HEARTBEAT, version_1=True),
    packed(COMMAND, version_1=True),
    bytes(HEARTBEAT.pack(signing_sender(bytes(32), 1.8e9))),
]


@given(st.lists(st.sampled_from(FRAMES)), st.lists(st.integers(0, 2000)))
def test_frames_come_out_whole_wherever_the_stream_was_cut(frames, cuts):
    framer, stream = EmulatorFramer(), b"".join(frames)
    assert b"".join(framer.feed(piece) for piece in cut(stream, cuts)) == stream


def test_the_samples_are_of_both_versions_and_signed():
    assert [frame[0] for frame in FRAMES] == [0xFD, 0xFD, 0xFE, 0xFE, 0xFD]
    assert [frame[2] & 1 for frame in FRAMES if frame[0] == 0xFD] == [0, 0, 1]


@given(st.lists(st.sampled_from(FRAMES)), st.binary(max_size=40))
def test_a_frame_comes_out_with_its_last_byte_and_not_before(frames, garbage):
    framer = EmulatorFramer()
    clean = bytes(byte for byte in garbage if byte not in {0xFD, 0xFE})
    for frame in frames:
        assert framer.feed(clean + frame[:-1]) == b""
        assert framer.feed(frame[-1:]) == frame


@given(st.lists(st.tuples(st.binary(max_size=300), st.sampled_from(FRAMES)), max_size=8))
@settings(max_examples=300)
def test_garbage_costs_no_good_frame(parts):
    framer = EmulatorFramer()
    wanted = b"".join(frame for _, frame in parts)
    # The zeros end whatever the last piece of garbage claims to have begun.
    stream = b"".join(garbage + frame for garbage, frame in parts) + bytes(300)
    assert b"".join(framer.feed(stream[at : at + 7]) for at in range(0, len(stream), 7)) == wanted


def test_a_damaged_or_cut_off_frame_does_not_swallow_the_next_one():
    heartbeat, command = FRAMES[0], FRAMES[1]
    damaged = command[:-1] + bytes((command[-1] ^ 1,))
    assert EmulatorFramer().feed(damaged + command) == command
    assert EmulatorFramer().feed(command[:-5] + heartbeat + bytes(300)) == heartbeat
