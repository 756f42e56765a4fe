"""UDP and TCP links for MAVLink, with addresses as MAVSDK and QGroundControl write them."""

import asyncio
import errno
import heapq
import ipaddress
import itertools
import logging
import math
import os
import random
import re
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from typing import Any, Literal, cast, get_args

from numpy.random import default_rng

from sitl_stub.autopilot import Autopilot, Truth
from sitl_stub.codec import EmulatorFramer

Scheme = Literal["udpin", "udpout", "tcpin", "tcpout"]
"""`in` waits at the address for others to send first; `out` sends to the address first."""

SCHEMES: tuple[str, ...] = get_args(Scheme)

SHAPE = re.compile(r"(?P<scheme>[a-z]+)://(?P<host>\[[^\[\]]*\]|[^:/\[\]]*):(?P<port>[0-9]{1,5})")
HOST_NAME = re.compile(r"(?=.{1,253}\Z)[a-z0-9_-]{1,63}(\.[a-z0-9_-]{1,63})*\.?", re.IGNORECASE)

SHOWN_CHARACTERS = 80
"""Length of the part of a wrong address that its error message repeats."""

PEER_REMEMBERED_S = 10.0
"""Time for which a UDP peer stays a recipient after its last datagram; the latest peer stays for good."""

MAX_PEERS = 32
"""Greatest number of UDP peers or TCP clients at one time."""

MAX_UNSENT_BYTES = 65_536
"""Backlog above which a TCP peer misses telemetry instead of getting it late."""

CONNECT_TIMEOUT_S = 5.0

FIRST_DELAY_S, LONGEST_DELAY_S = 0.2, 5.0
"""First and longest delay between two attempts to connect: it doubles, with jitter."""


class AddressError(ValueError):
    """An address that cannot be used here; the message is one line."""


@dataclass(frozen=True, slots=True)
class Address:
    """Address of a MAVLink link."""

    scheme: Scheme
    """Protocol, and which side sends first."""

    host: str
    """Name or number; an IPv6 number has no brackets."""

    port: int
    """1 to 65535; 0 means any free port, for an address that listens."""

    @property
    def listens(self) -> bool:
        """Whether the other side sends first."""
        return self.scheme in {"udpin", "tcpin"}

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


def parse_address(text: str) -> Address:
    """Parse an address such as `udpin://127.0.0.1:14540`.

    Raises:
        AddressError: it is no such address; the message says what is wrong and what would be right.
    """
    shown = repr(text if len(text) <= SHOWN_CHARACTERS else text[:SHOWN_CHARACTERS] + "...")
    match = SHAPE.fullmatch(text)
    if match is None:
        raise AddressError(f"{shown} is no address; write one like udpin://127.0.0.1:14540")
    scheme, host, port = match["scheme"], match["host"], int(match["port"])
    if scheme not in SCHEMES:
        raise AddressError(f"{shown}: {scheme} is not known; use one of {', '.join(SCHEMES)}")
    address = Address(cast("Scheme", scheme), host.strip("[]"), port)
    if not (is_ipv6(address.host) if host.startswith("[") else HOST_NAME.fullmatch(host)):
        raise AddressError(f"{shown}: {host!r} is no host; write a name or a number")
    if port > 65_535:
        raise AddressError(f"{shown}: port {port} is too high; the highest is 65535")
    if port == 0 and not address.listens:
        raise AddressError(f"{shown}: port 0 (any free one) is only for {SCHEMES[0]} and tcpin")
    return address


def is_ipv6(text: str) -> bool:
    """Check whether a text is an IPv6 number."""
    try:
        ipaddress.IPv6Address(text)
    except ValueError:
        return False
    return True


Take = Callable[[bytes], None]

SocketAddress = tuple[Any, ...]
"""Opaque address of a socket: number and port, and two numbers more for IPv6."""

logger = logging.getLogger("sitl_stub")


class LinkError(Exception):
    """The address cannot be used on this computer now; the message is one line."""


class UdpLink(asyncio.DatagramProtocol):
    """A UDP socket with one fixed peer, or with all peers that sent something lately."""

    def __init__(
        self, address: Address, take: Take, fixed_peer: SocketAddress | None = None
    ) -> None:
        self.address = address
        self._take = take
        self._fixed_peer = fixed_peer
        self._heard_s: dict[SocketAddress, float] = {}
        self._transport: asyncio.DatagramTransport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Keep the transport of the open socket."""
        self._transport = cast("asyncio.DatagramTransport", transport)

    def datagram_received(self, data: bytes, addr: SocketAddress) -> None:
        """Remember the sender and pass the datagram on."""
        # The dictionary's order is that of the last datagrams.
        self._heard_s.pop(addr, None)
        self._heard_s[addr] = asyncio.get_running_loop().time()
        if len(self._heard_s) > MAX_PEERS:
            del self._heard_s[next(iter(self._heard_s))]
        self._take(data)

    def send(self, data: bytes) -> None:
        """Send one datagram to each peer."""
        if data and self._transport is not None and not self._transport.is_closing():
            for peer in self._peers():
                self._transport.sendto(data, peer)

    def _peers(self) -> tuple[SocketAddress, ...]:
        if self._fixed_peer is not None:
            return (self._fixed_peer,)
        oldest_s = asyncio.get_running_loop().time() - PEER_REMEMBERED_S
        for peer in list(self._heard_s)[:-1]:
            if self._heard_s[peer] >= oldest_s:
                break
            del self._heard_s[peer]
        return tuple(self._heard_s)


class TcpLink:
    """The present TCP connections: many for a server, at most one for a client."""

    def __init__(self, address: Address, take: Take) -> None:
        self.address = address
        self._take = take
        self.peers: set[TcpPeer] = set()

    def new_peer(self) -> "TcpPeer":
        """Return the protocol of a new connection."""
        return TcpPeer(self, self._take)

    def send(self, data: bytes) -> None:
        """Send bytes to each peer that keeps up."""
        if data:
            for peer in tuple(self.peers):
                peer.send(data)

    def close(self) -> None:
        """Drop all connections."""
        for peer in tuple(self.peers):
            peer.close()


class TcpPeer(asyncio.Protocol):
    """One TCP connection. asyncio itself sets TCP_NODELAY on it."""

    def __init__(self, link: TcpLink, take: Take) -> None:
        self.closed = asyncio.Event()
        self._link = link
        self._take = take
        self._framer = EmulatorFramer()
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Add the peer to the link, or drop the connection if there are too many."""
        self._transport = cast("asyncio.Transport", transport)
        if len(self._link.peers) >= MAX_PEERS:
            self._transport.abort()
        else:
            self._link.peers.add(self)

    def connection_lost(self, exc: Exception | None) -> None:
        """Remove the peer from the link."""
        del exc
        self._link.peers.discard(self)
        self.closed.set()

    def data_received(self, data: bytes) -> None:
        """Pass on the frames that are complete with these bytes."""
        frames = self._framer.feed(data)
        if frames:
            self._take(frames)

    def send(self, data: bytes) -> None:
        """Send all bytes, or none to a peer that does not keep up."""
        transport = self._transport
        if (
            transport is not None
            and not transport.is_closing()
            and transport.get_write_buffer_size() <= MAX_UNSENT_BYTES
        ):
            transport.write(data)

    def close(self) -> None:
        """End the connection."""
        if self._transport is not None:
            self._transport.abort()


EmulatorLink = UdpLink | TcpLink
"""Sends whole frames to all present peers; a peer that cannot take them misses them."""


def open_link(address: Address, take: Take) -> AbstractAsyncContextManager[EmulatorLink]:
    """Return a context in which the link at an address is open.

    Raises:
        LinkError: on entering, the port is taken or the host is not known.
    """
    ways: dict[str, Callable[[Address, Take], AbstractAsyncContextManager[EmulatorLink]]] = {
        "udpin": udp_in,
        "udpout": udp_out,
        "tcpin": tcp_in,
        "tcpout": tcp_out,
    }
    return ways[address.scheme](address, take)


@asynccontextmanager
async def udp_in(address: Address, take: Take) -> AsyncIterator[EmulatorLink]:
    """Bind to the address and send to the peers that sent something."""
    link = UdpLink(address, take)
    try:
        # No SO_REUSEADDR: a second process could take the port without an error.
        transport, _ = await asyncio.get_running_loop().create_datagram_endpoint(
            lambda: link, local_addr=(address.host, address.port)
        )
    except OSError as error:
        raise LinkError(f"{address}: cannot listen ({reason(error)})") from error
    try:
        link.address = with_port(address, transport.get_extra_info("sockname"))
        yield link
    finally:
        transport.close()


@asynccontextmanager
async def udp_out(address: Address, take: Take) -> AsyncIterator[EmulatorLink]:
    """Send to the address from any free port; take what comes back to that port."""
    loop = asyncio.get_running_loop()
    try:
        family, _, _, _, peer = (
            await loop.getaddrinfo(address.host, address.port, type=socket.SOCK_DGRAM)
        )[0]
        # Not connected: a connected socket loses a datagram for each one sent while the peer is absent.
        transport, link = await loop.create_datagram_endpoint(
            lambda: UdpLink(address, take, peer), family=family
        )
    except OSError as error:
        raise LinkError(f"{address}: cannot speak to it ({reason(error)})") from error
    try:
        yield link
    finally:
        transport.close()


@asynccontextmanager
async def tcp_in(address: Address, take: Take) -> AsyncIterator[EmulatorLink]:
    """Listen for clients."""
    link = TcpLink(address, take)
    try:
        # asyncio sets SO_REUSEADDR on listening TCP sockets, so that a restart need not wait.
        server = await asyncio.get_running_loop().create_server(
            link.new_peer, address.host, address.port
        )
    except OSError as error:
        raise LinkError(f"{address}: cannot listen ({reason(error)})") from error
    try:
        link.address = with_port(address, server.sockets[0].getsockname())
        yield link
    finally:
        server.close()
        link.close()


@asynccontextmanager
async def tcp_out(address: Address, take: Take) -> AsyncIterator[EmulatorLink]:
    """Connect to a server, again after each loss."""
    link = TcpLink(address, take)
    connecting = asyncio.create_task(stay_connected(link), name=f"connect to {address}")
    try:
        yield link
    finally:
        connecting.cancel()
        await asyncio.gather(connecting, return_exceptions=True)
        link.close()


async def stay_connected(link: TcpLink) -> None:
    """Connect, wait until the connection is lost, back off, and repeat."""
    loop, address = asyncio.get_running_loop(), link.address
    delay_s, told = FIRST_DELAY_S, False
    while True:
        try:
            async with asyncio.timeout(CONNECT_TIMEOUT_S):
                _, peer = await loop.create_connection(link.new_peer, address.host, address.port)
        except OSError as error:
            if not told:
                logger.warning("%s: no connection yet (%s); trying on", address, reason(error))
            told = True
        else:
            logger.info("%s: connected", address)
            delay_s, told = FIRST_DELAY_S, False
            await peer.closed.wait()
            logger.warning("%s: connection lost; trying again", address)
        await asyncio.sleep(delay_s * random.uniform(0.5, 1.0))
        delay_s = min(2.0 * delay_s, LONGEST_DELAY_S)


def with_port(address: Address, socket_name: SocketAddress) -> Address:
    """Return the address with the port that its socket got."""
    return Address(address.scheme, address.host, int(socket_name[1]))


def reason(error: OSError) -> str:
    """Return a short reason of an error."""
    if isinstance(error, TimeoutError):
        return "timed out"
    if isinstance(error, socket.gaierror) or error.errno is None:
        return (error.strerror or str(error)).lower()
    if error.errno == errno.EADDRINUSE:
        return "address already in use; end the program that has it, or choose another port"
    # asyncio's strerror is a sentence with the address; the system's own text is shorter.
    return os.strerror(error.errno).lower()


class BadLink:
    """An autopilot behind a slow and lossy link, in both directions alike.

    Each datagram is lost or arrives after the delay plus or minus the jitter. Datagrams may overtake
    each other.
    """

    def __init__(
        self,
        autopilot: Autopilot,
        *,
        delay_s: float = 0.0,
        jitter_s: float = 0.0,
        loss: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Put the link before an autopilot that has not flown yet.

        Raises:
            ValueError: a number is out of its range; the message names it.
        """
        if not (0.0 <= jitter_s <= delay_s < math.inf):
            raise ValueError(f"jitter {jitter_s!r} s must be within 0 and the delay, {delay_s!r} s")
        if not 0.0 <= loss < 1.0:
            raise ValueError(f"loss must be 0 to below 1, not {loss!r}")
        self._autopilot = autopilot
        self._delay_s, self._jitter_s, self._loss = delay_s, jitter_s, loss
        self._random = default_rng((seed, autopilot.system_id, 2))
        self._order = itertools.count()
        self._up: list[tuple[int, int, bytes]] = []
        self._down: list[tuple[int, int, bytes]] = []
        self._now_s = 0.0

    @property
    def system_id(self) -> int:
        """MAVLink system id."""
        return self._autopilot.system_id

    @property
    def next_due_s(self) -> float:
        """Next simulation time at which the autopilot does something or a datagram arrives."""
        arrivals_s = (queue[0][0] * 1e-6 for queue in (self._up, self._down) if queue)
        return min(self._autopilot.next_due_s, *arrivals_s, math.inf)

    def receive(self, data: bytes) -> bytes:
        """Take a datagram to the autopilot; return nothing, since replies come later."""
        self._travel(self._up, data)
        return b""

    def advance(self, to_s: float) -> bytes:
        """Fly to a simulation time; return the datagrams that have arrived from the autopilot by then."""
        to_us = round(to_s * 1e6)
        while self._up and self._up[0][0] <= to_us:
            arrival_us, _, data = heapq.heappop(self._up)
            self._fly_to(max(arrival_us * 1e-6, self._now_s))
            self._travel(self._down, self._autopilot.receive(data))
        self._fly_to(to_s)
        arrived = []
        while self._down and self._down[0][0] <= to_us:
            arrived.append(heapq.heappop(self._down)[2])
        return b"".join(arrived)

    def reboot(self) -> None:
        """Restart the autopilot."""
        self._autopilot.reboot()

    def truth(self) -> Truth:
        """Return the true state now."""
        return self._autopilot.truth()

    def _fly_to(self, to_s: float) -> None:
        """Fly on, sending each instant's telemetry at its own time."""
        while (next_s := self._autopilot.next_due_s) < to_s:
            self._now_s = max(next_s, self._now_s)
            self._travel(self._down, self._autopilot.advance(self._now_s))
        self._now_s = to_s
        self._travel(self._down, self._autopilot.advance(to_s))

    def _travel(self, queue: list[tuple[int, int, bytes]], data: bytes) -> None:
        if data and not (self._loss and self._random.random() < self._loss):
            spread_s = (
                self._jitter_s * (2.0 * self._random.random() - 1.0) if self._jitter_s else 0.0
            )
            arrival_us = round((self._now_s + self._delay_s + spread_s) * 1e6)
            heapq.heappush(queue, (arrival_us, next(self._order), data))


Emulated = Autopilot | BadLink
"""An autopilot to serve, by itself or behind a lossy link."""
