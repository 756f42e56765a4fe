"""Telemetry logs: MAVLink's own file format, which ground stations and log viewers open.

Each frame follows the time at which it passed: microseconds since 1970 as eight bytes, big-endian.
"""

import struct
from pathlib import Path

TIMESTAMP = struct.Struct(">Q")
MAVLINK_2 = 0xFD
HEADER, CHECKSUM, SIGNATURE = 10, 2, 13
SIGNED = 0x01


class TelemetryLog:
    """Collects the datagrams of one connection, written all at once: a control loop waits for no disk."""

    def __init__(self, epoch_s: float) -> None:
        """Begin a log.

        Args:
            epoch_s: what time 0 of the flight is, in seconds since 1970.
        """
        self._epoch_s = epoch_s
        self._content = bytearray()

    def add(self, now: float, datagram: bytes) -> None:
        """Note a datagram of whole MAVLink 2 frames that passed at this time of the flight, s."""
        stamp = TIMESTAMP.pack(round((self._epoch_s + now) * 1e6))
        for frame in frames_of(datagram):
            self._content += stamp + frame

    def write(self, path: Path) -> None:
        """Write what was collected."""
        path.write_bytes(self._content)


def frames_of(datagram: bytes) -> list[bytes]:
    """The MAVLink 2 frames that a datagram is made of; what is none of them ends the list."""
    frames = []
    start = 0
    while start + HEADER <= len(datagram) and datagram[start] == MAVLINK_2:
        signature = SIGNATURE if datagram[start + 2] & SIGNED else 0
        end = start + HEADER + datagram[start + 1] + CHECKSUM + signature
        if end > len(datagram):
            break
        frames.append(datagram[start:end])
        start = end
    return frames
