"""Telemetry logs in MAVLink's own file format, which ground stations and log viewers open.

Each frame follows its time: microseconds since 1970 as eight bytes, big-endian. The format has no end mark
and no index, so a log truncated anywhere is valid up to there.
"""

import struct
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import NamedTuple

from vfguide.errors import InputError
from vfguide.mavlink.framing import Frame, end_of_frame, frame_at, frames_of
from vfguide.regular_file import open_regular

TIMESTAMP = struct.Struct(">Q")

GREATEST_SIZE = 2 * 1024**3
"""Maximum bytes; ten hours of a busy connection are 500 MB."""

EARLIEST_US, LATEST_US = 0, 4_102_444_800_000_000
"""Valid times: from 1970, as a computer without a clock battery starts with, to 2100."""

CHUNK = 1 << 20
LONGEST_ENTRY = TIMESTAMP.size + 10 + 255 + 2 + 13
"""Bytes of a time and the longest frame."""


class StampedFrame(NamedTuple):
    """A frame and its time."""

    time_s: float
    """Time, s since 1970, by the clock of the computer that wrote the log."""
    frame: Frame
    """Frame with an unverified checksum."""


def stamped(time_s: float, datagram: bytes) -> bytes:
    """Encode the frames of a datagram with its time (s since 1970) as log entries, without other bytes."""
    stamp = TIMESTAMP.pack(round(time_s * 1e6))
    return b"".join(stamp + one.content for one in frames_of(datagram) if one is not None)


class TelemetryLog:
    """Collects the datagrams of one connection in memory, for flights in virtual time."""

    def __init__(self, epoch_s: float) -> None:
        """Begin a log; time 0 of the flight is `epoch_s`, s since 1970."""
        self._epoch_s = epoch_s
        self._content = bytearray()

    def add(self, now: float, datagram: bytes) -> None:
        """Add a datagram that passed at a time of the flight, s."""
        self._content += stamped(self._epoch_s + now, datagram)

    def write(self, path: Path) -> None:
        """Write the log."""
        path.write_bytes(self._content)


def read_tlog(path: Path) -> Iterator[StampedFrame]:
    """Yield the frames of a log in order, skipping invalid bytes.

    Raises:
        InputError: the file cannot be read, or is larger than the log of a flight.
    """
    try:
        with open_regular(path) as stream:
            if stream.seek(0, 2) > GREATEST_SIZE:
                raise InputError(f"{path}: is larger than 2 GB; give the recording of one flight")
            stream.seek(0)
            waiting = b""
            while chunk := stream.read(CHUNK):
                waiting += chunk
                used = yield from _entries(waiting, len(waiting) - LONGEST_ENTRY)
                waiting = waiting[used:]
            yield from _entries(waiting, len(waiting))
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error


def _entries(content: bytes, limit: int) -> Generator[StampedFrame, None, int]:
    """Yield entries that begin up to the limit; return the position where the next search begins."""
    start = 0
    while start <= limit and start + TIMESTAMP.size < len(content):
        place = start + TIMESTAMP.size
        (stamp,) = TIMESTAMP.unpack_from(content, start)
        end = end_of_frame(content, place) if EARLIEST_US < stamp < LATEST_US else None
        if end is None or end > len(content):
            start += 1
        else:
            yield StampedFrame(stamp * 1e-6, frame_at(content, place, end))
            start = end
    return max(start, 0)
