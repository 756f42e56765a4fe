"""Link over UDP: a multicast group, a broadcast address or a list of peers."""

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
"""Size of the kernel's buffer, bytes: some hundred datagrams. A larger one would hold old news."""

MOST_PEERS = 100
"""Maximum number of peers, since each message is sent to every one."""

INTERFACE = re.compile(r"[A-Za-z0-9._@-]{0,32}")

MULTICAST_ALL = 49
"""Linux's IP_MULTICAST_ALL, which Python does not name."""

LINUX = sys.platform == "linux"
"""Whether interfaces have numbers and a socket can hear only the groups that it has joined itself."""

HOPS = 1
"""Time to live of multicast datagrams: they pass no router, since a formation is on one network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpAddress(LinkAddress):
    """Addresses of the members of a formation that exchange datagrams."""

    scheme: ClassVar[str] = "udp"

    destinations: tuple[tuple[str, int], ...]
    """IPv4 address and port of the group, of the network's broadcast, or of each peer."""
    port: int
    """Local port that receives."""
    interface: str = ""
    """Name or address of the group's interface; empty for that of the default route."""

    @property
    def group(self) -> str | None:
        """Address of the multicast group; None where there is none."""
        host = self.destinations[0][0]
        return host if ipaddress.IPv4Address(host).is_multicast else None

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
    """Open a socket that receives a formation's datagrams and can send to it.

    Raises:
        OSError: interface or port is unavailable.
    """
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.setblocking(False)  # noqa: FBT003
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        if address.group or is_broadcast(*address.destinations):
            # Several companions on one computer hear one group, as in a rehearsal.
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Bound to the group itself; otherwise everything sent to the port from anywhere would be read.
        opened.bind((address.group if LINUX and address.group else "", address.port))
        if address.group is not None:
            interface = interface_of(address.interface)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, HOPS)
            opened.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
            if LINUX:
                # Otherwise every group that any program of this computer has joined would be heard.
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


def is_broadcast(*destinations: tuple[str, int]) -> bool:
    """Check whether there is one destination, which this computer cannot send to as to a single computer."""
    if len(destinations) > 1:
        return False
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            # Nothing is sent. Systems deny a broadcast address to a socket without SO_BROADCAST.
            probe.connect(destinations[0])
        except OSError as error:
            # Without a network nothing is known yet: the port is its owner's alone.
            return isinstance(error, PermissionError)
    return False


def interface_of(name: str) -> bytes:
    """Return an interface's address and number as at the end of Linux's `ip_mreqn`, elsewhere the address.

    An empty name stands for the interface of the default route.

    Raises:
        OSError: there is no such interface.
    """
    size = 8 if LINUX else 4
    with suppress(OSError):
        return (socket.inet_aton(name) if name else bytes(4)).ljust(size, b"\0")
    if not LINUX:
        raise OSError(errno.ENODEV, f"no address {name!r} of an interface")
    try:
        number = socket.if_nametoindex(name)
    except OSError:
        # Python's own error has no number, and does not say which interface.
        raise OSError(errno.ENODEV, f"no interface {name!r}") from None
    return struct.pack("=4si", bytes(4), number)


@link("udp")
class UdpCarrier(DatagramCarrier):
    """Carrier over UDP."""

    address: UdpAddress
    opened: socket.socket | None = None
    """Socket, open while the link is up."""

    @classmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> UdpAddress:
        """Build an address of a group, broadcast or peers, as in udp://239.255.42.1:14700?interface=wlan0."""
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
                # A peer's computer reports that its companion does not run: no fault of the network.
                self.status.counters["not taken by a peer"] += 1
            except OSError as error:
                failed.append(error)
                self.status.counters["failed to send to a peer"] += 1
        # While any peer can be reached the network is up.
        if len(failed) == len(self.address.destinations):
            raise failed[-1]

    def _read(self) -> None:
        """Take received datagrams, a limited number at a time."""
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
