"""MAVLink addresses in the notation of MAVSDK and QGroundControl, and the state of a connection."""

import asyncio
import ipaddress
import logging
import os
import re
from collections import Counter
from dataclasses import dataclass
from enum import StrEnum

from vfguide.errors import InputError
from vfguide.system import LABELS, checked_host

LONGEST_QUOTE = 80
"""Maximum length of a wrong address quoted in an error message, characters."""

SLOWEST_BAUD, FASTEST_BAUD = 1_200, 12_000_000

SERIAL = "serial"

OLD_SCHEMES = {
    "udp": ("udpin", "to wait for the autopilot, or udpout:// to speak first"),
    "tcp": ("tcpout", "to call the autopilot, or tcpin:// to be called"),
}
"""Schemes that MAVSDK has abandoned, with the nearest one and when that is right."""

DIGITS = re.compile(r"[0-9]{1,9}")

SERIAL_EXAMPLE = "serial:///dev/ttyACM0:57600"

REMEDY = "it is tried for ever: see that the autopilot is on, and that --mavlink names its end"
"""Remedy for all causes: a missing port, nobody who listens, nobody who speaks."""


class Transport(StrEnum):
    """Transport and direction of a network connection."""

    UDP_IN = "udpin"
    """Wait at a port, and answer the peer that speaks."""
    UDP_OUT = "udpout"
    """Send first."""
    TCP_IN = "tcpin"
    """Wait for a call."""
    TCP_OUT = "tcpout"
    """Call."""

    @property
    def listens(self) -> bool:
        """Whether the host is one of this computer's own addresses."""
        return self in {Transport.UDP_IN, Transport.TCP_IN}


EXAMPLES = {
    Transport.UDP_IN: "udpin://0.0.0.0:14540",
    Transport.UDP_OUT: "udpout://HOST:14540",
    Transport.TCP_IN: "tcpin://0.0.0.0:5760",
    Transport.TCP_OUT: "tcpout://HOST:5760",
}
ALL_EXAMPLES = f"{', '.join(EXAMPLES.values())} or {SERIAL_EXAMPLE}"


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkAddress:
    """Network address of an autopilot, or of the own port that it calls."""

    transport: Transport
    host: str
    """Host name or IP address, without brackets; this computer's own where the transport listens."""
    port: int
    """Port, 1 to 65535."""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.transport}://{host}:{self.port}"


@dataclass(frozen=True, slots=True, kw_only=True)
class SerialAddress:
    """Serial port of this computer."""

    device: str
    """Device file."""
    baud: int
    """Baud rate, bits per second."""

    def __str__(self) -> str:
        return f"{SERIAL}://{self.device}:{self.baud}"


Address = NetworkAddress | SerialAddress


def parse_address(text: str) -> Address:
    """Parse a MAVLink address.

    Raises:
        InputError: it is invalid; one line says what would be right.
    """
    try:
        return _parsed(text)
    except InputError as fault:
        raise InputError(f"MAVLink address {_quoted(text)}: {fault}") from None


def _parsed(text: str) -> Address:
    scheme, separator, rest = text.partition("://")
    scheme = scheme.lower()
    if not separator:
        raise InputError(f"write {ALL_EXAMPLES}")
    if scheme == SERIAL:
        return _serial(rest)
    if scheme in OLD_SCHEMES:
        raise InputError(_successor(scheme, rest))
    if scheme not in set(Transport):
        raise InputError(f"no such kind of connection; write {ALL_EXAMPLES}")
    return _network(Transport(scheme), rest)


def _serial(rest: str) -> SerialAddress:
    # The last colon, since names under /dev/serial/by-path have colons of their own.
    device, separator, speed = rest.rpartition(":")
    if not separator or not DIGITS.fullmatch(speed):
        raise InputError(f"the baud rate is missing; write {SERIAL_EXAMPLE}")
    if not device.startswith("/") or not device.isprintable() or device.endswith("/"):
        raise InputError(f"no device file; write its whole path, as in {SERIAL_EXAMPLE}")
    baud = int(speed)
    if not SLOWEST_BAUD <= baud <= FASTEST_BAUD:
        raise InputError(f"the baud rate must be within {SLOWEST_BAUD} to {FASTEST_BAUD}")
    return SerialAddress(device=device, baud=baud)


def _network(transport: Transport, rest: str) -> NetworkAddress:
    host, separator, port = rest.rpartition(":")
    if not separator or not DIGITS.fullmatch(port):
        raise InputError(f"the port is missing; write {EXAMPLES[transport]}")
    if not 1 <= int(port) <= 65_535:
        raise InputError("the port must be within 1 to 65535")
    return NetworkAddress(transport=transport, host=_host(transport, host), port=int(port))


def _host(transport: Transport, text: str) -> str:
    """Return the host, checked as far as possible without a name server."""
    if not text and transport.listens:
        raise InputError("the host is missing; write 0.0.0.0 to listen on all of this computer's")
    if not text:
        raise InputError("the host is missing; write the autopilot's name or number")
    host = checked_host(text)
    if not transport.listens and _is_many(host):
        raise InputError(f"{host} is not one host; write the autopilot's own address")
    return host


def _is_many(host: str) -> bool:
    """Check whether a host is the number of nobody or everybody."""
    try:
        number = ipaddress.ip_address(host)
    except ValueError:
        return False
    return number.is_unspecified or number.is_multicast or host == "255.255.255.255"


def _successor(scheme: str, rest: str) -> str:
    name, when = OLD_SCHEMES[scheme]
    example = rest if LABELS.fullmatch(rest.partition(":")[0]) else "HOST:PORT"
    return f"{scheme}:// is an old name; write {name}://{_shortened(example)} {when}"


def _quoted(text: str) -> str:
    return ascii(_shortened(text))


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_QUOTE else text[:LONGEST_QUOTE] + "..."


logger = logging.getLogger(__name__)


class Status:
    """State of one connection."""

    def __init__(self, address: Address) -> None:
        self.connected = False
        """Whether there is a peer to send to."""
        self.counters: Counter[str] = Counter()
        """Numbers of messages that were not sent or delivered, by reason."""
        self.settled = asyncio.Event()
        """Set once the first attempt has ended, successfully or not."""
        self._address = str(address)
        self._detail = ""
        self._closed = False

    def up(self, peer: str) -> None:
        """Record that there is a peer to send to."""
        self._change(connected=True, detail=peer)

    def down(self, reason: str) -> None:
        """Record that there is no peer to send to."""
        self._change(connected=False, detail=reason)

    def warn(self, text: str) -> None:
        """Log another problem of the connection."""
        logger.warning("MAVLink %s: %s", self._address, text, extra=self._fields(text))

    def close(self) -> None:
        """Record that the connection was closed on purpose; later changes are not logged."""
        self._closed, self.connected = True, False
        logger.info("MAVLink %s: closed", self._address, extra=self._fields("closed"))

    def _change(self, *, connected: bool, detail: str) -> None:
        self.settled.set()
        if self._closed or (connected, detail) == (self.connected, self._detail):
            return
        self.connected, self._detail = connected, detail
        self.counters["connected" if connected else "disconnected"] += 1
        fields = self._fields(detail)
        if connected:
            logger.info("MAVLink %s: connected, %s", self._address, detail, extra=fields)
        else:
            text = f"MAVLink {self._address}: not connected, {detail}; {REMEDY}"
            logger.warning("%s", text, extra=fields)

    def _fields(self, detail: str) -> dict[str, str | bool]:
        return {"mavlink_address": self._address, "connected": self.connected, "detail": detail}


def reason_of(error: Exception) -> str:
    """Describe an error in one line."""
    if isinstance(error, ConnectionError) and error.errno:
        # asyncio replaces the system's message with a sentence of its own.
        return os.strerror(error.errno)
    text = (isinstance(error, OSError) and error.strerror) or str(error) or type(error).__name__
    return " ".join(text.split())
