"""What a formation shares, by UDP alone: a multicast group, a broadcast address or a list of peers.

There is no broker: every message is one datagram to all, and everybody picks out what is of use. A datagram
that does not arrive is not sent again: the next state is better than an old one.
"""

import asyncio
import math
import os
import socket
import struct
from collections import deque
from contextlib import suppress
from dataclasses import replace
from random import Random

from vfguide.backoff import retry_delay
from vfguide.link.address import UdpAddress
from vfguide.link.envelope import LARGEST
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence
from vfguide.link.status import LinkStatus

BEAT_S = 1.0
"""s between presences, by which others see that this member lives, and the socket that it does."""

SILENCE_S = 3.0
"""After this long without a word from anybody the link counts as lost, and the socket is opened again: an
interface that goes away and comes back is in no group any more, and says nothing of that."""

MOST_AT_ONCE = 64
"""Datagrams that are read before anything else gets its turn."""

RECEIVE_BUFFER = 128 * 1024
"""Bytes in the kernel: some hundred datagrams. With more, a companion that was held up hears old news."""

LARGEST_DATAGRAM = 1400
"""Bytes that pass every usual network in one piece: a presence that is longer goes without its figures."""

REMEMBERED = 64
"""Own datagrams that may come back: a second of them."""

GOODBYES = 3
"""Times that a member says that it leaves: nobody answers."""

MULTICAST_ALL = 49
"""Linux's IP_MULTICAST_ALL, which Python does not name."""

HOPS = 1
"""Routers that a multicast datagram passes, less one: a formation is on one network."""


def open_socket(address: UdpAddress) -> socket.socket:
    """A socket that hears what is sent to a formation, and can send to it.

    Raises:
        OSError: the interface is not there, or the port is not to be had.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setblocking(False)  # noqa: FBT003
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        if address.shared:
            # Several companions of one computer hear one group, as in a rehearsal.
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Bound to the group itself, since else all that comes to the port from anywhere would be read.
        opened.bind((address.group or "", address.port))
        if address.group is not None:
            interface = interface_of(address.interface)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, HOPS)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            # Else all groups would be heard that any program of this computer has joined.
            opened.setsockopt(socket.IPPROTO_IP, MULTICAST_ALL, 0)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, bytes(4) + interface)
            opened.setsockopt(
                socket.IPPROTO_IP,
                socket.IP_ADD_MEMBERSHIP,
                socket.inet_aton(address.group) + interface,
            )
    except BaseException:
        opened.close()
        raise
    return opened


def interface_of(name: str) -> bytes:
    """Address and number of an interface as the kernel's `ip_mreqn` ends with them.

    Args:
        name: of the interface, or an address that it has; empty for the one of the default route.

    Raises:
        OSError: there is none of this name.
    """
    if not name:
        return struct.pack("=4si", bytes(4), 0)
    with suppress(OSError):
        return struct.pack("=4si", socket.inet_aton(name), 0)
    return struct.pack("=4si", bytes(4), socket.if_nametoindex(name))


class UdpCarrier:
    """Carries messages by datagrams."""

    def __init__(
        self, address: UdpAddress, *, member: Member, presence: Presence, random: Random
    ) -> None:
        """Make one whose socket is not open yet.

        Args:
            address: where everybody is.
            member: who takes what arrives.
            presence: what the member says about itself at first.
            random: keeps members that lost the same network from coming back in step.
        """
        self.status = LinkStatus(str(address))
        self.address = address
        """Where everybody is."""
        self._member = member
        self._presence = presence
        self._random = random
        self.socket: socket.socket | None = None
        """Open while the link stands."""
        self._stop = asyncio.Event()
        self._wake = asyncio.Event()
        self._broken = ""
        self._heard_s = -math.inf
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)

    async def run(self) -> None:
        """Carry until told to stop; a network that goes away is tried again for ever."""
        failures = 0
        while not self._stop.is_set():
            try:
                reason = await self._visit()
            except OSError as error:
                reason = error.strerror or str(error)
            if self._stop.is_set():
                return
            heard = asyncio.get_running_loop().time() - self._heard_s < SILENCE_S + BEAT_S
            failures = 1 if heard else failures + 1
            self.status.down(reason)
            with suppress(TimeoutError):
                async with asyncio.timeout(retry_delay(failures, self._random.random())):
                    await self._stop.wait()

    def stop(self) -> None:
        """Say goodbye; `run` ends at once."""
        self._stop.set()
        self._wake.set()

    def send(self, parcel: Parcel) -> None:
        """Send a message to all, once."""
        self._send(parcel.data)

    def announce(self, presence: Presence) -> None:
        """Go on saying this about the member, at once and every second."""
        changed = presence.mode != self._presence.mode
        self._presence = presence
        if changed:
            self._wake.set()

    async def _visit(self) -> str:
        """One socket, from opening it until it is of no use; why that is.

        Raises:
            OSError: it cannot be opened.
        """
        loop = asyncio.get_running_loop()
        self.socket, self._broken = open_socket(self.address), ""
        opened_s = loop.time()
        loop.add_reader(self.socket, self._read)
        try:
            while not self._stop.is_set() and not self._broken:
                self._wake.clear()
                self._beat(self._presence)
                silent_s = loop.time() - max(self._heard_s, opened_s)
                if silent_s > SILENCE_S:
                    return "nobody is heard; is anybody else on this network?"
                if not self.status.settled.is_set():
                    self._up()
                with suppress(TimeoutError):
                    async with asyncio.timeout(BEAT_S):
                        await self._wake.wait()
            if not self._broken and not self._member.watches:
                for _ in range(GOODBYES):
                    self._beat(replace(self._presence, status="offline"))
            return self._broken
        finally:
            loop.remove_reader(self.socket)
            self.socket.close()
            self.socket = None

    def _up(self) -> None:
        if not self.status.connected:
            self.status.up()
            self._member.hurry.set()

    def _beat(self, presence: Presence) -> None:
        """Say how this member is."""
        if self._member.watches:
            return
        data = self._member.presence(presence).data
        if len(data) > LARGEST_DATAGRAM:
            data = self._member.presence(replace(presence, figures={})).data
        self._send(data)

    def _send(self, data: bytes) -> None:
        if self.socket is None:
            self.status.counters["dropped: not connected"] += 1
            return
        self._sent.append(data)
        for destination in self.address.destinations:
            try:
                self.socket.sendto(data, destination)
            except BlockingIOError:
                self.status.counters["dropped: no room"] += 1
            except ConnectionRefusedError:
                # Word from the computer of a peer whose companion does not run: no fault of the network.
                self.status.counters["not taken by a peer"] += 1
            except OSError as error:
                self.status.counters["failed to send"] += 1
                self._broken = error.strerror or os.strerror(error.errno or 0)
                self._wake.set()

    def _read(self) -> None:
        """Take what has arrived, some at a time."""
        for _ in range(MOST_AT_ONCE):
            if self.socket is None:
                return
            try:
                data = self.socket.recv(LARGEST + 1)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                self.status.counters["not taken by a peer"] += 1
                continue
            except OSError as error:
                self._broken = error.strerror or os.strerror(error.errno or 0)
                self._wake.set()
                return
            if data in self._sent:
                # A group hands everybody his own words, too.
                continue
            if self._member.take(data):
                self._heard_s = asyncio.get_running_loop().time()
                if not self.status.connected:
                    self._up()
