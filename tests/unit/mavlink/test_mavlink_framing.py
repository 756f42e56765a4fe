import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed, position_report
from vfguide.mavlink.datagram import UdpPeer
from vfguide.mavlink.framing import ConnectionSigning, Frame, Introduction, frames_of
from vfguide.mavlink.framing import frames_of as frames

BODIES = st.binary(max_size=255)

FRAMES_2 = st.builds(
    lambda body, signed, rest, signature: (
        bytes([0xFD, len(body), signed]) + rest + body + b"CC" + (signature if signed else b"")
    ),
    BODIES,
    st.integers(0, 1),
    st.binary(min_size=7, max_size=7),
    st.binary(min_size=13, max_size=13),
)
FRAMES_1 = st.builds(
    lambda body, rest: bytes([0xFE, len(body)]) + rest + body + b"CC",
    BODIES,
    st.binary(min_size=4, max_size=4),
)


def signed_by(data: bytes) -> bytes:
    """A frame with the signature flag and a signature, whatever they are worth."""
    return data[:2] + b"\x01" + data[3:] + b"S" * 13


def test_headers_are_read():
    message = mavlink.MAVLink_wind_message(10.0, 5.0, 0.0)
    new = framed(message, system_id=200, component_id=34)
    old = framed(message, system_id=201, component_id=35, version_1=True)
    assert list(frames_of(new + old)) == [Frame(168, 200, 34, new), Frame(168, 201, 35, old)]


def test_message_numbers_have_three_bytes():
    data = framed(mavlink.MAVLink_cubepilot_raw_rc_message(b"\x01" * 32))
    (found,) = frames_of(data)
    assert found == Frame(50_001, 7, 1, data)


def test_a_signature_belongs_to_its_frame():
    plain = framed(position_report())
    signed = signed_by(plain)
    assert [one and one.content for one in frames_of(signed + plain)] == [signed, plain]


@pytest.mark.parametrize("flags", [0x02, 0x03, 0x80, 0xFF])
def test_a_frame_with_unknown_flags_is_dropped(flags):
    plain = framed(position_report(lat=0, lon=0, alt=0))
    strange = plain[:2] + bytes([flags]) + plain[3:]
    assert [one and one.content for one in frames_of(strange + plain)] == [None, plain]


def test_garbage_is_one_stretch_up_to_the_next_frame():
    plain = framed(position_report())
    found = [one and one.content for one in frames_of(b"garbage" + plain + b"more")]
    assert found == [None, plain, None]


def test_a_magic_byte_in_garbage_does_not_swallow_the_frame_behind_it():
    plain = framed(position_report())
    for garbage in (b"\xfd", b"\xfe\xff", b"\xfd\xff\x00"):
        assert [one.content for one in frames_of(garbage + plain) if one] == [plain]


def test_no_bytes_hold_no_frames():
    assert list(frames_of(b"")) == []


@settings(deadline=None, derandomize=True)
@given(frames=st.lists(FRAMES_1 | FRAMES_2, max_size=5))
def test_whole_frames_come_apart_as_they_were_put_together(frames):
    assert [one and one.content for one in frames_of(b"".join(frames))] == frames


@settings(deadline=None, derandomize=True, max_examples=300)
@given(pieces=st.lists(st.binary(max_size=30) | FRAMES_1 | st.just(b"\xfd"), max_size=8))
def test_frames_are_stretches_of_the_datagram_in_order(pieces):
    datagram = b"".join(pieces)
    place = 0
    for found in frames_of(datagram):
        if found is not None:
            place = datagram.index(found.content, place) + len(found.content)
            assert found.content[0] in {0xFD, 0xFE}
    assert place <= len(datagram)


OWN, STRANGER = ("10.0.0.1", 14550), ("10.0.0.2", 14550)
KEY = bytes(range(32))
NOW_S = 1.8e9


def heartbeat(
    system_id: int = 7, *, autopilot: int = 3, signed_s: float | None = None, key: bytes = KEY
) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
    if signed_s is not None:
        ConnectionSigning(key, lambda: signed_s).prepare(sender)
    return bytes(mavlink.MAVLink_heartbeat_message(1, autopilot, 0, 0, 4, 3).pack(sender))


def position(system_id: int = 7) -> bytes:
    message = mavlink.MAVLink_global_position_int_message(1000, 1, 1, 1, 1, 0, 0, 0, 0)
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)))


def peer_of(introduction: Introduction) -> UdpPeer:
    return UdpPeer(introduces=introduction.is_given_by, silence_s=introduction.silence_s)


def test_only_the_heartbeat_of_the_expected_autopilot_introduces():
    introduction = Introduction(7, 1)
    assert introduction.is_given_by(heartbeat())
    assert introduction.is_given_by(position() + heartbeat())
    damaged = bytearray(heartbeat())
    damaged[-1] ^= 1
    # A ground station, another vehicle, no heartbeat, a wrong checksum, no MAVLink.
    for other in (heartbeat(autopilot=8), heartbeat(8), position(), bytes(damaged), b"\xfd rest"):
        assert not introduction.is_given_by(other)


def test_whatever_a_stranger_sends_after_a_second_of_silence_it_does_not_get_the_setpoints():
    peer = peer_of(Introduction(7, 1))
    assert peer.admits(OWN, heartbeat(), 0.0)
    for datagram in (position(), heartbeat(), heartbeat(8), b"\xfd rest"):
        assert not peer.admits(STRANGER, datagram, 1.5)
    assert peer.endpoint == OWN
    assert peer.admits(OWN, position(), 1.6)


def test_a_router_that_is_started_anew_is_the_peer_after_ten_seconds_of_silence():
    peer = peer_of(Introduction(7, 1))
    peer.admits(OWN, heartbeat(), 0.0)
    assert not peer.admits(STRANGER, heartbeat(), 9.9)
    assert peer.rival == STRANGER
    assert not peer.admits(STRANGER, position(), 10.1)
    assert peer.admits(STRANGER, heartbeat(), 10.1)
    assert peer.admits(STRANGER, position(), 10.2)
    assert not peer.admits(OWN, heartbeat(), 10.3)


def test_on_a_signed_connection_the_introduction_is_signed_and_a_second_is_enough():
    introduction = Introduction(7, 1, signing=ConnectionSigning(KEY, lambda: NOW_S))
    peer = peer_of(introduction)
    assert not peer.admits(STRANGER, heartbeat(), 0.0)
    assert peer.admits(OWN, heartbeat(signed_s=NOW_S), 0.0)
    assert not peer.admits(STRANGER, heartbeat(), 20.0)
    assert peer.admits(STRANGER, heartbeat(signed_s=NOW_S + 20.0), 20.0)


def test_a_recorded_introduction_is_worth_nothing_once_its_original_was_heard():
    signing = ConnectionSigning(KEY, lambda: NOW_S)
    peer = peer_of(Introduction(7, 1, signing=signing))
    original = heartbeat(signed_s=NOW_S)
    assert peer.admits(OWN, original, 0.0)
    (frame,) = [frame for frame in frames(original) if frame is not None]
    assert signing.accepts(frame)
    assert not peer.admits(STRANGER, original, 20.0)


def test_a_companion_at_the_port_of_another_vehicle_says_so():
    introduction = Introduction(1, 1)
    assert introduction.complaint() is None
    assert not introduction.is_given_by(heartbeat(7))
    assert introduction.complaint() == (
        "heard system 7, expected 1: set system_id in the mission, "
        "or SYSID_THISMAV (PX4: MAV_SYS_ID) to 1, or choose the port of this vehicle"
    )


def test_an_autopilot_that_is_another_component_is_named_and_what_to_set():
    introduction = Introduction(7, 1)
    sender = mavlink.MAVLink(None, srcSystem=7, srcComponent=2)
    beat = bytes(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3).pack(sender))
    assert not introduction.is_given_by(beat)
    assert introduction.complaint() == (
        "the autopilot of system 7 is component 2, expected 1: set component_id to 2 in the mission"
    )
    # A gimbal's heartbeat is none of an autopilot.
    gimbal = bytes(mavlink.MAVLink_heartbeat_message(26, 8, 0, 0, 4, 3).pack(sender))
    quiet = Introduction(7, 1)
    assert not quiet.is_given_by(gimbal)
    assert quiet.complaint() is None


@pytest.mark.parametrize(
    ("beat", "words"),
    [
        (heartbeat(), "does not sign: set up signing with the key"),
        (heartbeat(signed_s=NOW_S, key=bytes(range(1, 33))), "signs with another key"),
        (heartbeat(signed_s=NOW_S - 86_400.0), "a clock that is 1.0 days behind this computer's"),
        (heartbeat(signed_s=NOW_S - 600.0), "a clock that is 10 minutes behind this computer's"),
    ],
)
def test_a_signature_that_is_not_taken_is_told_with_its_reason(beat, words):
    introduction = Introduction(7, 1, signing=ConnectionSigning(KEY, lambda: NOW_S))
    assert not introduction.is_given_by(beat)
    assert words in str(introduction.complaint())
    assert introduction.refused == 1
    assert introduction.is_given_by(heartbeat(signed_s=NOW_S))


@given(st.lists(st.binary(max_size=60), max_size=10))
def test_whatever_introduces_nobody_is_told_in_one_sentence_or_not_at_all(datagrams):
    introduction = Introduction(7, 1, signing=ConnectionSigning(KEY, lambda: NOW_S))
    for datagram in datagrams:
        assert not introduction.is_given_by(datagram)
    assert introduction.complaint() is None or introduction.refused > 0
