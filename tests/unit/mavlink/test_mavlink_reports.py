"""Messages of an autopilot, and of an aircraft without a companion, from bytes to SI units and back."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import astuple
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.states import leader_at
from tests.kit.wire import frame_of, framed, parsed, position_report, types_of
from vfguide.mavlink.codec import Codec, traffic_report
from vfguide.mavlink.leader_messages import (
    READERS,
    LeaderCodec,
    LeaderReport,
    follow_target_message,
)
from vfguide.mavlink.reports import (
    AirspeedReport,
    BatteryReport,
    CommandReport,
    HeartbeatReport,
    PositionReport,
    Report,
    SensorsReport,
    TextReport,
    TimeReport,
)


def test_a_position_is_converted_to_si_units(codec):
    message = mavlink.MAVLink_global_position_int_message(
        123_456, -339_000_001, 1_511_234_567, 588_123, 100_123, -1234, 567, -89, 9000
    )
    (report,) = codec.decode(framed(message))
    assert isinstance(report, PositionReport)
    assert report.boot_time_s == pytest.approx(123.456, abs=1e-9)
    place = (report.latitude_deg, report.longitude_deg)
    assert place == pytest.approx((-33.9000001, 151.1234567), abs=1e-11)
    assert report.altitude_amsl == pytest.approx(588.123, abs=1e-9)
    # The heading is not made from the velocity, nor the other way round.
    assert report.heading == pytest.approx(math.pi / 2, abs=1e-12)
    velocity = (report.velocity_north, report.velocity_east)
    assert velocity == pytest.approx((-12.34, 5.67), abs=1e-12)


def test_an_unknown_heading_is_none(codec):
    known, unknown = codec.decode(
        framed(position_report(hdg=65_534)) + framed(position_report(hdg=65_535))
    )
    assert known.heading is not None
    assert unknown.heading is None


@pytest.mark.parametrize(
    ("place", "delivered"),
    [
        ({"lat": 0, "lon": 0}, True),
        *(({"lat": 900_000_000 * side}, True) for side in (1, -1)),
        *(({"lon": 1_800_000_000 * side}, True) for side in (1, -1)),
        *(({"lat": 900_000_001 * side}, False) for side in (1, -1)),
        *(({"lon": 1_800_000_001 * side}, False) for side in (1, -1)),
        ({"lat": 2**31 - 1, "lon": 2**31 - 1}, False),
    ],
)
def test_a_position_off_the_earth_is_counted_and_not_delivered(codec, place, delivered):
    assert len(codec.decode(framed(position_report(**place)))) == delivered
    assert dict(codec.counters) == ({} if delivered else {"out of range": 1})


def hud(airspeed: float) -> bytes:
    return framed(mavlink.MAVLink_vfr_hud_message(airspeed, 27.0, 90, 50, 588.0, 1.0))


@pytest.mark.parametrize("airspeed", [0.0, 21.5, 500.0])
def test_the_airspeed_is_that_of_the_hud_and_not_its_ground_speed(codec, airspeed):
    expected = AirspeedReport(airspeed=airspeed, heading=math.radians(90.0))
    assert codec.decode(hud(airspeed)) == [expected]


@pytest.mark.parametrize("airspeed", [math.nan, math.inf, -math.inf, -0.1, 500.1, 3e38])
def test_what_is_no_airspeed_is_counted_and_not_delivered(codec, airspeed):
    assert codec.decode(hud(airspeed)) == []
    assert dict(codec.counters) == {"out of range": 1}


@pytest.mark.parametrize(("base_mode", "armed"), [(0b1000_0001, True), (0b0111_1111, False)])
def test_a_heartbeat_tells_autopilot_mode_and_arming(codec, base_mode, armed):
    message = mavlink.MAVLink_heartbeat_message(1, 3, base_mode, 15, 4, 3)
    assert codec.decode(framed(message)) == [
        HeartbeatReport(autopilot=3, custom_mode=15, armed=armed, status=4)
    ]


def test_the_heartbeat_of_something_that_is_no_autopilot_is_passed_over(codec):
    invalid = mavlink.MAV_AUTOPILOT_INVALID
    assert codec.decode(framed(mavlink.MAVLink_heartbeat_message(26, invalid, 0, 15, 4, 3))) == []
    assert codec.counters.total() == 1


@pytest.mark.parametrize(
    ("target", "ours"),
    [
        ((7, 191), True),  # this companion
        ((7, 0), True),  # every part of its system
        ((0, 0), True),  # everyone, and whoever does not name a target
        ((0, 190), True),
        ((255, 190), False),  # a ground station
        ((7, 192), False),  # another computer on board
        ((8, 191), False),  # another vehicle's companion
        ((8, 0), False),
    ],
)
def test_an_acknowledgement_counts_for_whom_it_is_addressed_to(codec, target, ours):
    message = mavlink.MAVLink_command_ack_message(43_002, mavlink.MAV_RESULT_DENIED, 0, 0, *target)
    assert codec.decode(framed(message)) == [CommandReport(command=43_002, result=2)] * ours
    assert dict(codec.counters) == ({} if ours else {"for somebody else": 1})


def test_an_acknowledgement_of_mavlink_1_has_no_target_and_counts(codec):
    # Command 176 and result 4 alone; the target is an extension. System 7, component 1, message 77.
    content = b"\x03\x00\x07\x01\x4d" + b"\xb0\x00\x04"
    extra = mavlink.MAVLink_command_ack_message.crc_extra
    checksum = mavlink.x25crc(content + bytes([extra])).crc
    data = b"\xfe" + content + checksum.to_bytes(2, "little")
    assert codec.decode(data) == [CommandReport(command=176, result=4)]


@pytest.mark.parametrize(
    ("sent", "told"),
    [
        ((87, 11_800), (0.87, 11.8)),
        ((0, 9_600), (0.0, 9.6)),
        # Unknown by the message set, not measured, and out of range.
        ((-1, 65_535), (None, None)),
        ((101, 0), (None, None)),
    ],
)
def test_the_battery_is_told_as_far_as_the_autopilot_knows_it(codec, sent, told):
    percent, millivolts = sent
    message = mavlink.MAVLink_sys_status_message(
        0, 0, 0, 0, millivolts, -1, percent, 0, 0, 0, 0, 0, 0
    )
    (report,) = codec.decode(framed(message))
    assert isinstance(report, SensorsReport)
    assert (report.battery, report.battery_voltage) == pytest.approx(told)


@pytest.mark.parametrize(
    ("cells", "percent", "told"),
    [
        ([4_000, 3_900, 4_100], 62, (0.62, 12.0)),
        # A whole battery in the first cell; twelve cells, of which the last two are extensions.
        ([11_800], -1, (None, 11.8)),
        ([4_000] * 12, 100, (1.0, 48.0)),
        ([], -1, (None, None)),
    ],
)
def test_each_battery_is_told_by_itself(codec, cells, percent, told):
    first, later = cells[:10], cells[10:]
    first += [65_535] * (10 - len(first))
    message = mavlink.MAVLink_battery_status_message(
        1, 0, 0, 32_767, first, -1, -1, -1, percent, 0, 0, later + [0] * (4 - len(later))
    )
    (report,) = codec.decode(framed(message))
    assert isinstance(report, BatteryReport)
    assert report.number == 1
    assert (report.remaining, report.voltage) == pytest.approx(told)


LONG = (
    b"PreArm: Compass not calibrated and the EKF yaw estimate is inconsistent by 46 degrees;"
    b" calibrate before flight"
)


def parts(text: bytes, number: int = 77) -> list[bytes]:
    """A text as an autopilot sends it."""
    starts = range(0, len(text) + 1, 50)
    return [
        framed(mavlink.MAVLink_statustext_message(2, text[at : at + 50], number, place))
        for place, at in enumerate(starts)
    ]


def texts(codec: Codec, *said: bytes) -> list[str]:
    found = [report for one in said for report in codec.decode(one)]
    return [report.text for report in found if isinstance(report, TextReport)]


BEAT = framed(mavlink.MAVLink_heartbeat_message(1, 3, 0, 0, 4, 3))


@pytest.mark.parametrize("text", [LONG, b"a" * 50, b"a" * 100, "46 \u00b0C ".encode() * 9])
def test_a_text_in_parts_is_one_text(text):
    assert texts(Codec(7, 1), *parts(text)) == [text.decode()]


FIRST, MIDDLE, LAST = parts(LONG)
NEXT = framed(mavlink.MAVLink_statustext_message(4, b"next", 0, 0))


@pytest.mark.parametrize(
    ("said", "told"),
    [
        # Parts that overtake each other are put in order.
        ([LAST, FIRST, MIDDLE], [LONG.decode()]),
        # A part that is lost is told as a gap, after two heartbeats and not before.
        ([FIRST, LAST, BEAT], []),
        ([FIRST, LAST, BEAT, BEAT], [f"{LONG[:50].decode()}[...]{LONG[100:].decode()}"]),
        # A text whose end is lost ends where another begins.
        ([FIRST, NEXT], [f"{LONG[:50].decode()}[...]", "next"]),
    ],
)
def test_parts_come_in_any_order_or_not_at_all(codec, said, told):
    assert texts(codec, *said) == told


@pytest.mark.parametrize(
    ("said", "text"),
    [
        (b"Temp 46\xb0C over \x1b[31mlimit", r"Temp 46\xb0C over \x1b[31mlimit"),
        (b"low\x1b[31m \x07battery\r\n\t\x7f!", r"low\x1b[31m \x07battery\r\n\t\x7f!"),
    ],
)
def test_bytes_that_are_no_text_are_shown_by_their_numbers(codec, said, text):
    message = mavlink.MAVLink_statustext_message(4, said, 0, 0)
    assert codec.decode(framed(message)) == [TextReport(severity=4, text=text)]


@given(st.lists(st.tuples(st.binary(max_size=50), st.integers(0, 3), st.integers(0, 255))))
def test_whatever_comes_it_can_be_printed(said):
    codec = Codec(7, 1)
    for raw, number, place in said:
        message = mavlink.MAVLink_statustext_message(4, raw, number, place)
        assert all(text.isprintable() for text in texts(codec, framed(message), BEAT))


def is_finite(report: Report) -> bool:
    return all(math.isfinite(value) for value in astuple(report) if isinstance(value, float))


HEARD = {0: 9, 33: 28, 74: 20, 77: 10, 253: 54}
"""What is listened to, with the full size of each payload."""

HEARD_FRAMES = st.sampled_from(sorted(HEARD)).flatmap(
    lambda message_id: st.binary(min_size=1, max_size=HEARD[message_id]).map(
        lambda payload: frame_of(message_id, payload)
    )
)


POSITION = framed(position_report())


@pytest.mark.parametrize(
    ("data", "counted"),
    [
        *(
            (framed(position_report(), system_id=system, component_id=part), "not this vehicle's")
            for system, part in ((8, 1), (7, 2), (0, 1), (7, 0), (255, 190))
        ),
        (framed(mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0)), "not used"),
        # The checksum of an unknown message is never looked at, so neither is anything else in it.
        (frame_of(0x01_ABCD, b"\x01\x02\x03", 0), "not used"),
        (POSITION[:-1] + bytes([POSITION[-1] ^ 0xFF]), "not MAVLink"),
    ],
)
def test_what_is_not_for_this_companion_is_counted_and_not_delivered(codec, data, counted):
    assert codec.decode(data) == []
    assert dict(codec.counters) == {counted: 1}


def test_garbage_before_a_frame_in_the_same_datagram_is_skipped_and_an_empty_one_is_nothing(codec):
    assert codec.decode(b"") == []
    assert not codec.counters
    assert len(codec.decode(b"\x00\x01garbage" + POSITION)) == 1
    assert dict(codec.counters) == {"not MAVLink": 1}


def test_no_frame_with_one_bit_flipped_is_delivered(codec):
    good = framed(position_report(vx=2000, vy=-300, hdg=4500))
    for bit in range(8 * len(good)):
        data = bytearray(good)
        data[bit // 8] ^= 1 << bit % 8
        assert codec.decode(bytes(data)) == []
    assert len(codec.decode(good)) == 1


def test_every_truncated_frame_is_counted_and_forgotten(codec):
    good = framed(position_report(vx=2000))
    for length in range(1, len(good)):
        before = codec.counters["not MAVLink"]
        assert codec.decode(good[:length]) == []
        assert codec.counters["not MAVLink"] > before
        # Neither half swallows, nor completes, what the next datagram holds.
        assert codec.decode(good[length:]) == []
        assert len(codec.decode(good)) == 1


@settings(deadline=None, derandomize=True)
@given(magic=st.sampled_from([b"\xfd", b"\xfe"]), garbage=st.binary(max_size=40))
def test_garbage_does_not_swallow_the_next_datagram(magic, garbage):
    codec = Codec(7, 1)
    codec.decode(magic + garbage)
    assert len(codec.decode(framed(position_report()))) == 1


@settings(deadline=None, derandomize=True, max_examples=300)
@given(data=st.binary(max_size=400))
def test_random_bytes_deliver_nothing_and_never_raise(data):
    assert Codec(7, 1).decode(data) == []


@settings(deadline=None, derandomize=True, max_examples=600)
@given(
    frames=st.lists(HEARD_FRAMES, min_size=1, max_size=4),
    changes=st.lists(st.tuples(st.integers(0, 500), st.integers(1, 255)), max_size=5),
)
def test_neither_sound_nor_mutated_frames_make_a_report_that_is_not_finite(frames, changes):
    data = bytearray(b"".join(frames))
    for place, change in changes:
        data[place % len(data)] ^= change
    codec = Codec(7, 1)
    reports = codec.decode(bytes(data))
    assert all(is_finite(report) for report in reports)
    assert len(reports) <= len(frames)
    assert changes or len(reports) + codec.counters.total() == len(frames)


def beat() -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)


def test_a_datagram_holds_all_messages_in_order_from_the_onboard_computer_of_the_vehicle(codec):
    assert codec.encode([]) == b""
    data = codec.encode([beat(), mavlink.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0), beat()])
    # MAVLink 2.
    assert data[0] == 0xFD
    assert types_of(parsed(data)) == ["HEARTBEAT", "ATTITUDE", "HEARTBEAT"]
    assert {(one.get_srcSystem(), one.get_srcComponent()) for one in parsed(data)} == {(7, 191)}


def test_sequence_numbers_are_consecutive_whatever_is_received_and_wrap_at_256(codec):
    numbers = []
    for _ in range(100):
        numbers += [message.get_seq() for message in parsed(codec.encode([beat()] * 3))]
        codec.decode(POSITION + b"\xfdgarbage")
    assert numbers == [number % 256 for number in range(300)]


def global_position(**values: int) -> MAVLink_message:
    return position_report(**({"time_boot_ms": 1500, "vx": 1200, "vy": -900} | values))


def target(**values: Any) -> MAVLink_message:
    fields = {key: [0.0, 0.0, 0.0] for key in ("acc", "rates", "position_cov")} | {
        "timestamp": 2500,
        "est_capabilities": 0b11,
        "lat": 473977420,
        "lon": 85455940,
        "alt": 588.0,
        "vel": [12.0, -9.0, 0.0],
        "attitude_q": [1.0, 0.0, 0.0, 0.0],
        "custom_state": 0,
    }
    return mavlink.MAVLink_follow_target_message(**(fields | values))


def adsb(**values: Any) -> MAVLink_message:
    fields = {
        "ICAO_address": 0x4B1900,
        "lat": 473977420,
        "lon": 85455940,
        "altitude_type": mavlink.ADSB_ALTITUDE_TYPE_GEOMETRIC,
        "altitude": 588_000,
        "heading": 9000,
        "hor_velocity": 3000,
        "ver_velocity": 0,
        "callsign": b"HB-CDE",
        "emitter_type": 1,
        "tslc": 2,
        "flags": 0b1111,
        "squawk": 7000,
    }
    return mavlink.MAVLink_adsb_vehicle_message(**(fields | values))


def one(message: MAVLink_message, codec: LeaderCodec | None = None) -> LeaderReport:
    (report,) = (codec or LeaderCodec(system_id=7)).decode(framed(message))
    assert isinstance(report, LeaderReport)
    return report


def refused(message: MAVLink_message) -> dict[str, int]:
    codec = LeaderCodec(system_id=7)
    assert codec.decode(framed(message)) == []
    return dict(codec.counters)


def high_latency(failures: int = 0) -> MAVLink_message:
    return mavlink.MAVLink_high_latency2_message(
        *(4500, 1, 3, 0, 473977420, 85455940, 588, 0, 45, 0, 0, 0, 100, 0, 75),
        *(0, 0, 0, 0, 0, 0, -1, 0, failures, 0, 0, 0),
    )


# Counts microseconds and metres per second.
COVARIANCE = mavlink.MAVLink_global_position_int_cov_message(
    3_500_000, 0, 473977420, 85455940, 588_000, 100_000, 12.0, -9.0, 0.0, [0.0] * 36
)


@pytest.mark.parametrize(
    ("message", "stamp_s", "velocity"),
    [
        (global_position(), 1.5, (12.0, -9.0)),
        (target(), 2.5, (12.0, -9.0)),
        # A follow target tells a velocity only where its bit says so.
        (target(est_capabilities=0b01), 2.5, None),
        (COVARIANCE, 3.5, (12.0, -9.0)),
        # Tells a place alone.
        (high_latency(), 4.5, None),
    ],
)
def test_each_message_is_read_in_si_units(message, stamp_s, velocity):
    report = one(message)
    place = (report.latitude_deg, report.longitude_deg, report.altitude_amsl)
    assert place == pytest.approx((47.397742, 8.545594, 588.0))
    assert report.stamp_s == pytest.approx(stamp_s)
    assert report.velocity == (velocity and pytest.approx(velocity))


def test_adsb_tells_its_course_and_how_old_it_is_but_no_time():
    report = one(adsb(), LeaderCodec(icao_address=0x4B1900))
    assert (report.stamp_s, report.age_s) == (None, 2.0)
    assert report.velocity == pytest.approx((0.0, 30.0), abs=1e-9)
    # A pressure altitude is none to keep clear by.
    by_pressure = one(adsb(altitude_type=0), LeaderCodec(icao_address=0x4B1900))
    assert math.isnan(by_pressure.altitude_amsl)


def test_altitude_of_another_aircraft_says_by_how_much_it_may_be_off():
    """An airliner at 10 km by air pressure is far above; a type that there is not says nothing."""
    airliner = traffic_report(adsb(altitude_type=0, altitude=10_000_000))
    assert (airliner.altitude_amsl, airliner.altitude_error) == (10_000.0, 500.0)
    geometric = traffic_report(adsb())
    assert (geometric.altitude_amsl, geometric.altitude_error) == (588.0, 0.0)
    for values in ({"altitude_type": 7}, {"altitude_type": 0, "flags": 0b1101}):
        assert math.isnan(traffic_report(adsb(**values)).altitude_amsl)


@pytest.mark.parametrize("values", [{"ICAO_address": 1}, {"flags": 0b1110}, {"tslc": 6}])
def test_adsb_of_another_aircraft_or_without_a_fresh_place_is_refused(values):
    assert LeaderCodec(icao_address=0x4B1900).decode(framed(adsb(**values))) == []


def test_any_component_of_the_aircraft_may_speak_and_no_other_system():
    codec = LeaderCodec(system_id=7)
    assert len(codec.decode(framed(target(), component_id=191))) == 1
    assert codec.decode(framed(global_position(), system_id=8)) == []
    assert codec.counters == {"of another system": 1}
    # Whoever passes ADS-B on.
    receiver = LeaderCodec(icao_address=0x4B1900)
    assert len(receiver.decode(framed(adsb(), system_id=200))) == 1


@pytest.mark.parametrize(
    "message",
    [
        global_position(lat=-(2**31), lon=-(2**31)),
        global_position(lat=2**31 - 1),
        global_position(lat=0, lon=0),
        target(est_capabilities=0),
        target(vel=[math.nan, 0.0, 0.0]),
        target(vel=[math.inf, 0.0, 0.0]),
        target(vel=[2000.0, 0.0, 0.0]),
        high_latency(mavlink.HL_FAILURE_FLAG_GPS),
    ],
)
def test_what_is_no_place_or_no_velocity_is_refused(message):
    assert refused(message) == {"out of range": 1}


@pytest.mark.parametrize("altitude", [math.nan, math.inf, -1e9, 1e9])
def test_altitude_that_no_aircraft_has_is_not_known(altitude):
    assert math.isnan(one(target(alt=altitude)).altitude_amsl)


def test_answers_about_the_time_are_read_and_questions_are_not():
    codec = LeaderCodec(system_id=7)
    answer, question = (mavlink.MAVLink_timesync_message(tc1, 123) for tc1 in (456, 0))
    assert codec.decode(framed(answer)) == [TimeReport(stamp=123, autopilot_ns=456)]
    assert codec.decode(framed(question)) == []


@given(st.binary(max_size=300))
def test_no_bytes_raise(data):
    LeaderCodec(system_id=7).decode(data)


@given(st.sampled_from(sorted(READERS)), st.binary(min_size=1, max_size=255))
def test_no_payload_raises_or_leads_to_numbers_that_are_none(number, payload):
    frame = frame_of(number, payload)
    for report in LeaderCodec(system_id=7).decode(frame):
        if isinstance(report, TimeReport):
            continue
        assert abs(report.latitude_deg) <= 90.0
        assert abs(report.longitude_deg) <= 180.0
        assert report.velocity is None or math.isfinite(math.hypot(*report.velocity))
        assert not math.isinf(report.altitude_amsl)


def test_own_follow_target_says_what_the_motion_is():
    motion = leader_at(time_s=12.5, course=math.pi / 2.0, acceleration=0.5, turn_rate=0.1)
    message = follow_target_message(
        motion, latitude_deg=47.0, longitude_deg=8.0, altitude_amsl=588.0, heading=math.pi / 2.0
    )
    # East at 20 m/s, faster by 0.5 m/s², turning right: 20 * 0.1 = 2 m/s² toward south.
    assert message.vel == pytest.approx([0.0, 20.0, 0.0], abs=1e-9)
    assert message.acc == pytest.approx([-2.0, 0.5, 0.0], abs=1e-9)
    assert message.attitude_q == pytest.approx([math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
    assert message.est_capabilities == 0b1111
    report = one(message)
    assert report.stamp_s == pytest.approx(12.5)
    assert (report.latitude_deg, report.longitude_deg) == pytest.approx((47.0, 8.0))
