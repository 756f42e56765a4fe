"""Binary codec of orders and replies to them: compact, versioned, bounded and checked.

All is little-endian and ends with the CRC-32 (u32) of all before it. An order is a whole arrangement. It
begins with "VFOR", version (u8), manoeuvre (u8), flags (u8) and number of followers (u8). Number (u32), time
(f64, s), time to climb and time across (f32, s) follow. Flags: 1 a circle, 2 flown clockwise, 8 another
leader, 16 another path.

- A circle has its centre (f64, degrees) and its radius (f32, m).
- Another path has the radius of the turns onto it (f32, m), the CRC-32 of what it follows from (u32) and its
  name.
- Another leader has its name.
- Each follower has its name and seven numbers (i16, 0.1 m): begin and end of its slot, each forward, right
  and up, and the layer (-32768 for none).

A name is its length (u8) and its text (UTF-8).

A reply has "VFRY", version (u8), verdict (u8), length of the text (u8), a byte of zero, number (u32), the
order's CRC-32 (u32) and the text (UTF-8). The order's CRC-32 tells two orders of one number apart.
"""

import math
import struct
from enum import IntEnum
from typing import Any

import msgspec

from vfguide.formation.arrangement import (
    MAIN_PATH,
    Arrangement,
    HoldCircle,
    Manoeuvre,
    Point,
    SlotMove,
)
from vfguide.link.codec import CHECKSUM, GREATEST_TIME_S, LinkDataError, opened, sealed

ORDER_MAGIC, REPLY_MAGIC = b"VFOR", b"VFRY"
VERSION = 2
HEADER = struct.Struct("<4sBBBBIdff")
CIRCLE = struct.Struct("<ddf")
PATH = struct.Struct("<fI")
OFFSETS = struct.Struct("<7h")
REPLY = struct.Struct("<4sBBBxII")

STEP_M = 0.1
"""Resolution of slots, m."""

NO_LAYER = -32768

HAS_CIRCLE, CLOCKWISE, HAS_LEAD, HAS_PATH = 1, 2, 8, 16
"""Flags of an order. 4 was another path without its CRC-32: no path is taken up by its name alone."""

LONGEST_S = 3600.0
"""Maximum duration of a climb, and of a motion across, s."""

RADII_M = (20.0, 20e3)
"""Minimum and maximum radius of a circle, and of the turns onto a path, m."""

LARGEST = 3800
"""Maximum size of an order, bytes: with its envelope it fits into another envelope."""

LONGEST_NAME, LONGEST_TEXT = 100, 200
"""Maximum lengths of a name and of a reply's text, bytes."""


class Verdict(IntEnum):
    """Reply of a vehicle to an order."""

    READY = 1
    """The vehicle can and will fly the order, once the leader says so."""
    REFUSED = 2
    """The vehicle cannot fly the order; the text says why."""
    FLOWN = 3
    """The vehicle flies the order."""
    VOID = 4
    """The order was not confirmed in time; the text says why, if that is known."""
    UNKNOWN = 5
    """An operator knows no order newer than this number, and asks for the order that is flown."""


class Reply(msgspec.Struct, frozen=True, kw_only=True):
    """Reply to an order."""

    number: int
    verdict: Verdict
    check: int = 0
    """CRC-32 at the end of the order's bytes; 0 where none is known."""
    text: str = ""
    """Reason, in one sentence."""


def encode_order(order: Arrangement) -> bytes:
    """Encode an arrangement.

    Raises:
        ValueError: it has too many followers, a name is too long, or a number is out of its range.
    """
    circle = order.circle
    flags = 0 if circle is None else HAS_CIRCLE | (CLOCKWISE if circle.clockwise else 0)
    said = order.path != MAIN_PATH or order.turn_radius_m > 0.0 or order.path_check != 0
    flags |= (HAS_PATH if said else 0) | (HAS_LEAD if order.lead else 0)
    try:
        body = HEADER.pack(
            ORDER_MAGIC,
            VERSION,
            order.flown,
            flags,
            len(order.places),
            order.number,
            order.time_s,
            order.climb_s,
            order.across_s,
        )
        if circle is not None:
            body += CIRCLE.pack(circle.latitude_deg, circle.longitude_deg, circle.radius_m)
        if said:
            body += PATH.pack(order.turn_radius_m, order.path_check) + _name_bytes(order.path)
        if order.lead:
            body += _name_bytes(order.lead)
        body += b"".join(_place_bytes(place) for place in order.places)
    except (struct.error, OverflowError) as error:
        raise ValueError(f"the order cannot be put into bytes: {error}") from None
    if len(body) + CHECKSUM.size > LARGEST:
        raise ValueError(f"an order of {len(body)} bytes is too long: name vehicles shorter")
    return sealed(body)


def check_of(data: bytes) -> int:
    """Return the CRC-32 at the end of an order's bytes."""
    return int(CHECKSUM.unpack(data[-CHECKSUM.size :])[0])


def rounded(point: Point) -> Point:
    """Return a point rounded to the resolution of an order."""
    return Point(*(round(value / STEP_M) * STEP_M for value in _values(point)))


def decode_order(data: bytes) -> Arrangement:
    """Decode an arrangement.

    Raises:
        LinkDataError: the bytes are none, are damaged, or a value is out of its range.
    """
    least = HEADER.size + CHECKSUM.size
    body = opened(data, ORDER_MAGIC, VERSION, what="an order", least=least, most=LARGEST)
    _, _, flown, flags, count, number, time_s, climb_s, across_s = HEADER.unpack_from(body)
    if number == 0 or flags & ~(HAS_CIRCLE | CLOCKWISE | HAS_PATH | HAS_LEAD):
        raise LinkDataError("the order's number or flags are none")
    # Not written with "beyond": a comparison with NaN is always false.
    lasts = all(0.0 <= one <= LONGEST_S for one in (climb_s, across_s))
    if not (lasts and abs(time_s) <= GREATEST_TIME_S):
        raise LinkDataError("a time of the order is out of range")
    try:
        what = Manoeuvre(flown)
        options, offset = _options(body, HEADER.size, flags)
        places = []
        for _ in range(count):
            place, offset = _place(body, offset)
            places.append(place)
    except (struct.error, ValueError, IndexError) as error:
        raise LinkDataError(f"no order: {error}") from None
    if offset != len(body) or len({place.vehicle for place in places}) != count:
        raise LinkDataError("the order's followers do not fit")
    if (what is Manoeuvre.HOLD) is not ("circle" in options):
        raise LinkDataError("a circle belongs to a hold, and only there")
    return Arrangement(
        number=number,
        time_s=time_s,
        flown=what,
        climb_s=climb_s,
        across_s=across_s,
        places=tuple(places),
        **options,
    )


def encode_reply(reply: Reply) -> bytes:
    """Encode a reply; a text that is too long loses its end."""
    text = reply.text.encode()[:LONGEST_TEXT].decode(errors="ignore").encode()
    body = REPLY.pack(REPLY_MAGIC, VERSION, reply.verdict, len(text), reply.number, reply.check)
    body += text
    return sealed(body)


def decode_reply(data: bytes) -> Reply:
    """Decode a reply; raise LinkDataError if the bytes are none."""
    least = REPLY.size + CHECKSUM.size
    body = opened(
        data, REPLY_MAGIC, VERSION, what="an answer", least=least, most=least + LONGEST_TEXT
    )
    _, _, verdict, length, number, check = REPLY.unpack_from(body)
    text = body[REPLY.size :]
    if len(text) != length:
        raise LinkDataError("an answer whose text does not fit")
    try:
        return Reply(number=number, verdict=Verdict(verdict), check=check, text=text.decode())
    except ValueError:
        raise LinkDataError("an answer whose verdict or text is none") from None


def _values(point: Point) -> tuple[float, float, float]:
    return point.forward, point.right, point.up


def _name_bytes(name: str) -> bytes:
    data = name.encode()
    if not 0 < len(data) <= LONGEST_NAME:
        raise ValueError(f"the name {name!r} is too long for an order")
    return bytes([len(data)]) + data


def _name(body: bytes, offset: int) -> tuple[str, int]:
    """Return (name, offset behind it)."""
    end = offset + 1 + body[offset]
    if not 0 < end - offset - 1 <= LONGEST_NAME or end > len(body):
        raise ValueError("a name without an end, or none")
    return body[offset + 1 : end].decode(), end


def _place_bytes(place: SlotMove) -> bytes:
    numbers = [round(value / STEP_M) for value in (*_values(place.begin), *_values(place.end))]
    layer = NO_LAYER if place.layer is None else round(place.layer / STEP_M)
    return _name_bytes(place.vehicle) + OFFSETS.pack(*numbers, layer)


def _place(body: bytes, offset: int) -> tuple[SlotMove, int]:
    name, end = _name(body, offset)
    *values, layer = OFFSETS.unpack_from(body, end)
    numbers = [value * STEP_M for value in values]
    place = SlotMove(
        vehicle=name,
        begin=Point(*numbers[:3]),
        end=Point(*numbers[3:]),
        layer=None if layer == NO_LAYER else layer * STEP_M,
    )
    return place, end + OFFSETS.size


def _options(body: bytes, offset: int, flags: int) -> tuple[dict[str, Any], int]:
    """Return (optional fields of the arrangement that the flags announce, offset behind them)."""
    found: dict[str, Any] = {}
    if flags & HAS_CIRCLE:
        found["circle"] = _circle(body, offset, clockwise=bool(flags & CLOCKWISE))
        offset += CIRCLE.size
    if flags & HAS_PATH:
        radius, found["path_check"] = PATH.unpack_from(body, offset)
        found["path"], offset = _name(body, offset + PATH.size)
        stays = found["path"] == MAIN_PATH and radius == 0.0
        if not (stays or RADII_M[0] <= radius <= RADII_M[1]):
            raise ValueError("turns onto a path that nobody can fly")
        found["turn_radius_m"] = radius
    if flags & HAS_LEAD:
        found["lead"], offset = _name(body, offset)
    return found, offset


def _circle(body: bytes, offset: int, *, clockwise: bool) -> HoldCircle:
    latitude, longitude, radius = CIRCLE.unpack_from(body, offset)
    on_earth = abs(latitude) <= 90.0 and abs(longitude) <= 180.0
    if not (on_earth and RADII_M[0] <= radius <= RADII_M[1]) or math.isnan(latitude + longitude):
        raise ValueError("a circle that is nowhere on the earth")
    return HoldCircle(
        latitude_deg=latitude, longitude_deg=longitude, radius_m=radius, clockwise=clockwise
    )
