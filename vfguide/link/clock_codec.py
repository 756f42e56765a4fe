"""Questions for the time of another computer's clock and their answers, as bytes.

Layout, little-endian: "VFCA" (ask) or "VFCT" (tell), version (u8), three bytes of zero, number of the
exchange (u64), then as f64 when the question left (s, clock of who asks), in an answer also when it arrived
and when the answer left (s, clock of who answers), then the CRC-32 of all that (u32). 28 and 44 bytes.

The number is random: an answer with it shows that the question was heard.
"""

import struct
import zlib
from dataclasses import dataclass

from vfguide.link.codec import LinkDataError

VERSION = 2
ASK, TELL = b"VFCA", b"VFCT"
ASK_LAYOUT = struct.Struct("<4sB3xQd")
TELL_LAYOUT = struct.Struct("<4sB3xQ3d")
CHECKSUM = struct.Struct("<I")

GREATEST_TIME_S = 1e10
"""Three hundred years: beyond that it is no clock's, and differences lose their microseconds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Ask:
    """What does your clock show?"""

    number: int
    """Of the exchange: 64 bits of chance."""
    originate_s: float
    """When the question left, s on the clock of who asks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tell:
    """What the clock shows."""

    number: int
    """Of the exchange, as it was asked."""
    originate_s: float
    """When the question left, as it was asked, s."""
    receive_s: float
    """When the question arrived, s on the clock of who answers."""
    transmit_s: float
    """When the answer left, s on the clock of who answers."""


def encode_ask(ask: Ask) -> bytes:
    """Bytes of a question."""
    return _sealed(ASK_LAYOUT.pack(ASK, VERSION, ask.number, ask.originate_s))


def encode_tell(tell: Tell) -> bytes:
    """Bytes of an answer."""
    stamps = (tell.originate_s, tell.receive_s, tell.transmit_s)
    return _sealed(TELL_LAYOUT.pack(TELL, VERSION, tell.number, *stamps))


def decode_ask(data: bytes) -> Ask:
    """Question of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    number, (originate_s,) = _opened(data, ASK, ASK_LAYOUT)
    return Ask(number=number, originate_s=originate_s)


def decode_tell(data: bytes) -> Tell:
    """Answer of these bytes.

    Raises:
        LinkDataError: they are none.
    """
    number, (originate_s, receive_s, transmit_s) = _opened(data, TELL, TELL_LAYOUT)
    return Tell(number=number, originate_s=originate_s, receive_s=receive_s, transmit_s=transmit_s)


def _sealed(body: bytes) -> bytes:
    return body + CHECKSUM.pack(zlib.crc32(body))


def _opened(data: bytes, mark: bytes, layout: struct.Struct) -> tuple[int, list[float]]:
    """Number of the exchange and stamps, all finite."""
    size = layout.size + CHECKSUM.size
    if len(data) != size:
        raise LinkDataError(f"{len(data)} bytes where {size} are due")
    found, version, number, *stamps = layout.unpack_from(data)
    if found != mark:
        raise LinkDataError("not about clocks")
    if version != VERSION:
        raise LinkDataError(f"version {version} where this companion speaks {VERSION}")
    if zlib.crc32(data[: layout.size]) != CHECKSUM.unpack_from(data, layout.size)[0]:
        raise LinkDataError("damaged: the checksum does not match")
    # Not "above": a comparison with NaN is false whichever way it is put.
    if not all(abs(stamp) <= GREATEST_TIME_S for stamp in stamps):
        raise LinkDataError("a time is out of range")
    return number, stamps
