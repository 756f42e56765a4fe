"""TCP, called and calling."""

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

from vfguide.mavlink.address import NetworkAddress
from vfguide.mavlink.reconnecting import Dial
from vfguide.mavlink.status import Status
from vfguide.mavlink.stream import StreamPeer

SEND_BUFFER = 8 * 1024
"""Bytes in the kernel: by default it would take minutes of setpoints for a peer that does not read."""

LONGEST_SILENCE = 5_000
"""ms without an acknowledgement until a peer counts as gone: a pulled cable says no goodbye."""


def dial_tcp(address: NetworkAddress) -> Dial:
    """How to call this address."""

    async def dial(peer: StreamPeer) -> str:
        loop = asyncio.get_running_loop()
        transport, _ = await loop.create_connection(lambda: peer, address.host, address.port)
        tune(transport)
        return f"called {name_of(transport)}"

    return dial


def tune(transport: asyncio.BaseTransport) -> None:
    """Set a connection up for small, urgent messages."""
    peer = transport.get_extra_info("socket")
    # A peer that is gone already refuses settings; its loss is reported in a moment.
    with suppress(OSError):
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        peer.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, LONGEST_SILENCE)


def name_of(transport: asyncio.BaseTransport) -> str:
    """Of the peer, for people."""
    name = transport.get_extra_info("peername")
    return f"{name[0]} port {name[1]}" if name else "a peer that is gone"


class Caller(StreamPeer):
    """A peer that has called, and may be turned away."""

    def __init__(self, server: "TcpServer") -> None:
        super().__init__(server.receive, server.status.counters)
        self._server = server

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Become the peer, or be closed."""
        super().connection_made(transport)
        tune(transport)
        self._server.arrived(self, name_of(transport))

    def connection_lost(self, exc: Exception | None) -> None:
        """Make room for the next."""
        super().connection_lost(exc)
        self._server.left(self)


class TcpServer:
    """Waits to be called, and speaks to one peer at a time.

    A second peer that calls meanwhile is closed at once, so that a stray program cannot take the
    setpoints away. A peer is gone when it closes, or when it acknowledges nothing for 5 s.
    """

    def __init__(self, receive: Callable[[bytes], None], status: Status) -> None:
        self.receive = receive
        self.status = status
        self._peer: Caller | None = None
        self._callers: set[Caller] = set()

    def send(self, datagram: bytes) -> None:
        """Send to the peer, if there is one."""
        if self._peer is None:
            self.status.counters["dropped: not connected"] += 1
        else:
            self._peer.send(datagram)

    def arrived(self, caller: Caller, name: str) -> None:
        """Somebody has called."""
        self._callers.add(caller)
        if self._peer is None:
            self._peer = caller
            self.status.up(f"called by {name}")
        else:
            self.status.counters["turned away"] += 1
            caller.abort()

    def left(self, caller: Caller) -> None:
        """A caller is gone."""
        self._callers.discard(caller)
        if self._peer is caller:
            self._peer = None
            self.status.down(caller.lost.result())

    async def close(self) -> None:
        """Close whatever is open, and wait until it is."""
        callers = list(self._callers)
        for caller in callers:
            caller.abort()
        for caller in callers:
            await caller.close()


@asynccontextmanager
async def open_tcp_server(
    address: NetworkAddress, receive: Callable[[bytes], None], status: Status
) -> AsyncIterator[TcpServer]:
    """Listen at an address.

    Raises:
        OSError: this computer does not let it.
    """
    peers = TcpServer(receive, status)
    loop = asyncio.get_running_loop()
    # Not served in the same call: cancelled on the way, it would leave the port open.
    server = await loop.create_server(
        lambda: Caller(peers), address.host, address.port, start_serving=False
    )
    try:
        await server.start_serving()
        status.down("nobody has called yet")
        yield peers
    finally:
        server.close()
        await peers.close()
