"""Telemetry logs: MAVLink's own file format, which ground stations and log viewers open.

Each frame follows the time at which it passed: microseconds since 1970 as eight bytes, big-endian.
"""

import struct
from pathlib import Path

from vfguide.mavlink.framing import frames_of

TIMESTAMP = struct.Struct(">Q")


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
        """Note a datagram that passed at this time of the flight, s."""
        stamp = TIMESTAMP.pack(round((self._epoch_s + now) * 1e6))
        for frame in frames_of(datagram):
            if frame is not None:
                self._content += stamp + frame.content

    def write(self, path: Path) -> None:
        """Write what was collected."""
        path.write_bytes(self._content)
