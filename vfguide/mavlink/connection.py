"""Connections to autopilots over UDP, TCP and serial ports, behind one interface.

Nothing waits in a queue here. Incoming frames are handed on from the event loop as they come. What cannot be
sent at once is soon dropped, since the next setpoint is better than an old one.
"""

import asyncio
import errno
import math
import os
import selectors
import socket
from collections import Counter, OrderedDict
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from random import Random
from typing import Any, Protocol, cast

from vfguide.errors import InputError
from vfguide.mavlink.address import (
    Address,
    NetworkAddress,
    SerialAddress,
    Status,
    Transport,
    reason_of,
)
from vfguide.mavlink.framing import MAGIC_1, MAGIC_2, Introduction
from vfguide.mavlink.mavsdk import MavsdkChannel
from vfguide.mavlink.stream import (
    DatagramFramer,
    ReconnectingStream,
    dial_serial,
    dial_tcp,
    open_tcp_server,
)
from vfguide.system import SocketSelector, retry_delay

Receive = Callable[[bytes], None]

FIRST_TRY = 1.0
"""Timeout of the first attempt when opening a connection that this side makes, s."""

REMEDIES = {
    errno.EADDRINUSE: "end the other program that listens there, or choose another port",
    errno.EADDRNOTAVAIL: "write an address of this computer, or 0.0.0.0 for all of them",
    errno.EACCES: "choose a port above 1023",
}
"""Remedies for errors that keep this computer from listening."""


Endpoint = tuple[Any, ...]
"""Host and port as sockets give them; IPv6 adds more, which does not identify the peer."""

PEER_SILENCE = 1.0
"""Default silence of a peer after which another may take its place, s."""

MOST_SENDERS = 16
"""Maximum number of senders at a port, the newest, whose frames are joined from several datagrams."""

LARGEST_DATAGRAM = 4096
"""Maximum size of a datagram, bytes; autopilots and routers send at most a packet's 1500."""

RECEIVE_BUFFER, SEND_BUFFER = 64 * 1024, 16 * 1024
"""Sizes of the kernel's buffers, bytes; larger ones would hold older messages."""


def begins_like_frame(datagram: bytes) -> bool:
    """Check whether the first byte can begin a MAVLink frame."""
    return bool(datagram) and datagram[0] in {MAGIC_1, MAGIC_2}


class UdpPeer:
    """Peer of a UDP socket: the given address, or else the first that has introduced itself.

    A peer keeps its place while it sends. Another takes over only after a silence, and by introducing itself
    as the first did. So a stray packet can neither draw the setpoints away nor pass for telemetry.
    """

    def __init__(
        self,
        given: Endpoint | None = None,
        *,
        introduces: Callable[[bytes], bool] = begins_like_frame,
        silence_s: float = PEER_SILENCE,
    ) -> None:
        """Create a peer.

        Args:
            given: address of the only possible peer; None for the first that introduces itself.
            introduces: returns whether a datagram introduces its sender.
            silence_s: silence of the present peer after which another may take its place, s.
        """
        self.endpoint = given
        """Address to send to; None before anybody has introduced itself."""
        self.rival: Endpoint | None = None
        """Last sender that introduced itself while the present peer was sending."""
        self._is_given = given is not None
        self._introduces = introduces
        self._silence_s = silence_s
        self._heard = -math.inf

    def admits(self, source: Endpoint, datagram: bytes, now: float) -> bool:
        """Check whether to take a datagram at a monotonic time (s); if so its sender becomes the peer."""
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


class UdpSocket(asyncio.DatagramProtocol):
    """UDP socket with one peer."""

    def __init__(self, receive: Callable[[bytes], None], status: Status, peer: UdpPeer) -> None:
        self._loop = asyncio.get_running_loop()
        self._receive = receive
        self._status = status
        self._peer = peer
        self._framers: OrderedDict[Endpoint, DatagramFramer] = OrderedDict()
        self._transport: asyncio.DatagramTransport | None = None
        self._room = SocketSelector()
        self.lost: asyncio.Future[None] = self._loop.create_future()
        """Set once the socket is closed."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the transport."""
        # Not checked by isinstance: before Python 3.12 asyncio's own transport only looks like one.
        self._transport = cast("asyncio.DatagramTransport", transport)
        medium = transport.get_extra_info("socket")
        medium.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        medium.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        self._room.register(medium.fileno(), selectors.EVENT_WRITE)
        self._report()

    def datagram_received(self, data: bytes, addr: Endpoint) -> None:
        """Hand on the peer's frames at once."""
        before, rival = self._peer.endpoint, self._peer.rival
        if len(data) > LARGEST_DATAGRAM:
            self._status.counters["oversized datagrams"] += 1
            return
        frames = self._framer(addr).feed(data)
        if not self._peer.admits(addr, frames, self._loop.time()):
            self._status.counters["datagrams of strangers"] += 1
            if self._peer.rival not in {None, rival}:
                self._status.warn(f"{addr[0]} port {addr[1]} says that it is this vehicle, too")
        else:
            if self._peer.endpoint != before:
                self._report()
            if frames:
                self._receive(frames)

    def _framer(self, source: Endpoint) -> DatagramFramer:
        """Return the framer of a sender, kept for the last few senders."""
        framer = self._framers.pop(source, None) or DatagramFramer(self._status.counters)
        self._framers[source] = framer
        if len(self._framers) > MOST_SENDERS:
            self._framers.popitem(last=False)
        return framer

    def error_received(self, exc: Exception) -> None:
        """Count an error: a peer that is not up yet refuses, and a network that is down comes back."""
        self._status.counters[f"error: {reason_of(exc)}"] += 1

    def connection_lost(self, exc: Exception | None) -> None:
        """Note that the socket is closed."""
        self._transport = None
        if exc is not None:
            self._status.down(reason_of(exc))
        self.lost.set_result(None)

    def send(self, datagram: bytes) -> None:
        """Send to the peer, if there is one; drop the datagram while the network takes nothing."""
        peer = self._peer.endpoint
        if self._transport is None or peer is None:
            self._status.counters["dropped: not connected"] += 1
        elif not self._room.select(0):
            self._status.counters["dropped: slow peer"] += 1
        else:
            self._transport.sendto(datagram, peer)

    async def close(self) -> None:
        """Close at once, and drop what waits."""
        if self._transport is not None:
            self._transport.abort()
            await asyncio.shield(self.lost)

    def _report(self) -> None:
        peer = self._peer.endpoint
        if peer is None:
            self._status.down("nobody has spoken yet")
        else:
            self._status.up(f"peer {peer[0]} port {peer[1]}")


@asynccontextmanager
async def open_udp_port(
    address: NetworkAddress,
    receive: Callable[[bytes], None],
    status: Status,
    introduction: Introduction | None,
) -> AsyncIterator[UdpSocket]:
    """Wait at a port of this computer; without an introduction, for any MAVLink sender.

    Raises:
        OSError: this computer does not allow it.
    """
    loop = asyncio.get_running_loop()
    peer = UdpPeer()
    if introduction is not None:
        peer = UdpPeer(introduces=introduction.is_given_by, silence_s=introduction.silence_s)
    _, port = await loop.create_datagram_endpoint(
        lambda: UdpSocket(receive, status, peer), local_addr=(address.host, address.port)
    )
    try:
        yield port
    finally:
        await port.close()


class UdpCaller:
    """UDP channel that sends first to one host, whose name may take a while to resolve.

    The socket is not connected: a route that changes in flight, as on a mobile network, needs no new socket.
    """

    def __init__(
        self, address: NetworkAddress, receive: Callable[[bytes], None], status: Status
    ) -> None:
        self._address = address
        self._receive = receive
        self._status = status
        self._socket: UdpSocket | None = None

    def send(self, datagram: bytes) -> None:
        """Send to the host, if it is resolved."""
        if self._socket is None:
            self._status.counters["dropped: not connected"] += 1
        else:
            self._socket.send(datagram)

    async def visit(self) -> tuple[str, bool]:
        """Resolve the host and exchange datagrams; return why that ended, and False: it is no success."""
        try:
            await self._speak()
        except (OSError, ValueError) as error:
            return reason_of(error), False
        return "the socket is closed", False

    async def _speak(self) -> None:
        loop = asyncio.get_running_loop()
        family, host = await self._find(loop)
        self._socket = peer = UdpSocket(self._receive, self._status, UdpPeer(host))
        try:
            await loop.create_datagram_endpoint(lambda: peer, family=family)
            await asyncio.shield(peer.lost)
        finally:
            self._socket = None
            await peer.close()

    async def _find(self, loop: asyncio.AbstractEventLoop) -> tuple[int, Endpoint]:
        """Return the host's address family and endpoint, preferably IPv4, which most autopilots use."""
        found = await loop.getaddrinfo(
            self._address.host, self._address.port, type=socket.SOCK_DGRAM
        )
        family, _, _, _, endpoint = min(found, key=lambda one: one[0] != socket.AF_INET)
        return family, endpoint


class ConnectionChannel(Protocol):
    """Common interface of all kinds of connection."""

    def send(self, datagram: bytes) -> None:
        """Send a datagram, or drop and count it."""


class RunningChannel(ConnectionChannel, Protocol):
    """Channel that has to be reconnected."""

    async def visit(self) -> tuple[str, bool]:
        """Connect once until that is lost; return the reason, and whether the autopilot was heard."""


class Connection:
    """Connection to one autopilot, or to nobody at the moment."""

    def __init__(self, channel: ConnectionChannel, status: Status) -> None:
        self._channel = channel
        self._status = status

    @property
    def connected(self) -> bool:
        """Whether there is a peer to send to."""
        return self._status.connected

    @property
    def counters(self) -> Counter[str]:
        """Numbers of dropped messages and errors, by reason."""
        return self._status.counters

    def send(self, datagram: bytes) -> None:
        """Send whole frames, if any, without waiting or raising; count what cannot be sent."""
        if datagram:
            self._channel.send(datagram)


@asynccontextmanager
async def open_connection(
    address: Address,
    receive: Receive,
    *,
    random: Random,
    by_mavsdk: bool = False,
    introduction: Introduction | None = None,
) -> AsyncIterator[Connection]:
    """Connect to an autopilot for as long as the context lasts.

    A connection that this side makes is remade for ever when it is lost. Opening waits for it for at most a
    second. Leaving the context closes everything at once.

    Args:
        address: address of the autopilot, or where to wait for it.
        receive: called from the event loop with whole frames as they come; it must not raise.
        random: spreads the retries of companions that lost the same peer.
        by_mavsdk: whether MAVSDK keeps the connection.
        introduction: decides which sender at a UDP port becomes the peer; None for any MAVLink.

    Raises:
        InputError: this computer cannot listen at the address, or has no MAVSDK.
    """
    status = Status(address)
    opening = channel_of(
        address, receive, status, random, by_mavsdk=by_mavsdk, introduction=introduction
    )
    async with opening as channel:
        try:
            yield Connection(channel, status)
        finally:
            status.close()


def channel_of(
    address: Address,
    receive: Receive,
    status: Status,
    random: Random,
    *,
    by_mavsdk: bool,
    introduction: Introduction | None,
) -> AbstractAsyncContextManager[ConnectionChannel]:
    """Return the context of a channel for this kind of address."""
    if by_mavsdk:
        return running(MavsdkChannel(address, receive, status), status, random)
    if isinstance(address, SerialAddress):
        dial = dial_serial(address)
        return running(ReconnectingStream(dial, receive, status), status, random)
    match address.transport:
        case Transport.UDP_IN:
            return listening(address, open_udp_port(address, receive, status, introduction))
        case Transport.UDP_OUT:
            return running(UdpCaller(address, receive, status), status, random)
        case Transport.TCP_IN:
            return listening(address, open_tcp_server(address, receive, status))
        case Transport.TCP_OUT:
            return running(ReconnectingStream(dial_tcp(address), receive, status), status, random)


async def kept_up(channel: RunningChannel, status: Status, random: Random) -> None:
    """Reconnect for ever, ever less often while nothing is heard.

    Raises:
        InputError: the address is unusable.
    """
    failures = 0
    while True:
        reason, was_heard = await channel.visit()
        # A peer that takes calls and says nothing is no success: it may be turning callers away.
        failures = 1 if was_heard else failures + 1
        status.down(reason)
        await asyncio.sleep(retry_delay(failures, random.random()))


@asynccontextmanager
async def running(
    channel: RunningChannel, status: Status, random: Random
) -> AsyncIterator[ConnectionChannel]:
    """Keep a channel connected by a task; on entering, its first attempt has usually ended.

    Raises:
        InputError: the address is unusable.
    """
    task = asyncio.create_task(kept_up(channel, status, random), name="MAVLink connection")
    settled = asyncio.create_task(status.settled.wait(), name="MAVLink connection: first try")
    try:
        await asyncio.wait([task, settled], timeout=FIRST_TRY, return_when=asyncio.FIRST_COMPLETED)
        if task.done():
            task.result()
        yield channel
    finally:
        task.cancel()
        settled.cancel()
        await asyncio.wait([task, settled])
    if not task.cancelled():
        task.result()


@asynccontextmanager
async def listening(
    address: NetworkAddress, opening: AbstractAsyncContextManager[ConnectionChannel]
) -> AsyncIterator[ConnectionChannel]:
    """Open a channel that waits for others, and report mistakes of the operator as InputError."""
    async with AsyncExitStack() as stack:
        try:
            channel = await stack.enter_async_context(opening)
        except OSError as error:
            remedy = REMEDIES.get(error.errno or 0, "write an address of this computer")
            raise InputError(f"cannot listen at {address}: {cause_of(error)}; {remedy}") from error
        yield channel


def cause_of(error: OSError) -> str:
    """Return the system's message, without asyncio's sentence around it."""
    return os.strerror(error.errno) if error.errno in REMEDIES else reason_of(error)
