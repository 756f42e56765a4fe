"""A stream that this side opens, and opens again for ever."""

import asyncio
from collections.abc import Awaitable, Callable
from random import Random

from vfguide.backoff import retry_delay
from vfguide.mavlink.status import Status, reason_of
from vfguide.mavlink.stream import StreamPeer

LONGEST_DIAL = 5.0
"""s, for one try: a host that is switched off never answers."""

Dial = Callable[[StreamPeer], Awaitable[str]]
"""Connects a peer, and tells what it is; raises OSError or ValueError when that does not work."""


class ReconnectingStream:
    """A connection to one peer that comes back by itself."""

    def __init__(
        self, dial: Dial, receive: Callable[[bytes], None], status: Status, random: Random
    ) -> None:
        self._dial = dial
        self._receive = receive
        self._status = status
        self._random = random
        self._peer: StreamPeer | None = None

    def send(self, datagram: bytes) -> None:
        """Send to the peer, if there is one."""
        if self._peer is None:
            self._status.counters["dropped: not connected"] += 1
        else:
            self._peer.send(datagram)

    async def run(self) -> None:
        """Keep the connection up until cancelled."""
        failures = 0
        while True:
            self._status.counters["tries"] += 1
            peer = StreamPeer(self._receive, self._status.counters)
            reason = await self._visit(peer)
            # A peer that takes calls and says nothing is no success: it may be turning callers away.
            failures = 1 if peer.heard else failures + 1
            self._status.down(reason)
            await asyncio.sleep(retry_delay(failures, self._random.random()))

    async def _visit(self, peer: StreamPeer) -> str:
        """One connection, from the call to the loss; why it ended."""
        try:
            async with asyncio.timeout(LONGEST_DIAL):
                name = await self._dial(peer)
            self._peer = peer
            self._status.up(name)
            return await asyncio.shield(peer.lost)
        except TimeoutError:
            return "no answer"
        except (OSError, ValueError) as error:
            return reason_of(error)
        finally:
            self._peer = None
            await peer.close()
