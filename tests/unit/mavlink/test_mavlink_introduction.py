"""Who becomes the peer at a UDP port: the expected autopilot, and nobody else for as long as it speaks."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.datagram import UdpPeer
from vfguide.mavlink.framing import Introduction, Signing
from vfguide.mavlink.framing import frames_of as frames

OWN, STRANGER = ("10.0.0.1", 14550), ("10.0.0.2", 14550)
KEY = bytes(range(32))
NOW_S = 1.8e9


def heartbeat(system_id: int = 7, *, autopilot: int = 3, signed_s: float | None = None) -> bytes:
    sender = mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)
    if signed_s is not None:
        Signing(KEY, lambda: signed_s).prepare(sender)
    return bytes(mavlink.MAVLink_heartbeat_message(1, autopilot, 0, 0, 4, 3).pack(sender))


def position(system_id: int = 7) -> bytes:
    message = mavlink.MAVLink_global_position_int_message(1000, 1, 1, 1, 1, 0, 0, 0, 0)
    return bytes(message.pack(mavlink.MAVLink(None, srcSystem=system_id, srcComponent=1)))


def peer_of(introduction: Introduction) -> UdpPeer:
    return UdpPeer(introduces=introduction.is_given_by, silence_s=introduction.silence_s)


def test_only_the_heartbeat_of_the_expected_autopilot_introduces() -> None:
    introduction = Introduction(7, 1)
    assert introduction.is_given_by(heartbeat())
    assert introduction.is_given_by(position() + heartbeat())
    damaged = bytearray(heartbeat())
    damaged[-1] ^= 1
    # A ground station, another vehicle, no heartbeat, a wrong checksum, no MAVLink.
    for other in (heartbeat(autopilot=8), heartbeat(8), position(), bytes(damaged), b"\xfd rest"):
        assert not introduction.is_given_by(other)


def test_whatever_a_stranger_sends_after_a_second_of_silence_it_does_not_get_the_setpoints() -> (
    None
):
    peer = peer_of(Introduction(7, 1))
    assert peer.admits(OWN, heartbeat(), 0.0)
    for datagram in (position(), heartbeat(), heartbeat(8), b"\xfd rest"):
        assert not peer.admits(STRANGER, datagram, 1.5)
    assert peer.endpoint == OWN
    assert peer.admits(OWN, position(), 1.6)


def test_a_router_that_is_started_anew_is_the_peer_after_ten_seconds_of_silence() -> None:
    peer = peer_of(Introduction(7, 1))
    peer.admits(OWN, heartbeat(), 0.0)
    assert not peer.admits(STRANGER, heartbeat(), 9.9)
    assert peer.rival == STRANGER
    assert not peer.admits(STRANGER, position(), 10.1)
    assert peer.admits(STRANGER, heartbeat(), 10.1)
    assert peer.admits(STRANGER, position(), 10.2)
    assert not peer.admits(OWN, heartbeat(), 10.3)


def test_on_a_signed_connection_the_introduction_is_signed_and_a_second_is_enough() -> None:
    introduction = Introduction(7, 1, signing=Signing(KEY, lambda: NOW_S))
    peer = peer_of(introduction)
    assert not peer.admits(STRANGER, heartbeat(), 0.0)
    assert peer.admits(OWN, heartbeat(signed_s=NOW_S), 0.0)
    assert not peer.admits(STRANGER, heartbeat(), 20.0)
    assert peer.admits(STRANGER, heartbeat(signed_s=NOW_S + 20.0), 20.0)


def test_a_recorded_introduction_is_worth_nothing_once_its_original_was_heard() -> None:
    signing = Signing(KEY, lambda: NOW_S)
    peer = peer_of(Introduction(7, 1, signing=signing))
    original = heartbeat(signed_s=NOW_S)
    assert peer.admits(OWN, original, 0.0)
    (frame,) = [frame for frame in frames(original) if frame is not None]
    assert signing.accepts(frame)
    assert not peer.admits(STRANGER, original, 20.0)


def test_a_companion_at_the_port_of_another_vehicle_says_so() -> None:
    introduction = Introduction(1, 1)
    assert introduction.complaint() is None
    assert not introduction.is_given_by(heartbeat(7))
    assert introduction.complaint() == (
        "heard system 7, expected 1: set system_id in the mission, "
        "or SYSID_THISMAV (PX4: MAV_SYS_ID) to 1, or choose the port of this vehicle"
    )
