import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed, signing_sender, signing_ticks
from vfguide.errors import InputError
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import ConnectionSigning, frames_of, signing_key

NOW_S = 1_800_000_000.0
KEY, OTHER_KEY = bytes(range(32)), bytes(32 * [7])
YEAR_S = 365.0 * 86_400.0


def autopilot(key: bytes | None, at_s: float, *, link_id: int = 0) -> mavlink.MAVLink:
    return signing_sender(key, at_s, system_id=7, component_id=1, link_id=link_id)


BEAT = mavlink.MAVLink_heartbeat_message(1, 3, 129, 15, 4, 3)
OWN = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


def heartbeat(link: mavlink.MAVLink) -> bytes:
    return bytes(BEAT.pack(link))


@pytest.fixture
def codec() -> Codec:
    return Codec(7, 1, signing=ConnectionSigning(KEY, lambda: NOW_S))


def test_who_has_the_key_is_heard_and_not_twice(codec):
    frame = heartbeat(autopilot(KEY, NOW_S))
    assert len(codec.decode(frame)) == 1
    # Played back.
    assert codec.decode(frame) == []


@pytest.mark.parametrize("key", [None, OTHER_KEY])
def test_an_unsigned_or_wrongly_signed_packet_is_not_heard(codec, key):
    assert codec.decode(heartbeat(autopilot(key, NOW_S))) == []
    assert codec.counters["not signed"] == 1


def test_a_mavlink_1_packet_is_not_heard(codec):
    assert codec.decode(framed(BEAT, version_1=True)) == []


def test_a_recording_of_a_stream_not_heard_before_is_not_heard(codec):
    assert codec.decode(heartbeat(autopilot(KEY, NOW_S - 61.0))) == []
    assert len(codec.decode(heartbeat(autopilot(KEY, NOW_S - 59.0)))) == 1


def test_a_forged_packet_from_the_future_shuts_nobody_out(codec):
    true_sender = autopilot(KEY, NOW_S)
    codec.decode(heartbeat(true_sender))
    assert codec.decode(heartbeat(autopilot(OTHER_KEY, NOW_S + 50.0 * YEAR_S))) == []
    assert len(codec.decode(heartbeat(true_sender))) == 1
    assert len(codec.decode(heartbeat(autopilot(KEY, NOW_S + 1.0, link_id=9)))) == 1


def test_time_stamps_follow_the_clock_and_never_repeat():
    clock = [NOW_S]
    codec = Codec(7, 1, signing=ConnectionSigning(KEY, lambda: clock[0]))

    def stamps() -> list[int]:
        return [
            int.from_bytes(frame.content[-12:-6], "little")
            for frame in frames_of(codec.encode([OWN] * 3))
            if frame is not None
        ]

    first = stamps() + stamps()
    assert len(set(first)) == 6
    clock[0] += 3600.0
    assert stamps()[0] == pytest.approx(signing_ticks(clock[0]), abs=10)


def test_what_is_said_is_signed_so_that_pymavlink_itself_believes_it(codec):
    listener = mavlink.MAVLink(None)
    listener.signing.secret_key = KEY
    (heard,) = listener.parse_buffer(codec.encode([OWN]))
    assert heard.get_signed()
    # Speaking does not change how is listened: the key is not pymavlink's to check with.
    assert len(codec.decode(heartbeat(autopilot(KEY, NOW_S)))) == 1
    assert codec.decode(heartbeat(autopilot(OTHER_KEY, NOW_S + YEAR_S))) == []


def test_without_a_key_a_signature_is_passed_over():
    assert len(Codec(7, 1).decode(heartbeat(autopilot(OTHER_KEY, NOW_S)))) == 1


@given(st.integers(0, 33), st.integers(1, 255))
def test_no_change_of_a_signed_frame_is_heard(position, bits):
    codec = Codec(7, 1, signing=ConnectionSigning(KEY, lambda: NOW_S))
    frame = bytearray(heartbeat(autopilot(KEY, NOW_S)))
    frame[position % len(frame)] ^= bits
    assert codec.decode(bytes(frame)) == []


def test_a_key_is_64_hexadecimal_digits_and_a_wrong_one_is_not_repeated():
    assert signing_key(f" {KEY.hex()}\n") == KEY
    for wrong in ("", "secret", KEY.hex()[2:], "z" * 64):
        with pytest.raises(InputError) as caught:
            signing_key(wrong)
        assert not wrong or wrong not in str(caught.value)
