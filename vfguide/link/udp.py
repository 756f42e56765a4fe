"""What a formation shares, by UDP alone: a multicast group, a broadcast address or a list of peers."""

import asyncio
import errno
import ipaddress
import re
import socket
import struct
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import ClassVar
from urllib.parse import SplitResult, parse_qsl

from vfguide.errors import InputError
from vfguide.link.carrier import MOST_AT_ONCE, UDP_EXAMPLE, DatagramCarrier, LinkAddress, link
from vfguide.link.codec import LARGEST

RECEIVE_BUFFER = 128 * 1024
"""Bytes in the kernel: some hundred datagrams. With more, a companion that was held up hears old news."""

MOST_PEERS = 100
"""Each message goes to every one."""

INTERFACE = re.compile(r"[A-Za-z0-9._@-]{0,32}")

MULTICAST_ALL = 49
"""Linux's IP_MULTICAST_ALL, which Python does not name."""

LINUX = sys.platform == "linux"
"""Whether interfaces have numbers, and a socket can hear only the groups that it has joined itself."""

HOPS = 1
"""Routers that a multicast datagram passes, less one: a formation is on one network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpAddress(LinkAddress):
    """Where the members of a formation are who speak to each other by datagrams."""

    scheme: ClassVar[str] = "udp"

    destinations: tuple[tuple[str, int], ...]
    """IPv4 address and port of the group, of the network's broadcast, or of each peer."""
    port: int
    """That is listened at."""
    interface: str = ""
    """Name or address of the interface that a group is on; empty for that of the default route."""

    @property
    def group(self) -> str | None:
        """The multicast group; None where there is none."""
        host = self.destinations[0][0]
        return host if ipaddress.IPv4Address(host).is_multicast else None

    @property
    def shared(self) -> bool:
        """Whether several programs of one computer may listen: what is sent to one address reaches all."""
        host = self.destinations[0][0]
        return self.group is not None or (len(self.destinations) == 1 and host.endswith(".255"))

    def __str__(self) -> str:
        return "udp://" + ",".join(f"{host}:{port}" for host, port in self.destinations)


def _destination(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    try:
        return str(ipaddress.IPv4Address(host)), _udp_port(port)
    except ValueError:
        raise InputError(
            f"a UDP link has IPv4 addresses and ports; write {UDP_EXAMPLE}, udp://10.0.0.255:14700 or"
            " udp://10.0.0.2:14700,10.0.0.3:14700"
        ) from None


def _udp_port(text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) <= 5 and 0 < int(text) < 2**16):
        raise InputError(f"the port must be within 1 to 65535; write {UDP_EXAMPLE}")
    return int(text)


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
        """Group, broadcast address or peers, as in udp://239.255.42.1:14700?interface=wlan0."""
        del environment
        if parts.fragment or parts.path.strip("/"):
            raise InputError(f"a UDP link has no path; write {UDP_EXAMPLE}")
        options = dict(parse_qsl(parts.query, keep_blank_values=True))
        if not set(options) <= {"interface", "port"}:
            raise InputError(f"after the ? come interface= and port=; write {UDP_EXAMPLE}")
        texts = parts.netloc.split(",")
        if len(texts) > MOST_PEERS:
            raise InputError(
                f"these are {len(texts)} peers; write {MOST_PEERS} at most, or a group"
            )
        destinations = tuple(_destination(text) for text in texts)
        interface = options.get("interface", "")
        groups = sum(ipaddress.IPv4Address(host).is_multicast for host, _ in destinations)
        if groups and len(destinations) > 1:
            raise InputError(f"a group reaches everybody by itself; write {UDP_EXAMPLE}")
        if interface and not groups:
            raise InputError("interface= goes with a multicast group; leave it out")
        if not INTERFACE.fullmatch(interface):
            raise InputError("interface= is no interface; write wlan0, or an address that it has")
        own = options.get("port", str(destinations[-1][1]))
        return UdpAddress(destinations=destinations, port=_udp_port(own), interface=interface)

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
