"""Frames of datagrams, and who may send them."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed, position_report
from vfguide.mavlink.connection import UdpPeer
from vfguide.mavlink.framing import (
    ConnectionSigning,
    Frame,
    Introduction,
    SequencePlaces,
    frames_of,
)

POSITION = framed(position_report())
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


def test_headers_are_read():
    message = mavlink.MAVLink_wind_message(10.0, 5.0, 0.0)
    new = framed(message, system_id=200, component_id=34)
    old = framed(message, system_id=201, component_id=35, version_1=True)
    # The number of a message has three bytes.
    high = framed(mavlink.MAVLink_cubepilot_raw_rc_message(b"\x01" * 32))
    frames = [Frame(168, 200, 34, new), Frame(168, 201, 35, old), Frame(50_001, 7, 1, high)]
    assert list(frames_of(new + old + high)) == frames


def flagged(flags: int, rest: bytes = b"") -> bytes:
    """A frame with these flags, and what follows it."""
    return POSITION[:2] + bytes([flags]) + POSITION[3:] + rest


@pytest.mark.parametrize(
    ("datagram", "frames"),
    [
        # A signature, whatever it is worth, belongs to its frame.
        (flagged(0x01, b"S" * 13) + POSITION, [flagged(0x01, b"S" * 13), POSITION]),
        # A frame with flags that are not known is dropped.
        *((flagged(flags) + POSITION, [None, POSITION]) for flags in (0x02, 0x03, 0x80, 0xFF)),
        # Garbage is one stretch up to the next frame.
        (b"garbage" + POSITION + b"more", [None, POSITION, None]),
        (b"", []),
    ],
)
def test_a_datagram_holds_frames_and_stretches_of_garbage(datagram, frames):
    assert [one and one.content for one in frames_of(datagram)] == frames


def test_a_magic_byte_in_garbage_does_not_swallow_the_frame_behind_it():
    for garbage in (b"\xfd", b"\xfe\xff", b"\xfd\xff\x00"):
        assert [one.content for one in frames_of(garbage + POSITION) if one] == [POSITION]


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
    system_id: int = 7,
    *,
    component_id: int = 1,
    kind: int = 1,
    autopilot: int = 3,
    signed_s: float | None = None,
    key: bytes = KEY,
) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=component_id)
    if signed_s is not None:
        ConnectionSigning(key, lambda: signed_s).prepare(sender)
    return bytes(mavlink.MAVLink_heartbeat_message(kind, autopilot, 0, 0, 4, 3).pack(sender))


def peer_of(introduction: Introduction) -> UdpPeer:
    return UdpPeer(introduces=introduction.is_given_by, silence_s=introduction.silence_s)


def test_only_the_heartbeat_of_the_expected_autopilot_introduces():
    introduction = Introduction(7, 1)
    assert introduction.is_given_by(heartbeat())
    assert introduction.is_given_by(POSITION + heartbeat())
    damaged = bytearray(heartbeat())
    damaged[-1] ^= 1
    # A ground station, another vehicle, no heartbeat, a wrong checksum, no MAVLink.
    for other in (heartbeat(autopilot=8), heartbeat(8), POSITION, bytes(damaged), b"\xfd rest"):
        assert not introduction.is_given_by(other)


def test_whatever_a_stranger_sends_after_a_second_of_silence_it_does_not_get_the_setpoints():
    peer = peer_of(Introduction(7, 1))
    assert peer.admits(OWN, heartbeat(), 0.0)
    for datagram in (POSITION, heartbeat(), heartbeat(8), b"\xfd rest"):
        assert not peer.admits(STRANGER, datagram, 1.5)
    assert peer.endpoint == OWN
    assert peer.admits(OWN, POSITION, 1.6)


def test_a_router_that_is_started_anew_is_the_peer_after_ten_seconds_of_silence():
    peer = peer_of(Introduction(7, 1))
    peer.admits(OWN, heartbeat(), 0.0)
    assert not peer.admits(STRANGER, heartbeat(), 9.9)
    assert peer.rival == STRANGER
    assert not peer.admits(STRANGER, POSITION, 10.1)
    assert peer.admits(STRANGER, heartbeat(), 10.1)
    assert peer.admits(STRANGER, POSITION, 10.2)
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
    (frame,) = [frame for frame in frames_of(original) if frame is not None]
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
    assert not introduction.is_given_by(heartbeat(component_id=2))
    assert introduction.complaint() == (
        "the autopilot of system 7 is component 2, expected 1: set component_id to 2 in the mission"
    )
    # A gimbal's heartbeat is none of an autopilot.
    quiet = Introduction(7, 1)
    assert not quiet.is_given_by(heartbeat(component_id=2, kind=26, autopilot=8))
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


FIRST, SECOND = ("10.0.0.1", 14550), ("10.0.0.2", 14550)
FRAME = b"\xfd rest"


def test_whoever_speaks_first_is_the_peer_until_another_speaks_after_a_second_of_silence():
    peer = UdpPeer()
    assert peer.endpoint is None
    # While it speaks it keeps its place, however often others try.
    for tenth in range(101):
        assert peer.admits(FIRST, FRAME, 0.1 * tenth)
        assert not peer.admits(SECOND, FRAME, 0.1 * tenth + 0.05)
    # Nor do those who are not listened to prolong its silence.
    for hundredth in range(10, 100):
        assert not peer.admits(SECOND, FRAME, 10.0 + 0.01 * hundredth)
    assert peer.endpoint == FIRST
    assert peer.admits(SECOND, FRAME, 11.0)
    assert peer.endpoint == SECOND
    assert not peer.admits(FIRST, FRAME, 11.5)


def test_another_port_of_the_same_host_is_another_peer_and_another_flow_label_is_not():
    peer = UdpPeer()
    peer.admits(("10.0.0.1", 1), FRAME, 0.0)
    assert not peer.admits(("10.0.0.1", 2), FRAME, 0.5)
    scoped = UdpPeer(("fe80::1", 14550, 0, 2))
    assert scoped.admits(("fe80::1", 14550, 7, 2), FRAME, 0.0)


@pytest.mark.parametrize("datagram", [b"", b"GET / HTTP/1.1", b"\x00\xfd"])
def test_what_does_not_begin_as_mavlink_makes_nobody_a_peer(datagram):
    peer = UdpPeer()
    assert not peer.admits(FIRST, datagram, 0.0)
    assert peer.endpoint is None


def test_a_given_peer_is_the_only_one_for_ever():
    peer = UdpPeer(FIRST)
    assert not peer.admits(SECOND, FRAME, 1e6)
    assert peer.endpoint == FIRST
    assert peer.admits(FIRST, FRAME, 2e6)


@given(st.lists(st.booleans(), min_size=1, max_size=400), st.integers(0, 255))
def test_numbers_of_one_sender_never_return_whatever_is_lost(kept, first):
    places, sender = SequencePlaces(), mavlink.MAVLink(None, 2, 1)
    sender.seq = first
    series: list[int] = []
    for number, arrives in enumerate(kept):
        message = mavlink.MAVLink_system_time_message(0, number)
        frame = next(frames_of(bytes(message.pack(sender))))
        assert frame is not None
        sender.seq = (sender.seq + 1) % 256
        if arrives:
            series.append(places.note(frame))
    assert series == sorted(series)
