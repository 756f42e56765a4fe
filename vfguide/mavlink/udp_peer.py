"""Whom a UDP socket listens to and answers."""

import math
from typing import Any

from vfguide.mavlink.framing import MAGIC_1, MAGIC_2

Endpoint = tuple[Any, ...]
"""Host and port as sockets give them; IPv6 adds more, which says nothing about who it is."""

PEER_SILENCE = 1.0
"""s that a peer must be silent before another may take its place."""


class UdpPeer:
    """One peer at a time: the one that was given, or else whoever spoke last, with an exception.

    Another peer takes over only when the present one has been silent for a second: a stray packet can
    neither draw the setpoints away nor pass for telemetry. What does not begin as MAVLink never takes over.
    """

    def __init__(self, given: Endpoint | None = None) -> None:
        """Make a peer.

        Args:
            given: the only one there may be; None for whoever speaks.
        """
        self.endpoint = given
        """Whom to answer; None before anybody has spoken."""
        self._is_given = given is not None
        self._heard = -math.inf

    def admits(self, source: Endpoint, datagram: bytes, now: float) -> bool:
        """Whether to listen to a datagram; its sender is then the peer.

        Args:
            source: who sent it.
            datagram: what.
            now: s, of a clock that never goes back.
        """
        present = self.endpoint
        if present is None or source[:2] != present[:2]:
            silence = now - self._heard
            if self._is_given or silence < PEER_SILENCE or not begins_frame(datagram):
                return False
            self.endpoint = source
        self._heard = now
        return True


def begins_frame(datagram: bytes) -> bool:
    """Whether the first byte is one that MAVLink frames begin with."""
    return bool(datagram) and datagram[0] in {MAGIC_1, MAGIC_2}
