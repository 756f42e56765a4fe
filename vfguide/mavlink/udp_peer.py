"""Whom a UDP socket listens to and answers."""

import math
from collections.abc import Callable
from typing import Any

from vfguide.mavlink.framing import MAGIC_1, MAGIC_2

Endpoint = tuple[Any, ...]
"""Host and port as sockets give them; IPv6 adds more, which says nothing about who it is."""

PEER_SILENCE = 1.0
"""s that a peer must be silent before another may take its place, unless something else is said."""


def begins_frame(datagram: bytes) -> bool:
    """Whether the first byte is one that MAVLink frames begin with."""
    return bool(datagram) and datagram[0] in {MAGIC_1, MAGIC_2}


class UdpPeer:
    """One peer at a time: the one that was given, or else the first that has introduced itself.

    It keeps its place while it speaks. Another takes over only after a silence, and by introducing itself as
    the first one did: a stray packet can neither draw the setpoints away nor pass for telemetry.
    """

    def __init__(
        self,
        given: Endpoint | None = None,
        *,
        introduces: Callable[[bytes], bool] = begins_frame,
        silence_s: float = PEER_SILENCE,
    ) -> None:
        """Make a peer.

        Args:
            given: the only one there may be; None for the first that introduces itself.
            introduces: whether a datagram does so for its sender.
            silence_s: how long the present peer must be silent before another may take its place, s.
        """
        self.endpoint = given
        """Whom to answer; None before anybody has introduced itself."""
        self.rival: Endpoint | None = None
        """The last that introduced itself while the present peer was speaking."""
        self._is_given = given is not None
        self._introduces = introduces
        self._silence_s = silence_s
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
            if self._is_given or not self._introduces(datagram):
                return False
            if now - self._heard < self._silence_s:
                self.rival = source
                return False
            self.endpoint, self.rival = source, None
        self._heard = now
        return True
