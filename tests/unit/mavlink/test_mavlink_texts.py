"""Texts of an autopilot: whole again where they come in parts, and bytes that are no text told as such."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.reports import TextReport

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


def test_parts_that_overtake_each_other_are_put_in_order():
    first, second, third = parts(LONG)
    assert texts(Codec(7, 1), third, first, second) == [LONG.decode()]


def test_a_part_that_is_lost_is_told_as_a_gap_after_two_heartbeats():
    codec, (first, _, third) = Codec(7, 1), parts(LONG)
    assert texts(codec, first, third, BEAT) == []
    assert texts(codec, BEAT) == [f"{LONG[:50].decode()}[...]{LONG[100:].decode()}"]


def test_a_text_whose_end_is_lost_ends_where_another_begins():
    first, *_ = parts(LONG)
    short = framed(mavlink.MAVLink_statustext_message(4, b"next", 0, 0))
    assert texts(Codec(7, 1), first, short) == [f"{LONG[:50].decode()}[...]", "next"]


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
