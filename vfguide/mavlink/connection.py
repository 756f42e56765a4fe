"""Connections to autopilots: over UDP, TCP and serial ports, behind one interface.

Nothing here waits in a queue. What arrives is handed on from the event loop as it comes, and what cannot be
sent at once is soon dropped, since the next setpoint is better than an old one.
"""

import asyncio
import errno
import os
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from random import Random
from typing import Protocol

from vfguide.errors import InputError
from vfguide.mavlink.address import (
    Address,
    NetworkAddress,
    SerialAddress,
    Status,
    Transport,
    reason_of,
)
from vfguide.mavlink.datagram import UdpCaller, open_udp_port
from vfguide.mavlink.framing import Introduction
from vfguide.mavlink.mavsdk import MavsdkChannel
from vfguide.mavlink.stream import ReconnectingStream, dial_serial, dial_tcp, open_tcp_server

Receive = Callable[[bytes], None]

FIRST_TRY = 1.0
"""s that opening waits for the first try of a connection that this side makes."""

REMEDIES = {
    errno.EADDRINUSE: "end the other program that listens there, or choose another port",
    errno.EADDRNOTAVAIL: "write an address of this computer, or 0.0.0.0 for all of them",
    errno.EACCES: "choose a port above 1023",
}
"""What helps when this computer does not let a program listen."""


class Connection(Protocol):
    """To one autopilot, or to nobody for the moment."""

    @property
    def connected(self) -> bool:
        """Whether there is a peer to send to."""

    @property
    def counters(self) -> Counter[str]:
        """What was dropped and what went wrong, by reason."""

    def send(self, datagram: bytes) -> None:
        """Send whole frames. Never waits, never raises: what cannot be sent is dropped and counted."""


class ConnectionChannel(Protocol):
    """What the kinds of connection differ in."""

    def send(self, datagram: bytes) -> None:
        """Send, or drop and count."""


class RunningChannel(ConnectionChannel, Protocol):
    """A channel that has to be kept up."""

    async def run(self) -> None:
        """Keep it up until cancelled."""


class OpenConnection:
    """A connection of any kind, with its status."""

    def __init__(self, channel: ConnectionChannel, status: Status) -> None:
        self._channel = channel
        self._status = status

    @property
    def connected(self) -> bool:
        """Whether there is a peer to send to."""
        return self._status.connected

    @property
    def counters(self) -> Counter[str]:
        """What was dropped and what went wrong, by reason."""
        return self._status.counters

    def send(self, datagram: bytes) -> None:
        """Send whole frames, if there are any."""
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
    """Connect to an autopilot, for as long as the context lasts.

    A connection that this side makes is made again for ever when it is lost; being up is not awaited for more
    than a second. Leaving the context closes everything at once.

    Args:
        address: of the autopilot, or where to wait for it.
        receive: called from the event loop with whole frames, as they come; it must not raise.
        random: keeps companions that lost the same peer from coming back in step.
        by_mavsdk: whether MAVSDK keeps the connection.
        introduction: by which a sender at a UDP port becomes the peer; any MAVLink if absent.

    Raises:
        InputError: this computer cannot listen at the address, or has no MAVSDK.
    """
    status = Status(address)
    opening = channel_of(
        address, receive, status, random, by_mavsdk=by_mavsdk, introduction=introduction
    )
    async with opening as channel:
        try:
            yield OpenConnection(channel, status)
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
    """What opens and closes a channel of the kind that the address asks for."""
    if by_mavsdk:
        return running(MavsdkChannel(address, receive, status, random), status)
    if isinstance(address, SerialAddress):
        dial = dial_serial(address)
        return running(ReconnectingStream(dial, receive, status, random), status)
    match address.transport:
        case Transport.UDP_IN:
            return listening(address, open_udp_port(address, receive, status, introduction))
        case Transport.UDP_OUT:
            return running(UdpCaller(address, receive, status, random), status)
        case Transport.TCP_IN:
            return listening(address, open_tcp_server(address, receive, status))
        case Transport.TCP_OUT:
            return running(ReconnectingStream(dial_tcp(address), receive, status, random), status)


@asynccontextmanager
async def running(channel: RunningChannel, status: Status) -> AsyncIterator[ConnectionChannel]:
    """A channel that a task keeps up; its first try has usually ended when this is entered.

    Raises:
        InputError: the address will not do.
    """
    task = asyncio.create_task(channel.run(), name="MAVLink connection")
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
    """A channel that waits for others; the operator's mistakes are told as such."""
    async with AsyncExitStack() as stack:
        try:
            channel = await stack.enter_async_context(opening)
        except OSError as error:
            remedy = REMEDIES.get(error.errno or 0, "write an address of this computer")
            raise InputError(f"cannot listen at {address}: {cause_of(error)}; {remedy}") from error
        yield channel


def cause_of(error: OSError) -> str:
    """What the system says; asyncio puts sentences of its own around it."""
    return os.strerror(error.errno) if error.errno in REMEDIES else reason_of(error)
