import pytest

from vfguide.mavlink.datagram import UdpPeer

FIRST, SECOND = ("10.0.0.1", 14550), ("10.0.0.2", 14550)
FRAME = b"\xfd rest"


def test_nobody_is_answered_before_somebody_has_spoken():
    assert UdpPeer().endpoint is None


def test_whoever_speaks_first_is_the_peer():
    peer = UdpPeer()
    assert peer.admits(FIRST, FRAME, 0.0)
    assert peer.endpoint == FIRST


def test_another_takes_over_after_a_second_of_silence_and_not_before():
    peer = UdpPeer()
    assert peer.admits(FIRST, FRAME, 10.0)
    assert not peer.admits(SECOND, FRAME, 10.999)
    assert peer.endpoint == FIRST
    assert peer.admits(SECOND, FRAME, 11.0)
    assert peer.endpoint == SECOND
    assert not peer.admits(FIRST, FRAME, 11.5)


def test_a_peer_that_speaks_keeps_its_place_however_often_others_try():
    peer = UdpPeer()
    for tenth in range(100):
        assert peer.admits(FIRST, FRAME, 0.1 * tenth)
        assert not peer.admits(SECOND, FRAME, 0.1 * tenth + 0.05)


def test_those_who_are_not_listened_to_do_not_prolong_the_silence():
    peer = UdpPeer()
    peer.admits(FIRST, FRAME, 0.0)
    for tenth in range(1, 10):
        assert not peer.admits(SECOND, FRAME, 0.1 * tenth)
    assert peer.admits(SECOND, FRAME, 1.0)


def test_another_port_of_the_same_host_is_another_peer():
    peer = UdpPeer()
    peer.admits(("10.0.0.1", 1), FRAME, 0.0)
    assert not peer.admits(("10.0.0.1", 2), FRAME, 0.5)


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


def test_flow_labels_and_scopes_make_no_other_peer():
    peer = UdpPeer(("fe80::1", 14550, 0, 2))
    assert peer.admits(("fe80::1", 14550, 7, 2), FRAME, 0.0)
