"""Where the formation's link is found, and how to be let in."""

import ipaddress
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from vfguide.errors import InputError
from vfguide.registry import links

ENVIRONMENT_VARIABLE = "VFGUIDE_LINK_PASSWORD"
"""Environment variable with the password, so that lists of processes do not show it."""

DEFAULT_PREFIX = "vfguide"

PORTS = {"mqtt": 1883, "mqtts": 8883}
"""By scheme, where the address names none."""

EXAMPLE = "mqtt://HOST:1883/PREFIX"
SECURE_EXAMPLE = "mqtts://USER@HOST:8883/PREFIX?ca=FILE&cert=FILE&key=FILE"

UDP_EXAMPLE = "udp://239.255.42.1:14700?interface=wlan0"

MOST_PEERS = 100
"""Each message goes to every one."""

INTERFACE = re.compile(r"[A-Za-z0-9._@-]{0,32}")

OPTIONS = ("ca", "cert", "key")
"""Files that an mqtts:// address may name."""

LONGEST_HOST = 253
"""Characters of a host name, by the rules of the domain name system."""

LONGEST_PREFIX = 200
"""Characters."""

LABELS = re.compile(
    r"(?!-)[a-z0-9_-]{1,63}(?<!-)(\.(?!-)[a-z0-9_-]{1,63}(?<!-))*", re.IGNORECASE | re.ASCII
)
NUMERIC = re.compile(r"[0-9.]+")


class LinkAddress:
    """Address of any kind of link: a frozen dataclass; as text it has no password."""

    __slots__ = ()

    scheme: ClassVar[str]
    """The scheme by which its carrier is known."""


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


@dataclass(frozen=True, slots=True, kw_only=True)
class MqttAddress(LinkAddress):
    """A broker, and what it wants to know of those who call."""

    scheme: ClassVar[str] = "mqtt"

    host: str
    """Name or number, without brackets."""
    port: int
    """1 to 65535."""
    prefix: str = DEFAULT_PREFIX
    """First levels of every topic."""
    secure: bool = False
    """Whether the connection is encrypted, and the broker's certificate checked."""
    user: str | None = None
    """User name, if the broker asks for one."""
    password: str | None = field(default=None, repr=False)
    """Password of the user. Never shown."""
    ca: Path | None = None
    """Certificates that vouch for the broker; those of this computer if absent."""
    cert: Path | None = None
    """This client's certificate, if the broker asks for one."""
    key: Path | None = None
    """Private key of that certificate."""

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        scheme = "mqtts" if self.secure else "mqtt"
        return f"{scheme}://{host}:{self.port}/{self.prefix}"


def parse_link(text: str, environment: Mapping[str, str] = os.environ) -> LinkAddress:
    """The link that a text names.

    A password that the text does not have comes from the environment variable VFGUIDE_LINK_PASSWORD.

    Raises:
        InputError: it names none; one line that says what would be right. It never repeats the text: what is
            wrong about an address may be that its password is in the wrong place.
    """
    try:
        return _parsed(text, environment)
    except InputError as fault:
        raise InputError(f"link address: {fault}") from None


def parse_links(texts: Sequence[str]) -> tuple[LinkAddress, ...]:
    """The links that some texts name, each once.

    Raises:
        InputError: one names none, or there is none.
    """
    if not texts:
        raise InputError(f"link address: there is none; write {EXAMPLE}")
    return tuple(dict.fromkeys(parse_link(text) for text in texts))


def _parsed(text: str, environment: Mapping[str, str]) -> LinkAddress:
    if not text.isprintable() or " " in text:
        raise InputError(f"it has blanks or control characters; write {EXAMPLE}")
    try:
        parts = urlsplit(text)
    except ValueError:
        raise InputError(f"the host is no name or number; write {EXAMPLE}") from None
    if "://" not in text or parts.scheme not in links:
        schemes = [f"{name}://" for name in links.names()]
        known = f"{', '.join(schemes[:-1])} or {schemes[-1]}"
        raise InputError(f"it must begin with {known}; write {EXAMPLE} or {UDP_EXAMPLE}")
    address: LinkAddress = links.find(parts.scheme).address_of(parts, environment)
    return address


def mqtt_address(parts: SplitResult, environment: Mapping[str, str]) -> MqttAddress:
    """A broker, as in mqtts://USER@HOST:8883/PREFIX?ca=FILE.

    Raises:
        InputError: it names none.
    """
    if parts.fragment:
        raise InputError("a # is not possible here; write %23 for one in a user name or password")
    secure = parts.scheme == "mqtts"
    user, password = _credentials(parts, environment)
    files = _files(parts.query, secure=secure)
    return MqttAddress(
        host=_host(parts),
        port=_port(parts),
        prefix=_prefix(parts.path),
        secure=secure,
        user=user,
        password=password,
        ca=files.get("ca"),
        cert=files.get("cert"),
        key=files.get("key"),
    )


def udp_address(parts: SplitResult) -> UdpAddress:
    """Group, broadcast address or peers, as in udp://239.255.42.1:14700?interface=wlan0.

    Raises:
        InputError: it names none.
    """
    if parts.fragment or parts.path.strip("/"):
        raise InputError(f"a UDP link has no path; write {UDP_EXAMPLE}")
    options = dict(parse_qsl(parts.query, keep_blank_values=True))
    if not set(options) <= {"interface", "port"}:
        raise InputError(f"after the ? come interface= and port=; write {UDP_EXAMPLE}")
    texts = parts.netloc.split(",")
    if len(texts) > MOST_PEERS:
        raise InputError(f"these are {len(texts)} peers; write {MOST_PEERS} at most, or a group")
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


def _host(parts: SplitResult) -> str:
    text = parts.hostname or ""
    if not text:
        raise InputError(f"the host is missing; write {EXAMPLE}")
    try:
        if ":" in text:
            return str(ipaddress.IPv6Address(text))
        if NUMERIC.fullmatch(text):
            return str(ipaddress.IPv4Address(text))
    except ValueError:
        raise InputError("the host is no number; write 192.168.1.10 or [fd00::10]") from None
    if not LABELS.fullmatch(text) or len(text) > LONGEST_HOST:
        raise InputError("the host is no name; write a name, 192.168.1.10 or [fd00::10]")
    return text


def _port(parts: SplitResult) -> int:
    try:
        port = parts.port
    except ValueError:
        port = 0
    if port is None:
        return PORTS[parts.scheme]
    if port == 0:
        raise InputError(
            f"the port must be within 1 to 65535; write {EXAMPLE}, "
            "and %2F, %3A, %40 for / : @ in a user name or password"
        )
    return port


def _prefix(path: str) -> str:
    text = unquote(path).strip("/")
    if not text:
        return DEFAULT_PREFIX
    sound = text.isprintable() and len(text) <= LONGEST_PREFIX and not text.startswith("$")
    if not sound or any(mark in text for mark in "+#") or "//" in text:
        raise InputError("the prefix cannot begin a topic; write levels such as /team/north")
    return text


def _credentials(
    parts: SplitResult, environment: Mapping[str, str]
) -> tuple[str | None, str | None]:
    """User name and password."""
    if parts.username is None:
        return None, None
    user = unquote(parts.username)
    if not user or not user.isprintable():
        raise InputError(f"the user name is missing; write {SECURE_EXAMPLE}")
    if parts.password is None:
        return user, environment.get(ENVIRONMENT_VARIABLE)
    return user, unquote(parts.password)


def _files(query: str, *, secure: bool) -> dict[str, Path]:
    try:
        pairs = parse_qsl(query, keep_blank_values=True, strict_parsing=True) if query else []
    except ValueError:
        raise InputError(f"what follows the ? is not understood; write {SECURE_EXAMPLE}") from None
    names = [name for name, _ in pairs]
    if not set(names) <= set(OPTIONS) or len(set(names)) < len(names):
        raise InputError(f"after the ? come ca=, cert= and key=, once each; write {SECURE_EXAMPLE}")
    if pairs and not secure:
        raise InputError(f"certificates go with mqtts://; write {SECURE_EXAMPLE}")
    if ("cert" in names) != ("key" in names):
        raise InputError(f"cert= and key= go together; write {SECURE_EXAMPLE}")
    if not all(value and value.isprintable() for _, value in pairs):
        raise InputError(f"a file name is missing; write {SECURE_EXAMPLE}")
    return {name: Path(value) for name, value in pairs}
