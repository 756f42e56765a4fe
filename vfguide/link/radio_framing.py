"""Packets on a stream of bytes that arrive cut and damaged: COBS, with a checksum.

A packet and its CRC-16 (CCITT, u16, little-endian) are stuffed by COBS (Cheshire and Baker, "Consistent
Overhead Byte Stuffing", 1999), which takes the zeros out for one byte more, and stand between zeros. A zero
therefore always is an end: what is left of a damaged packet, with or without its own zero, costs no other.
"""

import binascii
import struct
from collections import Counter

OVERHEAD = 5
"""Bytes that a packet takes more on the wire: checksum, stuffing and two zeros."""

LARGEST_PACKET = 59
"""Bytes: all of a packet is at most 64 on the wire."""

LARGEST_FRAME = LARGEST_PACKET + OVERHEAD

DAMAGED = "damaged on the air"
"""Why bytes are left out that are no packet."""

CHECKSUM = struct.Struct("<H")


def encode_frame(packet: bytes) -> bytes:
    """A packet as it goes onto the wire.

    Raises:
        ValueError: it is too long.
    """
    if not 0 < len(packet) <= LARGEST_PACKET:
        raise ValueError(f"{len(packet)} bytes are no packet: at most {LARGEST_PACKET}")
    content = packet + CHECKSUM.pack(binascii.crc_hqx(packet, 0xFFFF))
    return b"\0" + stuffed(content) + b"\0"


def decode_frame(frame: bytes) -> bytes | None:
    """The packet in what stood between two zeros; None where it is damaged."""
    content = unstuffed(frame)
    if content is None or not CHECKSUM.size < len(content) <= LARGEST_PACKET + CHECKSUM.size:
        return None
    packet = content[: -CHECKSUM.size]
    (expected,) = CHECKSUM.unpack_from(content, len(packet))
    return packet if binascii.crc_hqx(packet, 0xFFFF) == expected else None


def stuffed(content: bytes) -> bytes:
    """Bytes without zeros, of less than 254: each zero becomes the distance to the next."""
    return b"".join(bytes([len(part) + 1]) + part for part in content.split(b"\0"))


def unstuffed(data: bytes) -> bytes | None:
    """What was stuffed; None where it cannot have been."""
    parts, place = [], 0
    while place < len(data):
        end = place + data[place]
        if data[place] == 0 or end > len(data):
            return None
        parts.append(data[place + 1 : end])
        place = end
    return b"\0".join(parts) if parts else None


class Framer:
    """Cuts a stream into packets."""

    def __init__(self, counters: Counter[str]) -> None:
        """Begin anywhere in the stream.

        Args:
            counters: what was left out is counted here.
        """
        self._counters = counters
        self._buffer = bytearray()
        self._skips = False

    def feed(self, data: bytes) -> list[bytes]:
        """Take the next bytes; the packets that they complete, in order."""
        packets = []
        *ended, rest = data.split(b"\0")
        for part in ended:
            self._keep(part)
            frame, skipped = bytes(self._buffer), self._skips
            self._buffer.clear()
            self._skips = False
            if not frame and not skipped:
                continue
            packet = None if skipped else decode_frame(frame)
            if packet is None:
                self._counters[f"refused: {DAMAGED}"] += 1
            else:
                packets.append(packet)
        self._keep(rest)
        return packets

    def clear(self) -> None:
        """Forget what has begun: the stream starts anew."""
        self._buffer.clear()
        self._skips = False

    def _keep(self, part: bytes) -> None:
        """Add to the packet that has begun; what is longer than any packet is noise up to the next zero."""
        if len(self._buffer) + len(part) > LARGEST_FRAME:
            self._buffer.clear()
            self._skips = True
        if not self._skips:
            self._buffer += part
