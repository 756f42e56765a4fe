import math
import struct
import zlib
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.link.codec import (
    Ask,
    LinkDataError,
    Tell,
    decode_ask,
    decode_tell,
    encode_ask,
    encode_tell,
)

ASK = Ask(number=7, originate_s=1.5)
TELL = Tell(number=7, originate_s=1.5, receive_s=3.5, transmit_s=3.75)
NUMBERS = st.integers(0, 2**64 - 1)
TIMES = st.floats(-1e10, 1e10)
DECODERS: list[Callable[[bytes], object]] = [decode_ask, decode_tell]


def sealed(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


@settings(deadline=None, derandomize=True, max_examples=200)
@given(number=NUMBERS, originate_s=TIMES, receive_s=TIMES, transmit_s=TIMES)
def test_what_goes_in_comes_out(number, originate_s, receive_s, transmit_s):
    ask = Ask(number=number, originate_s=originate_s)
    tell = Tell(number=number, originate_s=originate_s, receive_s=receive_s, transmit_s=transmit_s)
    assert decode_ask(encode_ask(ask)) == ask
    assert decode_tell(encode_tell(tell)) == tell


def test_the_layout_is_as_documented():
    head = b"\x02\x00\x00\x00" + struct.pack("<Q", 7)
    assert encode_ask(ASK) == sealed(b"VFCA" + head + struct.pack("<d", 1.5))
    assert encode_tell(TELL) == sealed(b"VFCT" + head + struct.pack("<3d", 1.5, 3.5, 3.75))
    assert (len(encode_ask(ASK)), len(encode_tell(TELL))) == (28, 44)


@pytest.mark.parametrize(
    ("good", "decode"), [(encode_ask(ASK), decode_ask), (encode_tell(TELL), decode_tell)]
)
def test_every_single_bit_flip_is_refused(good, decode):
    for bit in range(8 * len(good)):
        data = bytearray(good)
        data[bit // 8] ^= 1 << bit % 8
        with pytest.raises(LinkDataError):
            decode(bytes(data))


def test_a_question_is_no_answer_and_an_answer_no_question():
    with pytest.raises(LinkDataError, match="bytes"):
        decode_tell(encode_ask(ASK))
    with pytest.raises(LinkDataError, match="not about clocks"):
        decode_ask(sealed(b"VFCT" + encode_ask(ASK)[4:24]))


def test_another_version_is_refused_by_its_number():
    with pytest.raises(LinkDataError, match=r"version 3 .* speaks 2"):
        decode_ask(sealed(b"VFCA\x03" + encode_ask(ASK)[5:24]))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1.1e10])
def test_a_time_that_no_clock_shows_is_refused(value):
    with pytest.raises(LinkDataError, match="out of range"):
        decode_ask(encode_ask(Ask(number=1, originate_s=value)))
    with pytest.raises(LinkDataError, match="out of range"):
        decode_tell(encode_tell(Tell(number=1, originate_s=1.0, receive_s=value, transmit_s=1.0)))


@pytest.mark.parametrize("decode", DECODERS)
@settings(deadline=None, derandomize=True, max_examples=300)
@given(data=st.binary(max_size=60))
def test_random_bytes_are_refused_and_raise_nothing_else(decode, data):
    with pytest.raises(LinkDataError):
        decode(data)
