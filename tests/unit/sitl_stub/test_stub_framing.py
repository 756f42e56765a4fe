from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub.codec import EmulatorFramer

LINK_2 = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
LINK_1 = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
SIGNED_LINK = mavlink.MAVLink(None, srcSystem=255, srcComponent=190)
SIGNED_LINK.signing.secret_key = bytes(32)
SIGNED_LINK.signing.sign_outgoing = True

HEARTBEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
COMMAND = mavlink.MAVLink_command_long_message(7, 1, 511, 0, 33, 1e6, 0, 0, 0, 0, 0)

FRAMES = [
    bytes(HEARTBEAT.pack(LINK_2)),
    bytes(COMMAND.pack(LINK_2)),
    bytes(HEARTBEAT.pack(LINK_1, force_mavlink1=True)),
    bytes(COMMAND.pack(LINK_1, force_mavlink1=True)),
    bytes(HEARTBEAT.pack(SIGNED_LINK)),
]


def in_pieces(stream: bytes, cuts: list[int]) -> list[bytes]:
    edges = [0, *sorted(cut % (len(stream) + 1) for cut in cuts), len(stream)]
    return [stream[start:end] for start, end in pairwise(edges)]


def test_the_samples_are_of_both_versions_and_signed():
    assert [frame[0] for frame in FRAMES] == [0xFD, 0xFD, 0xFE, 0xFE, 0xFD]
    assert [frame[2] & 1 for frame in FRAMES if frame[0] == 0xFD] == [0, 0, 1]


@given(st.lists(st.sampled_from(FRAMES)), st.lists(st.integers(0, 2000)))
def test_frames_come_out_whole_wherever_the_stream_was_cut(frames, cuts):
    framer = EmulatorFramer()
    assert b"".join(framer.feed(piece) for piece in in_pieces(b"".join(frames), cuts)) == b"".join(
        frames
    )


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


def test_a_frame_with_a_wrong_checksum_is_dropped_and_the_next_one_is_not():
    good = FRAMES[1]
    bad = good[:-1] + bytes((good[-1] ^ 1,))
    assert EmulatorFramer().feed(bad + good) == good


def test_a_cut_off_frame_does_not_swallow_the_next_one():
    heartbeat, command = FRAMES[0], FRAMES[1]
    assert EmulatorFramer().feed(command[:-5] + heartbeat + bytes(300)) == heartbeat
