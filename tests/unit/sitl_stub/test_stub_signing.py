import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind, Signing
from sitl_stub.codec import EPOCH_UNIX_S, key_of, ticks_of
from tests.kit.autopilot import config_of
from tests.kit.wire import command_long, packed, signing_sender, signing_ticks

NOW_S = 1_800_000_000.0
KEY, OTHER_KEY = bytes(range(32)), bytes(32 * [7])
YEAR_S = 365.0 * 86_400.0


class Clock:
    now_s = NOW_S


def vehicle(*, armed: bool = True) -> tuple[Autopilot, Clock]:
    config, clock = config_of(armed=armed), Clock()
    autopilot = Autopilot(config, CalmWind(), signing=Signing(KEY), unix_time=lambda: clock.now_s)
    return autopilot, clock


GUIDED, LOITER = (command_long(176, 1, number, system_id=7) for number in (15, 12))


def mode(link: mavlink.MAVLink, order: mavlink.MAVLink_message = GUIDED) -> bytes:
    return bytes(order.pack(link))


def test_who_has_the_key_is_obeyed_and_the_answer_is_signed():
    autopilot, _ = vehicle()
    answer = autopilot.receive(mode(signing_sender(KEY, NOW_S)))
    assert autopilot.truth().mode == "GUIDED"
    ground = mavlink.MAVLink(None)
    ground.signing.secret_key = KEY
    messages = ground.parse_buffer(answer)
    assert all(message.get_signed() for message in messages)
    assert messages[0].get_type() == "COMMAND_ACK"


@pytest.mark.parametrize("key", [None, OTHER_KEY])
def test_an_unsigned_or_wrongly_signed_packet_changes_nothing(key):
    autopilot, _ = vehicle()
    before = autopilot.truth()
    assert autopilot.receive(mode(signing_sender(key, NOW_S))) == b""
    assert autopilot.truth() == before
    assert autopilot.counters["not signed"] == 1


def test_a_mavlink_1_packet_changes_nothing():
    autopilot, _ = vehicle()
    assert autopilot.receive(packed(GUIDED, version_1=True)) == b""
    assert autopilot.truth().mode == "LOITER"


def test_a_packet_played_back_changes_nothing():
    autopilot, _ = vehicle()
    link = signing_sender(KEY, NOW_S)
    guided = mode(link)
    autopilot.receive(guided)
    autopilot.receive(mode(link, LOITER))
    assert autopilot.receive(guided) == b""
    assert autopilot.truth().mode == "LOITER"


def test_an_old_recording_from_a_link_not_heard_before_changes_nothing():
    autopilot, _ = vehicle()
    assert autopilot.receive(mode(signing_sender(KEY, NOW_S - 61.0, link_id=5))) == b""
    assert autopilot.receive(mode(signing_sender(KEY, NOW_S - 59.0, link_id=6))) != b""


def test_a_forged_packet_from_the_future_locks_nobody_out():
    autopilot, _ = vehicle()
    true_sender = signing_sender(KEY, NOW_S)
    autopilot.receive(mode(true_sender))
    assert autopilot.receive(mode(signing_sender(OTHER_KEY, NOW_S + 50.0 * YEAR_S))) == b""
    autopilot.receive(mode(true_sender, LOITER))
    assert autopilot.truth().mode == "LOITER"
    assert autopilot.receive(mode(signing_sender(KEY, NOW_S + 1.0, link_id=9))) != b""


def test_what_it_says_keeps_up_with_the_clock_so_that_a_restarted_listener_hears_it():
    autopilot, clock = vehicle()
    autopilot.advance(1.0)
    clock.now_s += 3600.0
    answer = autopilot.advance(3.0)
    # A listener that starts now takes a new stream if it is at most a minute old.
    listener = Signing(KEY)
    frame = answer[: 10 + answer[1] + 2 + 13]
    assert listener.accepts(frame, clock.now_s)
    stamps = int.from_bytes(frame[-12:-6], "little")
    assert stamps == pytest.approx(signing_ticks(clock.now_s), abs=100)


def test_time_stamps_never_repeat_even_while_the_clock_stands_still():
    autopilot, _ = vehicle()
    listener = Signing(KEY)
    data = autopilot.advance(0.0) + autopilot.advance(5.0)
    while data:
        length = 10 + data[1] + 2 + 13
        assert listener.accepts(data[:length], NOW_S)
        data = data[length:]


def test_a_key_is_given_on_the_ground_and_not_in_the_air():
    autopilot, _ = vehicle()
    link = signing_sender(KEY, NOW_S)
    new_key = mavlink.MAVLink_setup_signing_message(7, 1, list(OTHER_KEY), 0)
    autopilot.receive(bytes(new_key.pack(link)))
    assert autopilot.receive(mode(link)) != b""

    standing, _ = vehicle(armed=False)
    standing.receive(bytes(new_key.pack(link)))
    assert standing.receive(mode(link)) == b""
    assert standing.receive(mode(signing_sender(OTHER_KEY, NOW_S + 1.0))) != b""


def test_a_key_is_hexadecimal_or_a_passphrase_as_ground_stations_take_it():
    assert key_of(KEY.hex()) == KEY
    assert key_of("open sesame") == hashlib.sha256(b"open sesame").digest()
    assert key_of("z" * 64) == hashlib.sha256(b"z" * 64).digest()
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short")
    assert ticks_of(EPOCH_UNIX_S + 1.0) == 100_000


@given(
    st.lists(st.tuples(st.integers(0, 60), st.integers(1, 255)), min_size=1, max_size=4),
)
def test_no_change_of_a_signed_frame_is_accepted(changes):
    autopilot, _ = vehicle()
    frame = bytearray(mode(signing_sender(KEY, NOW_S)))
    original = bytes(frame)
    for position, bits in changes:
        frame[position % len(frame)] ^= bits
    before = autopilot.truth()
    autopilot.receive(bytes(frame))
    if bytes(frame) != original:
        assert autopilot.truth() == before
