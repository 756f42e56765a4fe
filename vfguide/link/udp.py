"""What a formation shares, by UDP alone: a multicast group, a broadcast address or a list of peers."""

import asyncio
import errno
import socket
import struct
import sys
from collections.abc import Mapping
from contextlib import suppress
from urllib.parse import SplitResult

from vfguide.link.address import UdpAddress, udp_address
from vfguide.link.carrier import link
from vfguide.link.datagrams import MOST_AT_ONCE, DatagramCarrier
from vfguide.link.envelope import LARGEST

RECEIVE_BUFFER = 128 * 1024
"""Bytes in the kernel: some hundred datagrams. With more, a companion that was held up hears old news."""

MULTICAST_ALL = 49
"""Linux's IP_MULTICAST_ALL, which Python does not name."""

LINUX = sys.platform == "linux"
"""Whether interfaces have numbers, and a socket can hear only the groups that it has joined itself."""

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
        opened.bind((address.group if LINUX and address.group else "", address.port))
        if address.group is not None:
            interface = interface_of(address.interface)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, HOPS)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            if LINUX:
                # Else all groups would be heard that any program of this computer has joined.
                opened.setsockopt(socket.IPPROTO_IP, MULTICAST_ALL, 0)
            outgoing = bytes(4) + interface if LINUX else interface
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, outgoing)
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
    """Address and number of an interface as Linux's `ip_mreqn` ends with them, elsewhere the address alone.

    Args:
        name: of the interface, or an address that it has; empty for the one of the default route.

    Raises:
        OSError: there is none of this name.
    """
    size = 8 if LINUX else 4
    with suppress(OSError):
        return (socket.inet_aton(name) if name else bytes(4)).ljust(size, b"\0")
    if not LINUX:
        raise OSError(errno.ENODEV, f"no address {name!r} of an interface")
    try:
        number = socket.if_nametoindex(name)
    except OSError:
        # Python's own has no number, and does not say which.
        raise OSError(errno.ENODEV, f"no interface {name!r}") from None
    return struct.pack("=4si", bytes(4), number)


@link("udp")
class UdpCarrier(DatagramCarrier):
    """Carries messages by datagrams."""

    address: UdpAddress
    opened: socket.socket | None = None
    """Open while the link stands."""

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> UdpAddress:
        """Group, broadcast address or peers."""
        del environment
        return udp_address(parts)

    def open(self) -> None:
        """Open the socket."""
        self.opened = open_socket(self.address)
        asyncio.get_running_loop().add_reader(self.opened, self._read)

    def close(self) -> None:
        """Close the socket."""
        if self.opened is not None:
            asyncio.get_running_loop().remove_reader(self.opened)
            self.opened.close()
            self.opened = None

    def transmit(self, data: bytes) -> None:
        """Send to the group, or to each peer."""
        if self.opened is None:
            return
        failed: list[OSError] = []
        for destination in self.address.destinations:
            try:
                self.opened.sendto(data, destination)
            except BlockingIOError:
                self.status.counters["dropped: no room"] += 1
            except ConnectionRefusedError:
                # Word from the computer of a peer whose companion does not run: no fault of the network.
                self.status.counters["not taken by a peer"] += 1
            except OSError as error:
                failed.append(error)
                self.status.counters["failed to send to a peer"] += 1
        # While any of the others can be reached the network is there.
        if len(failed) == len(self.address.destinations):
            raise failed[-1]

    def _read(self) -> None:
        """Take what has arrived, some at a time."""
        for _ in range(MOST_AT_ONCE):
            if self.opened is None:
                return
            try:
                data = self.opened.recv(LARGEST + 1)
            except BlockingIOError:
                return
            except ConnectionRefusedError:
                self.status.counters["not taken by a peer"] += 1
                continue
            except OSError as error:
                self.broke(error)
                return
            self.arrived(data)
