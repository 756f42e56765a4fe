"""MAVLink addresses as MAVSDK and QGroundControl write them: `udpin://0.0.0.0:14540`."""

import ipaddress
import re
from dataclasses import dataclass
from typing import Literal, cast, get_args

Scheme = Literal["udpin", "udpout", "tcpin", "tcpout"]
"""`in`: wait at the address for others to speak. `out`: speak to the address first."""

SCHEMES: tuple[str, ...] = get_args(Scheme)

SHAPE = re.compile(r"(?P<scheme>[a-z]+)://(?P<host>\[[^\[\]]*\]|[^:/\[\]]*):(?P<port>[0-9]{1,5})")
HOST_NAME = re.compile(r"(?=.{1,253}\Z)[a-z0-9_-]{1,63}(\.[a-z0-9_-]{1,63})*\.?", re.IGNORECASE)

SHOWN_CHARACTERS = 80
"""How much of a wrong address is repeated in the message about it."""


class AddressError(ValueError):
    """Not an address that can be used here; the message is one line."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where MAVLink goes out and comes in."""

    scheme: Scheme
    """Which protocol, and who speaks first."""

    host: str
    """Name or number, an IPv6 number without brackets."""

    port: int
    """1 to 65535; 0 where one listens means any free port."""

    @property
    def listens(self) -> bool:
        """Whether others speak first."""
        return self.scheme in {"udpin", "tcpin"}

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


def parse_address(text: str) -> Address:
    """The address that a text such as `udpin://127.0.0.1:14540` names.

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
    """Whether a text is an IPv6 number."""
    try:
        ipaddress.IPv6Address(text)
    except ValueError:
        return False
    return True
