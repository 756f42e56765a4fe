"""Where MAVLink frames begin and end in a datagram, and what their headers say.

A companion listens to five kinds of message from one sender. Reading the header first spares the work of
decoding all the others, which on a chatty connection is most of it.
"""

from collections.abc import Iterator
from typing import NamedTuple

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
HEADER_1, HEADER_2 = 6, 10
CHECKSUM, SIGNATURE = 2, 13
SIGNED = 0x01


class Frame(NamedTuple):
    """One frame; a tuple, since some are made for every report."""

    message_id: int
    """Number of the message."""
    system_id: int
    """Who says it has sent this."""
    component_id: int
    """Which part of it."""
    content: bytes
    """The whole frame."""


def frames_of(datagram: bytes) -> Iterator[Frame | None]:
    """Frames of a datagram in order, MAVLink 1 or 2; None for each stretch that belongs to no frame.

    What looks like a frame may still be none: the checksum is not looked at here.
    """
    start, size = 0, len(datagram)
    while start < size:
        end = end_of_frame(datagram, start)
        if end is None or end > size:
            yield None
            start = next_magic(datagram, start + 1)
        else:
            yield frame_at(datagram, start, end)
            start = end


def end_of_frame(datagram: bytes, start: int) -> int | None:
    """Where the frame that begins here ends, by its header; None where none begins.

    Flags that this reader does not know could change the layout: such a frame is to be dropped.
    """
    magic, size = datagram[start], len(datagram)
    if magic == MAGIC_2 and start + HEADER_2 <= size:
        flags = datagram[start + 2]
        signature = SIGNATURE if flags & SIGNED else 0
        if not flags & ~SIGNED:
            return start + HEADER_2 + datagram[start + 1] + CHECKSUM + signature
    elif magic == MAGIC_1 and start + HEADER_1 <= size:
        return start + HEADER_1 + datagram[start + 1] + CHECKSUM
    return None


def frame_at(datagram: bytes, start: int, end: int) -> Frame:
    """The frame between two places of a datagram."""
    if datagram[start] == MAGIC_1:
        system_id, component_id, message_id = datagram[start + 3 : start + HEADER_1]
    else:
        system_id, component_id, low, middle, high = datagram[start + 5 : start + HEADER_2]
        message_id = low | middle << 8 | high << 16
    return Frame(message_id, system_id, component_id, datagram[start:end])


def next_magic(datagram: bytes, start: int) -> int:
    """The next place from which a frame could begin, or the end."""
    places = (datagram.find(bytes([magic]), start) for magic in (MAGIC_1, MAGIC_2))
    return min((place for place in places if place >= 0), default=len(datagram))
