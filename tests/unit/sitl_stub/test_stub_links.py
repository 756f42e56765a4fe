"""Who an emulator says it is: component, type of vehicle, number of its hardware."""

import hashlib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind, Signing
from sitl_stub.codec import EPOCH_UNIX_S, EmulatorFramer, key_of, ticks_of
from sitl_stub.links import SCHEMES, Address, AddressError, parse_address
from sitl_stub.settings import Settings
from tests.kit.autopilot import config_of, new_station
from tests.kit.wire import command_long, cut, of_type, packed, signing_sender, signing_ticks


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("udpin://192.168.1.2:14540", Address("udpin", "192.168.1.2", 14540)),
        ("udpout://companion_1.local:14550", Address("udpout", "companion_1.local", 14550)),
        ("tcpin://localhost:0", Address("tcpin", "localhost", 0)),
        ("tcpout://[::1]:5760", Address("tcpout", "::1", 5760)),
    ],
)
def test_an_address_is_read_and_written_alike(text, address):
    assert parse_address(text) == address
    assert str(address) == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "write one like udpin://"),
        ("14540", "write one like udpin://"),
        ("udpin://127.0.0.1", "write one like udpin://"),
        ("udpin://127.0.0.1:", "write one like udpin://"),
        ("udpin://127.0.0.1:1/path", "write one like udpin://"),
        ("udpin://127.0.0.1:14540\n", "write one like udpin://"),
        ("udpin://127.0.0.1:\u0661\u0662", "write one like udpin://"),
        ("udpin://::1:14540", "write one like udpin://"),
        ("udp://127.0.0.1:14540", "use one of udpin, udpout, tcpin, tcpout"),
        ("serial://ttyACM0:57600", "use one of udpin"),
        ("udpin://:14540", "no host"),
        ("udpin://a..b:14540", "no host"),
        ("udpin://" + "a" * 64 + ":14540", "no host"),
        ("udpin://[127.0.0.1]:14540", "no host"),
        ("udpin://host name:14540", "no host"),
        ("udpin://localhost:65536", "the highest is 65535"),
        ("udpout://localhost:0", "port 0"),
        ("x" * 10_000, "..."),
    ],
)
def test_a_wrong_address_is_refused_in_one_line_that_says_why(text, said):
    with pytest.raises(AddressError) as caught:
        parse_address(text)
    message = str(caught.value)
    assert said in message
    assert len(message.splitlines()) == 1
    assert len(message) < 500


near_misses = st.from_regex(r"(udp|tcp)(in|out)?:/?/?[\[\]a-z0-9.:%_-]*:?[0-9]*", fullmatch=True)


@given(st.text() | near_misses)
def test_any_text_is_an_address_or_refused_in_one_line(text):
    try:
        address = parse_address(text)
    except AddressError as error:
        refusal = str(error)
    else:
        refusal = ""
        assert address.scheme in SCHEMES
        assert 0 <= address.port <= 65_535
        assert parse_address(str(address)) == address
    assert len(refusal.splitlines()) <= 1


@given(st.sampled_from(SCHEMES), st.ip_addresses(), st.integers(1, 65_535))
def test_every_number_of_a_host_is_understood(scheme, number, port):
    host = f"[{number}]" if ":" in str(number) else str(number)
    address = parse_address(f"{scheme}://{host}:{port}")
    assert (address.scheme, address.host, address.port) == (scheme, str(number), port)


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


def test_it_says_its_type_and_number_and_speaks_as_its_component():
    station = new_station(component_id=2, vehicle_type=2, uid=77)
    said = station.advance(1.5)
    (beat, *_) = of_type(said, "HEARTBEAT")
    assert (beat.get_srcComponent(), beat.type) == (2, 2)
    answered = station.send(command_long(512, 148, system_id=7, component_id=2))
    (version,) = of_type(answered, "AUTOPILOT_VERSION")
    assert version.uid == 77


def test_numbers_of_a_fleet_count_up_and_none_stays_none():
    fleet = Settings.of({"system_id": 1, "mavlink": "udpout://h:1", "count": 2, "uid": 5})
    assert [fleet.config(index).uid for index in range(2)] == [5, 6]
    alone = Settings.of({"system_id": 1, "mavlink": "udpout://h:1"})
    assert (alone.config(1).uid, alone.config().component_id) == (0, 1)
    assert alone.config().vehicle_type == 1


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


@given(st.lists(st.tuples(st.integers(0, 60), st.integers(1, 255)), min_size=1, max_size=4))
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
