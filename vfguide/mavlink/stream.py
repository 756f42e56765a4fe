"""One peer at the other end of a stream: bytes in, whole frames out; never more waiting than is fresh."""

import asyncio
import select
import termios
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

from vfguide.mavlink.status import reason_of
from vfguide.mavlink.stream_framing import StreamFramer

LARGEST_BACKLOG = 2048
"""Bytes that may wait for a slow peer. More would only make setpoints old: at 57600 baud this is 0.36 s."""


class StreamPeer(asyncio.Protocol):
    """From the moment it is there until it is lost."""

    def __init__(self, receive: Callable[[bytes], None], counters: Counter[str]) -> None:
        """Make a peer that is not there yet.

        Args:
            receive: given all frames that came together, as one datagram.
            counters: of the connection; what is dropped is counted here.
        """
        self.lost: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        """Why it is gone, once it is."""
        self.heard = False
        """Whether it has sent a frame."""
        self._receive = receive
        self._counters = counters
        self._framer = StreamFramer()
        self._transport: asyncio.Transport | None = None
        self._poll = select.poll()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport; a serial port is one as much as a socket is."""
        if isinstance(transport, asyncio.Transport):
            self._transport = transport
            self._poll.register(file_number(transport), select.POLLOUT)

    def data_received(self, data: bytes) -> None:
        """Hand on the frames that these bytes complete, at once."""
        before = self._framer.counters.copy()
        frames = self._framer.feed(data)
        self._counters.update(self._framer.counters - before)
        if frames:
            self.heard = True
            self._receive(b"".join(frames))

    def connection_lost(self, exc: Exception | None) -> None:
        """The peer is gone, and the transport is closed."""
        self._transport = None
        if not self.lost.done():
            self.lost.set_result(reason_of(exc) if exc else "closed by the peer")

    def send(self, datagram: bytes) -> None:
        """Send, or drop it while the peer is slow."""
        if self._transport is None or self._transport.is_closing():
            self._counters["dropped: not connected"] += 1
        elif self._is_full(self._transport, len(datagram)):
            self._counters["dropped: slow peer"] += 1
        else:
            self._transport.write(datagram)

    async def close(self) -> None:
        """Close at once; what waits is not sent."""
        self.abort()
        if self._transport is not None:
            await asyncio.shield(self.lost)

    def abort(self) -> None:
        """Begin to close at once; what waits is not sent."""
        transport = self._transport
        # A serial port that is closing goes on sending what waits, perhaps for ever.
        if transport and not (transport.is_closing() and not transport.get_write_buffer_size()):
            discard_output(transport)
            transport.abort()

    def _is_full(self, transport: asyncio.Transport, size: int) -> bool:
        """Whether there is no room for some more bytes."""
        backlog = transport.get_write_buffer_size()
        if backlog:
            return backlog + size > LARGEST_BACKLOG
        # With nothing waiting the transport writes at once, and pyserial does not come back from a write
        # to a port that takes nothing.
        return not self._poll.poll(0)


def file_number(transport: asyncio.Transport) -> int:
    """Of the socket or the serial port."""
    medium = transport.get_extra_info("socket") or transport.get_extra_info("serial")
    return int(medium.fileno())


def discard_output(transport: asyncio.Transport) -> None:
    """Throw away what the kernel still holds for a serial port: closing would wait for it, up to 30 s."""
    port = transport.get_extra_info("serial")
    if port is not None:
        with suppress(OSError, termios.error):
            port.reset_output_buffer()
