"""Signed MAVLink as the companion and the emulator speak and hear it."""

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind, Signing
from sitl_stub.codec import EPOCH_UNIX_S, key_of, ticks_of
from tests.kit.autopilot import config_of
from tests.kit.wire import command_long, packed, signing_sender, signing_ticks
from vfguide.errors import InputError
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.framing import ConnectionSigning, frames_of, signing_key

NOW_S = 1_800_000_000.0
KEY, OTHER_KEY = bytes(range(32)), bytes(32 * [7])
YEAR_S = 365.0 * 86_400.0
BEAT = mavlink.MAVLink_heartbeat_message(1, 3, 129, 15, 4, 3)
OWN = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)
GUIDED = command_long(176, 1, 15, system_id=7)


class Companion:
    """Hears the heartbeats of system 7."""

    message, speaker = BEAT, 7

    def __init__(self) -> None:
        self.now_s = NOW_S
        self._codec = Codec(7, 1, signing=ConnectionSigning(KEY, lambda: self.now_s))
        self.counters = self._codec.counters

    def hears(self, frame: bytes) -> bool:
        return self._codec.decode(frame) != []

    def says(self) -> bytes:
        return self._codec.encode([OWN] * 3)


class Emulator:
    """Obeys the commands of a ground station, and does nothing else."""

    message, speaker = GUIDED, 255

    def __init__(self, *, armed: bool = True) -> None:
        self.now_s, self.time_s = NOW_S, 0.0
        self.autopilot = Autopilot(
            config_of(armed=armed), CalmWind(), signing=Signing(KEY), unix_time=lambda: self.now_s
        )
        self.counters = self.autopilot.counters

    def hears(self, frame: bytes) -> bool:
        before = self.autopilot.truth()
        answer = self.autopilot.receive(frame)
        assert answer or self.autopilot.truth() == before
        return answer != b""

    def says(self) -> bytes:
        self.time_s += 1.0
        return self.autopilot.advance(self.time_s)


Ear = Companion | Emulator


@pytest.fixture(params=[Companion, Emulator])
def ear(request: pytest.FixtureRequest) -> Ear:
    found: Ear = request.param()
    return found


def sender(ear: Ear, key: bytes | None, at_s: float, *, link_id: int = 0) -> mavlink.MAVLink:
    return signing_sender(key, at_s, system_id=ear.speaker, component_id=1, link_id=link_id)


def signed(ear: Ear, key: bytes | None, at_s: float, *, link_id: int = 0) -> bytes:
    return bytes(ear.message.pack(sender(ear, key, at_s, link_id=link_id)))


def test_who_has_the_key_is_heard_and_not_twice(ear):
    frame = signed(ear, KEY, NOW_S)
    assert ear.hears(frame)
    # Played back.
    assert not ear.hears(frame)


@pytest.mark.parametrize("key", [None, OTHER_KEY])
def test_an_unsigned_or_wrongly_signed_packet_is_not_heard(ear, key):
    assert not ear.hears(signed(ear, key, NOW_S))
    assert ear.counters["not signed"] == 1


def test_a_mavlink_1_packet_is_not_heard(ear):
    assert not ear.hears(packed(ear.message, system_id=ear.speaker, component_id=1, version_1=True))


def test_a_recording_of_a_stream_not_heard_before_is_not_heard(ear):
    assert not ear.hears(signed(ear, KEY, NOW_S - 61.0))
    assert ear.hears(signed(ear, KEY, NOW_S - 59.0))


def test_a_forged_packet_from_the_future_shuts_nobody_out(ear):
    true_sender = sender(ear, KEY, NOW_S)
    assert ear.hears(bytes(ear.message.pack(true_sender)))
    assert not ear.hears(signed(ear, OTHER_KEY, NOW_S + 50.0 * YEAR_S))
    assert ear.hears(bytes(ear.message.pack(true_sender)))
    assert ear.hears(signed(ear, KEY, NOW_S + 1.0, link_id=9))


@given(st.sampled_from([Companion, Emulator]), st.integers(0, 255), st.integers(1, 255))
def test_no_change_of_a_signed_frame_is_heard(kind, position, bits):
    ear = kind()
    frame = bytearray(signed(ear, KEY, NOW_S))
    frame[position % len(frame)] ^= bits
    assert not ear.hears(bytes(frame))


def test_time_stamps_follow_the_clock_and_never_repeat(ear):
    def stamps() -> list[int]:
        said = filter(None, frames_of(ear.says()))
        return [int.from_bytes(frame.content[-12:-6], "little") for frame in said]

    first = stamps() + stamps()
    assert len(set(first)) == len(first) >= 6
    ear.now_s += 3600.0
    assert stamps()[0] == pytest.approx(signing_ticks(ear.now_s), abs=10)


def test_what_is_said_is_signed_so_that_pymavlink_itself_believes_it(ear):
    listener = mavlink.MAVLink(None)
    listener.signing.secret_key = KEY
    heard = listener.parse_buffer(ear.says())
    assert len(heard) >= 3
    assert all(message.get_signed() for message in heard)
    # Speaking does not change how is listened: the key is not pymavlink's to check with.
    assert ear.hears(signed(ear, KEY, NOW_S))
    assert not ear.hears(signed(ear, OTHER_KEY, NOW_S + YEAR_S))


def test_without_a_key_a_signature_is_passed_over():
    assert len(Codec(7, 1).decode(signed(Companion(), OTHER_KEY, NOW_S))) == 1


def test_the_emulator_is_given_a_key_on_the_ground_and_not_in_the_air():
    new_key = mavlink.MAVLink_setup_signing_message(7, 1, list(OTHER_KEY), 0)
    for standing in (False, True):
        ear = Emulator(armed=not standing)
        link = sender(ear, KEY, NOW_S)
        ear.autopilot.receive(bytes(new_key.pack(link)))
        assert ear.hears(bytes(GUIDED.pack(link))) is not standing
        assert ear.hears(signed(ear, OTHER_KEY, NOW_S + 1.0)) is standing


def test_the_emulators_key_is_hexadecimal_or_a_passphrase_as_ground_stations_take_it():
    assert key_of(KEY.hex()) == KEY
    for phrase in ("open sesame", "z" * 64):
        assert key_of(phrase) == hashlib.sha256(phrase.encode()).digest()
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short")
    assert ticks_of(EPOCH_UNIX_S + 1.0) == 100_000


def test_a_key_is_64_hexadecimal_digits_and_a_wrong_one_is_not_repeated():
    assert signing_key(f" {KEY.hex()}\n") == KEY
    for wrong in ("", "secret", KEY.hex()[2:], "z" * 64):
        with pytest.raises(InputError) as caught:
            signing_key(wrong)
        assert not wrong or wrong not in str(caught.value)
