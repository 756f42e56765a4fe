"""Carriers of a formation's messages: link addresses, the contract of a link, and its status.

Without a broker every message goes to all members, and each picks out what it needs. Subclasses of
`DatagramCarrier` transmit and receive bytes on some medium; presences and goodbyes are sent here.
"""

import asyncio
import logging
import math
import os
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from random import Random
from typing import Any, ClassVar
from urllib.parse import SplitResult, urlsplit

from msgspec.structs import replace

from vfguide.errors import InputError, described_error
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence
from vfguide.registry import links
from vfguide.system import retry_delay

logger = logging.getLogger(__name__)

EXAMPLE = "mqtt://HOST:1883/PREFIX"

UDP_EXAMPLE = "udp://239.255.42.1:14700?interface=wlan0"

BEAT_S = 1.0
"""Interval between presences, s: they show that this member lives, and that its link works."""

STABLE_S = 5.0
"""Connection time from which a link counts as successful, s: the next retry then follows soon."""

SILENCE_S = 3.0
"""Silence after which a link counts as lost and is reopened, s. An interface that went away and came back has
silently left its multicast group."""

MOST_AT_ONCE = 64
"""Maximum number of datagrams read before other tasks get their turn."""

LARGEST_DATAGRAM = 1400
"""Size to which a presence is shortened, bytes: it passes every usual network in one piece."""

REMEMBERED = 64
"""Number of own datagrams remembered to recognize when they come back: about a second of them."""

GOODBYES = 3
"""Number of goodbyes sent on leaving, since none is acknowledged."""


class LinkAddress:
    """Address of any kind of link: a frozen dataclass whose text omits the password."""

    __slots__ = ()

    scheme: ClassVar[str]
    """URL scheme under which the carrier is registered."""


def parse_link(text: str, environment: Mapping[str, str] = os.environ) -> LinkAddress:
    """Parse a link address.

    A password that the text lacks comes from the environment variable VFGUIDE_LINK_PASSWORD.

    Raises:
        InputError: it is invalid; one line says what would be right, and never repeats a misplaced password.
    """
    try:
        return _parsed(text, environment)
    except InputError as fault:
        raise InputError(f"link address: {fault}") from None


def parse_links(texts: Sequence[str]) -> tuple[LinkAddress, ...]:
    """Parse link addresses and drop duplicates.

    Raises:
        InputError: an address is invalid, or none is given.
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
    address: LinkAddress = carrier_of(parts.scheme).address_of(parts, environment)
    return address


def carrier_of(scheme: str) -> "type[Carrier]":
    """Return the carrier class registered for a scheme."""
    found: type[Carrier] = links.find(scheme)
    return found


class LinkStatus:
    """State of one link: whether it is up, and its counters."""

    def __init__(self, address: str) -> None:
        self.connected = False
        """Whether the link is up."""
        self.detail = ""
        """Reason why the link is down; empty while it is up."""
        self.counters: Counter[str] = Counter()
        """Numbers of connections, dropped messages and errors, by reason."""
        self.settled = asyncio.Event()
        """Set once the first attempt has ended, successfully or not."""
        self.address = address
        """Address of the link, without its password."""

    def up(self) -> None:
        """Record that the link is up."""
        self.counters["connected"] += 1
        self.connected, self.detail = True, ""
        self.settled.set()
        logger.info("link %s: connected", self.address)

    def down(self, reason: str) -> None:
        """Record that the link is down."""
        if self.connected:
            self.counters["disconnected"] += 1
        else:
            self.counters["failed to connect"] += 1
        if reason.startswith("refused"):
            self.counters["refused"] += 1
        if self.connected or reason != self.detail:
            logger.warning("link %s: not connected, %s", self.address, reason)
        self.connected, self.detail = False, reason
        self.settled.set()

    def close(self) -> None:
        """Record that the link was closed on purpose."""
        self.connected = False
        logger.info("link %s: closed", self.address)

    def warn(self, counter: str, text: str) -> None:
        """Count a problem of a link that is up, and log its first occurrence."""
        self.counters[counter] += 1
        if self.counters[counter] == 1:
            logger.warning("link %s: %s", self.address, text)


link = links.register
"""Class decorator `@link("scheme")` that registers the carrier of `--link scheme://...`."""


class Carrier(ABC):
    """Carrier of messages over a broker, a network or a radio, owned by one event loop.

    A message is bytes that are already signed. A lost message is not sent again: the next state is better
    than an old one. The receiving member detects forged, old and duplicate messages.
    """

    name: ClassVar[str]
    """URL scheme of its addresses; set by `@link`."""

    presence_s: ClassVar[float] = 1.0
    """Time within which every member has reported its presence where presences are not retained, s."""

    order_lead_s: ClassVar[float] = 6.0
    """Lead of an order over its execution time, s: all members must hear it and reply."""

    greeting_s: ClassVar[float] = 0.0
    """Time that members starting together may need to hear each other, s."""

    def __init__(
        self,
        address: Any,  # noqa: ANN401 - each carrier has addresses of its own
        *,
        formation: str,
        member: Member,
        presence: Presence,
        random: Random,
    ) -> None:
        """Create a carrier that is not open yet.

        Args:
            address: result of `address_of`.
            formation: name of the formation.
            member: receives incoming messages and encodes presences.
            presence: first presence of the member.
            random: spreads the retries of members that lost the same peer.

        Raises:
            InputError: the address names a file that cannot be read.
        """
        self.address = address
        """Address of the link."""
        self.status = LinkStatus(str(address))
        """State of the link."""
        self._formation = formation
        self._member = member
        self._presence = presence
        self._random = random
        self._stop, self._wake = asyncio.Event(), asyncio.Event()
        self.prepare()

    def prepare(self) -> None:  # noqa: B027 - most need nothing
        """Set up the subclass; called once, at the end of `__init__`.

        Raises:
            InputError: the address names a file that cannot be read.
        """

    @classmethod
    @abstractmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> LinkAddress:
        """Build an address from a split URL.

        Args:
            parts: parts of the URL.
            environment: environment variables; they hold passwords, which process lists do not show.

        Raises:
            InputError: the address is invalid; one line says what would be right.
        """

    @abstractmethod
    async def visit(self) -> str:
        """Carry messages until stopped or the link fails; return the reason.

        Raises:
            Exception: whatever prevents opening the link, or ends it.
        """

    @abstractmethod
    def send(self, parcel: Parcel) -> None:
        """Send a message once, without waiting."""

    def reason_of(self, error: Exception) -> str:
        """Describe in one line why the link is down."""
        return getattr(error, "strerror", None) or described_error(error)

    async def run(self) -> None:
        """Carry messages until stopped; report errors in the status and retry for ever."""
        loop, failures = asyncio.get_running_loop(), 0
        while not self._stop.is_set():
            began_s = loop.time()
            try:
                reason = await self.visit()
            except Exception as error:  # noqa: BLE001 - a vehicle in the air is better off with another try
                reason = self.reason_of(error)
            if self._stop.is_set():
                return
            failures = 1 if loop.time() - began_s >= STABLE_S else failures + 1
            self.status.down(reason)
            with suppress(TimeoutError):
                async with asyncio.timeout(retry_delay(failures, self._random.random())):
                    await self._stop.wait()

    def stop(self) -> None:
        """Ask the link to say goodbye and end; `run` returns soon after."""
        self._stop.set()
        self._wake.set()

    def announce(self, presence: Presence) -> None:
        """Replace the presence, which is sent at once and then every second."""
        self._presence = presence
        self._wake.set()

    async def until_due(self) -> None:
        """Wait until the presence is due again."""
        with suppress(TimeoutError):
            async with asyncio.timeout(BEAT_S):
                await self._wake.wait()


class DatagramCarrier(Carrier):
    """Carrier that sends datagrams."""

    def prepare(self) -> None:
        """Initialize the link as closed, with no datagram sent or heard."""
        self._open = False
        self._broken = ""
        self._heard_s = -math.inf
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)

    @abstractmethod
    def open(self) -> None:
        """Open the medium, and call `arrived` with every datagram received.

        Raises:
            OSError: it cannot be opened; `run` tries again.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the medium."""

    @abstractmethod
    def transmit(self, data: bytes) -> None:
        """Send a datagram to all members, without waiting.

        Raises:
            OSError: it cannot be sent. A BlockingIOError loses this datagram; after any other exception the
                medium is reopened.
        """

    def arrived(self, data: bytes) -> None:
        """Take a datagram from any sender, and ignore own datagrams that come back."""
        if data not in self._sent and self._member.take(data):
            self.heard()

    def heard(self) -> None:
        """Note that a member of the formation was heard, so the link is up."""
        self._heard_s = asyncio.get_running_loop().time()
        if not self.status.connected:
            self._up()

    def broke(self, error: Exception) -> None:
        """Note that sending or receiving failed, so that the medium is reopened."""
        self._broken = self.reason_of(error)
        self._wake.set()

    def send(self, parcel: Parcel) -> None:
        """Send a message to all members, once."""
        self._send(parcel.data)

    async def visit(self) -> str:
        """Open the medium and carry messages until stopped or it fails; return the reason."""
        loop = asyncio.get_running_loop()
        self._broken = ""
        self.open()
        self._open, opened_s = True, loop.time()
        try:
            while not self._stop.is_set() and not self._broken:
                self._wake.clear()
                self.say(self._presence)
                silent_s = loop.time() - max(self._heard_s, opened_s)
                if silent_s > SILENCE_S:
                    return "nobody is heard; is anybody else on this network?"
                if not self.status.settled.is_set():
                    self._up()
                await self.until_due()
            if not self._broken and not self._member.watches:
                for _ in range(GOODBYES):
                    self.say(replace(self._presence, status="offline"))
            return self._broken
        finally:
            self._open = False
            self.close()

    def _up(self) -> None:
        if not self.status.connected:
            self.status.up()
            self._member.hurry.set()

    def say(self, presence: Presence) -> None:
        """Send the member's presence: once a second, and at the end."""
        if not self._member.watches:
            self._send(self._member.presence(presence, most=LARGEST_DATAGRAM).data)

    def _send(self, data: bytes) -> None:
        if not self._open:
            self.status.counters["dropped: not connected"] += 1
            return
        self._sent.append(data)
        try:
            self.transmit(data)
        except BlockingIOError:
            self.status.counters["dropped: no room"] += 1
        except Exception as error:  # noqa: BLE001 - of a link of one's own
            self.status.counters["failed to send"] += 1
            self.broke(error)
