"""Orders and answers as bytes: what goes in comes out, and nothing else is read."""

import math
import struct
from contextlib import suppress

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.link import sealed
from tests.kit.states import GREATEST, leader_message
from vfguide.formation.arrangement import Arrangement, HoldCircle, Manoeuvre, Point, SlotMove
from vfguide.link.codec import (
    Ask,
    LeaderMessage,
    LeaderSighting,
    LinkDataError,
    Tell,
    decode,
    decode_ask,
    decode_tell,
    encode,
    encode_ask,
    encode_tell,
)
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    decode_order,
    decode_reply,
    encode_order,
    encode_reply,
)

ASK = Ask(number=7, originate_s=1.5)
TELL = Tell(number=7, originate_s=1.5, receive_s=3.5, transmit_s=3.75)
TIMES = st.floats(-1e10, 1e10)

MESSAGES = [
    (encode(leader_message()), decode),
    (encode(leader_message(sighting=LeaderSighting(0.0, 1.0, 2.0, 3.0))), decode),
    (encode(leader_message(satellite_m=1.0)), decode),
    (encode_ask(ASK), decode_ask),
    (encode_tell(TELL), decode_tell),
]
"""A message of each kind, and what reads it."""

SOUND = st.builds(
    LeaderMessage,
    sequence=st.integers(0, 2**32 - 1),
    time_s=st.floats(allow_nan=False, allow_infinity=False),
    term=st.integers(0, 2**32 - 1),
    arrangement=st.integers(0, 2**32 - 1),
    steered=st.booleans(),
    height_sense=st.integers(-1, 1),
    **{name: st.floats(-bound, bound) for name, bound in GREATEST.items()},
)


@settings(deadline=None, derandomize=True, max_examples=300)
@given(message=SOUND)
def test_a_state_comes_out_as_it_went_in(message):
    # A course setpoint that is not known is NaN.
    assert repr(decode(encode(message))) == repr(message)


@settings(deadline=None, derandomize=True, max_examples=200)
@given(number=st.integers(0, 2**64 - 1), originate_s=TIMES, receive_s=TIMES, transmit_s=TIMES)
def test_questions_about_clocks_and_answers_come_out_as_they_went_in(
    number, originate_s, receive_s, transmit_s
):
    ask = Ask(number=number, originate_s=originate_s)
    tell = Tell(number=number, originate_s=originate_s, receive_s=receive_s, transmit_s=transmit_s)
    assert decode_ask(encode_ask(ask)) == ask
    assert decode_tell(encode_tell(tell)) == tell


def test_a_leader_state_is_104_bytes_laid_out_as_documented():
    data = encode(leader_message())
    assert len(data) == 104
    assert data[:12] == b"VFLS\x02\x00\x00\x00\x07\x00\x00\x00"
    assert struct.unpack("<10dII", data[12:100]) == (
        *(123.25, 47.397742, 8.545594, 588.0),
        *(0.5, 22.0, -0.25, 0.125, 0.0625, 3.0),
        *(2, 5),
    )
    assert data == sealed(data[:100])


@pytest.mark.parametrize(
    ("course", "steps"),
    [(math.nan, 0), (0.0, 1), (math.tau / 65535.0, 2), (-1e-9, 1), (3.2, 33378)],
)
def test_a_course_setpoint_is_told_in_steps_of_a_tenth_of_a_milliradian(course, steps):
    data = encode(leader_message(course_setpoint=course))
    assert struct.unpack_from("<H", data, 6) == (steps,)
    told = decode(data).course_setpoint
    assert math.isnan(told) if math.isnan(course) else abs(told - course) < 1e-4


@pytest.mark.parametrize(("sense", "flags"), [(0, 0x00), (1, 0x10), (-1, 0x20)])
def test_which_way_a_vehicle_leaves_its_height_is_told_in_two_flags(sense, flags):
    data = encode(leader_message(height_sense=sense))
    assert data[5] == flags
    assert decode(data).height_sense == sense


def test_where_the_leader_was_is_told_in_tenths_of_a_metre_and_milliseconds():
    seen = LeaderSighting(age_s=-0.012, north=20.0, east=-20.1, up=3276.7)
    data = encode(replace(leader_message(), sighting=seen))
    assert len(data) == 112
    assert data[5] == 0x04
    assert struct.unpack("<4h", data[100:108]) == (-12, 200, -201, 32767)
    assert decode(data).sighting == pytest.approx(seen)


@pytest.mark.parametrize(
    ("above", "tail"), [(1.234, b"\x7b\x00"), (-0.01, b"\xff\xff"), (327.68, b""), (math.nan, b"")]
)
def test_an_altitude_by_satellites_is_told_in_centimetres(above, tail):
    data = encode(replace(leader_message(), satellite_m=above))
    assert data[100:-4] == tail
    assert decode(data).satellite_m == pytest.approx(
        round(above, 2) if tail else math.nan, nan_ok=True
    )


@pytest.mark.parametrize("far", [3276.8, -3277.0, math.nan, math.inf])
def test_a_leader_that_is_too_far_away_is_not_told(far):
    seen = LeaderSighting(age_s=0.0, north=far, east=0.0, up=0.0)
    data = encode(replace(leader_message(), sighting=seen))
    assert len(data) == 104
    assert decode(data).sighting is None


@pytest.mark.parametrize("tells", [True, False])
def test_a_flag_that_the_size_contradicts_is_refused(tells):
    seen = LeaderSighting(age_s=0.0, north=0.0, east=0.0, up=0.0)
    data = encode(replace(leader_message(), sighting=None if tells else seen))
    body = bytearray(data[:-4])
    body[5] ^= 0x04
    with pytest.raises(LinkDataError, match="than its flags say"):
        decode(sealed(bytes(body)))


def test_questions_about_clocks_are_28_bytes_and_answers_44_laid_out_as_documented():
    head = b"\x02\x00\x00\x00" + struct.pack("<Q", 7)
    assert encode_ask(ASK) == sealed(b"VFCA" + head + struct.pack("<d", 1.5))
    assert encode_tell(TELL) == sealed(b"VFCT" + head + struct.pack("<3d", 1.5, 3.5, 3.75))
    assert (len(encode_ask(ASK)), len(encode_tell(TELL))) == (28, 44)


@pytest.mark.parametrize(("good", "decode"), MESSAGES)
def test_every_single_bit_flip_is_refused(good, decode):
    for bit in range(8 * len(good)):
        data = bytearray(good)
        data[bit // 8] ^= 1 << bit % 8
        with pytest.raises(LinkDataError):
            decode(bytes(data))


@pytest.mark.parametrize("size", [0, 1, 88, 100, 103, 115, 208])
def test_another_size_is_refused_with_both_sizes(size):
    data = (encode(leader_message()) * 2)[:size]
    with pytest.raises(LinkDataError, match=rf"^{size} bytes where a leader state has 104 to 114$"):
        decode(data)


def test_a_message_of_another_kind_is_refused():
    with pytest.raises(LinkDataError, match="not a leader state"):
        decode(sealed(b"VFLX" + encode(leader_message())[4:100]))
    with pytest.raises(LinkDataError, match="bytes"):
        decode_tell(encode_ask(ASK))
    with pytest.raises(LinkDataError, match="not a message about clocks"):
        decode_ask(sealed(b"VFCT" + encode_ask(ASK)[4:24]))


@pytest.mark.parametrize(("good", "decode"), MESSAGES)
@pytest.mark.parametrize("version", [0, 1, 3, 255])
def test_another_version_is_refused_by_its_number(good, decode, version):
    with pytest.raises(LinkDataError, match=f"version {version} .* speaks 2"):
        decode(sealed(good[:4] + bytes([version]) + good[5:-4]))


def test_damage_is_named():
    data = bytearray(encode(leader_message()))
    data[20] ^= 0x55
    with pytest.raises(LinkDataError, match="checksum"):
        decode(bytes(data))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.1e10])
def test_a_time_that_no_clock_shows_is_refused(value):
    with pytest.raises(LinkDataError, match="out of range"):
        decode_ask(encode_ask(Ask(number=1, originate_s=value)))
    with pytest.raises(LinkDataError, match="out of range"):
        decode_tell(encode_tell(Tell(number=1, originate_s=1.0, receive_s=value, transmit_s=1.0)))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("name", ["time_s", *GREATEST])
def test_a_value_that_is_not_finite_is_refused(name, value):
    with pytest.raises(LinkDataError, match="out of range"):
        decode(encode(leader_message(**{name: value})))


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", GREATEST)
def test_a_value_that_no_aircraft_has_is_refused(name, sign):
    bound = sign * GREATEST[name]
    assert getattr(decode(encode(leader_message(**{name: bound}))), name) == bound
    with pytest.raises(LinkDataError, match="out of range"):
        decode(encode(leader_message(**{name: math.nextafter(bound, sign * math.inf)})))


@pytest.mark.parametrize(("good", "decode"), MESSAGES)
@settings(deadline=None, derandomize=True, max_examples=500)
@example(data=b"")
@given(data=st.binary(max_size=120) | st.binary(min_size=104, max_size=104))
def test_random_bytes_are_refused_and_raise_nothing_else(good, decode, data):
    with pytest.raises(LinkDataError):
        decode(data[: len(good)])
    with pytest.raises(LinkDataError):
        decode(data)


@settings(deadline=None, derandomize=True, max_examples=500)
@given(sequence=st.integers(0, 2**32 - 1), values=st.binary(min_size=88, max_size=88))
def test_any_content_under_a_right_checksum_is_sound_or_refused(sequence, values):
    data = sealed(b"VFLS\x02\x00\x00\x00" + struct.pack("<I", sequence) + values)
    try:
        message = decode(data)
    except LinkDataError:
        return
    assert math.isfinite(message.time_s)
    assert all(abs(getattr(message, name)) <= bound for name, bound in GREATEST.items())


@pytest.mark.parametrize("flags", [0, 0xF0])
def test_no_flags_and_flags_that_are_not_known_yet_change_nothing(flags):
    """A sender that knows no flags counts as steered."""
    good = encode(leader_message())
    data = sealed(good[:5] + bytes([flags]) + good[6:100])
    assert repr(decode(data)) == repr(leader_message())
    assert decode(data).steered


HERE = Arrangement(number=4, time_s=5.0, across_s=10.0, places=())
OFFSETS = st.integers(-32000, 32000).map(lambda number: number * 0.1)
POINTS = st.builds(Point, OFFSETS, OFFSETS, OFFSETS)
NAMES = st.text(min_size=1, max_size=12)
PLACES = st.builds(SlotMove, vehicle=NAMES, begin=POINTS, end=POINTS, layer=st.none() | OFFSETS)
SECONDS = st.floats(0.0, 3600.0, width=32)
ORDERS = st.builds(
    Arrangement,
    number=st.integers(1, 2**32 - 1),
    time_s=st.floats(-1e9, 1e9),
    flown=st.sampled_from([Manoeuvre.FORMATION, Manoeuvre.ABORT]),
    climb_s=SECONDS,
    across_s=SECONDS,
    places=st.lists(PLACES, max_size=12, unique_by=lambda one: one.vehicle).map(tuple),
)


@given(ORDERS)
def test_an_order_survives_the_link(order):
    assert decode_order(encode_order(order)) == order


def test_a_hold_carries_its_circle():
    circle = HoldCircle(latitude_deg=47.4, longitude_deg=-8.5, radius_m=250.0, clockwise=False)
    order = replace(HERE, flown=Manoeuvre.HOLD, circle=circle)
    assert decode_order(encode_order(order)) == order


@given(
    st.text("abc-", min_size=1, max_size=32),
    st.integers(0, 2**32 - 1),
    st.floats(20.0, 2000.0, width=32),
    st.booleans(),
)
def test_another_path_and_who_is_to_lead_survive_the_link(path, check, radius_m, held):
    order = replace(
        HERE,
        places=(SlotMove(vehicle="f1", begin=Point(-20.0, 20.0), end=Point(-20.0, 20.0)),),
        path=path,
        path_check=check,
        turn_radius_m=radius_m,
        lead="f1" if held else "",
    )
    assert decode_order(encode_order(order)) == order


def test_who_is_to_lead_on_the_path_that_is_flown_has_its_check():
    order = replace(HERE, across_s=0.0, path_check=9, lead="f1")
    assert decode_order(encode_order(order)) == order
    with pytest.raises(LinkDataError, match="turns onto a path"):
        decode_order(encode_order(replace(order, path="survey")))


def test_a_path_by_its_name_alone_is_not_read_and_turns_onto_it_can_be_flown():
    body = bytearray(encode_order(replace(HERE, path="survey", turn_radius_m=50.0))[:-4])
    assert body[6] == 16
    # As an operator's program wrote it that knew no check of a path.
    body[6] = 4
    with pytest.raises(LinkDataError, match="flags"):
        decode_order(sealed(bytes(body)))
    with pytest.raises(LinkDataError, match="nobody can fly"):
        decode_order(encode_order(replace(HERE, path="survey", turn_radius_m=5.0)))


@given(st.builds(Reply, number=st.integers(1, 2**32 - 1), verdict=st.sampled_from(Verdict),
                 check=st.integers(0, 2**32 - 1), text=st.text(max_size=40)))  # fmt: skip
def test_an_answer_survives_the_link(reply):
    assert decode_reply(encode_reply(reply)) == reply


def test_a_long_text_loses_its_end_and_no_character_is_cut():
    reply = decode_reply(encode_reply(Reply(number=1, verdict=Verdict.REFUSED, text="ü" * 150)))
    assert reply.text == "ü" * 100


@given(st.binary(max_size=300))
def test_bytes_that_are_no_order_are_refused_and_nothing_else_happens(data):
    for read in (decode_order, decode_reply):
        for known in (b"", b"VFOR\x02\x01\x00\x01", b"VFRY\x02\x01\x04\x00"):
            body = known + data
            with pytest.raises(LinkDataError):
                read(body)
            with suppress(LinkDataError):
                read(sealed(body))


@given(ORDERS, st.data())
def test_a_damaged_order_is_refused(order, data):
    whole = bytearray(encode_order(order))
    place = data.draw(st.integers(0, len(whole) - 1))
    whole[place] ^= data.draw(st.integers(1, 255))
    with pytest.raises(LinkDataError):
        decode_order(bytes(whole))


def test_two_followers_of_one_name_are_no_order():
    place = SlotMove(vehicle="f1", begin=Point(0.0, 10.0), end=Point(0.0, 20.0))
    with pytest.raises(LinkDataError, match="followers do not fit"):
        decode_order(encode_order(replace(HERE, places=(place, place))))


def test_an_order_says_nothing_but_what_companions_heed():
    # Mark 4, version to followers 4, number 4, time 8, two durations 8, checksum 4.
    assert len(encode_order(HERE)) == 32
