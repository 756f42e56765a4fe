"""Messages of an autopilot in SI units, and its texts whole again where they come in parts."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed, position_report
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import (
    AirspeedReport,
    BatteryReport,
    CommandReport,
    HeartbeatReport,
    PositionReport,
    SensorsReport,
    TextReport,
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
        ({"lat": 900_000_000}, True),
        ({"lat": -900_000_000}, True),
        ({"lon": 1_800_000_000}, True),
        ({"lon": -1_800_000_000}, True),
        ({"lat": 0, "lon": 0}, True),
        ({"lat": 900_000_001}, False),
        ({"lat": -900_000_001}, False),
        ({"lon": 1_800_000_001}, False),
        ({"lon": -1_800_000_001}, False),
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


def test_each_byte_can_be_printed():
    for start in range(1, 256, 50):
        said = bytes(range(start, min(start + 50, 256)))
        message = mavlink.MAVLink_statustext_message(4, said)
        (text,) = texts(Codec(7, 1), framed(message))
        assert text.isprintable()


@given(st.lists(st.tuples(st.binary(max_size=50), st.integers(0, 3), st.integers(0, 255))))
def test_whatever_comes_it_can_be_printed(said):
    codec = Codec(7, 1)
    for raw, number, place in said:
        message = mavlink.MAVLink_statustext_message(4, raw, number, place)
        assert all(text.isprintable() for text in texts(codec, framed(message), BEAT))
