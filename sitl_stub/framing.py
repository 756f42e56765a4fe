"""Whole MAVLink frames out of a byte stream that may be cut anywhere."""

import re

from pymavlink.dialects.v20 import ardupilotmega as mavlink

MAGIC_1, MAGIC_2 = 0xFE, 0xFD
"""First byte of a MAVLink 1 and of a MAVLink 2 frame."""

MAGIC = re.compile(b"[\xfd\xfe]")

HEADER_1, HEADER_2 = 6, 10
"""Bytes before the payload."""

CHECKSUM = 2
"""Bytes after the payload."""

SIGNED, SIGNATURE = 0x01, 13
"""MAVLink 2: the flag of a signed frame, and the bytes that this adds."""


class StreamFramer:
    """Cuts one connection's bytes into frames.

    Only frames of known messages with a right checksum come out, so a byte of garbage that looks like
    the start of a frame costs itself alone and not the good frames behind it. It never holds back more
    than one frame (280 bytes).
    """

    def __init__(self) -> None:
        self._pending = b""

    def feed(self, data: bytes) -> bytes:
        """Take what arrived; returns the frames that are complete with it, one after the other."""
        stream = self._pending + data
        frames = []
        start = next_magic(stream, 0)
        while start < len(stream):
            length = frame_length(stream, start)
            if length is None:
                break
            if length == 0:
                start = next_magic(stream, start + 1)
                continue
            frames.append(stream[start : start + length])
            start = next_magic(stream, start + length)
        self._pending = stream[start:]
        return b"".join(frames)


def next_magic(stream: bytes, start: int) -> int:
    """Where a frame may begin, at `start` or after it; the end of the stream if nowhere."""
    match = MAGIC.search(stream, start)
    return len(stream) if match is None else match.start()


def frame_length(stream: bytes, start: int) -> int | None:
    """Length of the frame that begins at `start`: 0 if none does, None if more bytes must tell."""
    header = HEADER_2 if stream[start] == MAGIC_2 else HEADER_1
    if len(stream) < start + header:
        return None
    payload = stream[start + 1]
    flags = 0
    if header == HEADER_2:
        flags = stream[start + 2]
        message_id = int.from_bytes(stream[start + 7 : start + 10], "little")
    else:
        message_id = stream[start + 5]
    message = mavlink.mavlink_map.get(message_id)
    if message is None or flags not in {0, SIGNED} or payload > message.unpacker.size:
        return 0
    end = start + header + payload + CHECKSUM
    length = end - start + (SIGNATURE if flags else 0)
    if len(stream) < start + length:
        return None
    checksum = mavlink.x25crc(stream[start + 1 : end - CHECKSUM])
    checksum.accumulate(bytes((message.crc_extra,)))
    return length if checksum.crc == int.from_bytes(stream[end - CHECKSUM : end], "little") else 0
