"""Orders and answers as bytes: what goes in comes out, and nothing else is read."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.link import sealed
from vfguide.formation.arrangement import Arrangement, HoldCircle, Manoeuvre, Point, SlotMove
from vfguide.link.codec import LinkDataError
from vfguide.link.order_codec import (
    Reply,
    Verdict,
    decode_order,
    decode_reply,
    encode_order,
    encode_reply,
)

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
    for decode in (decode_order, decode_reply):
        for known in (b"", b"VFOR\x02\x01\x00\x01", b"VFRY\x02\x01\x04\x00"):
            body = known + data
            with pytest.raises(LinkDataError):
                decode(body)
            with suppress(LinkDataError):
                decode(sealed(body))


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
