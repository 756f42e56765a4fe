"""What carries a formation's messages: its address, the contract of a link, and whether it stands.

A link without a broker sends every message to all at once, and everybody picks out what is of use. Its
subclass opens something, sends bytes by it and hands over the bytes that arrive; presences and goodbyes are
said here.
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
"""s between presences, by which others see that this member lives, and the link that it does."""

STABLE_S = 5.0
"""A link that stood this long was a success: the next try follows soon."""

SILENCE_S = 3.0
"""After this long without a word from anybody the link counts as lost, and is opened again: an interface that
goes away and comes back is in no group any more, and says nothing of that."""

MOST_AT_ONCE = 64
"""Datagrams that are read before anything else gets its turn."""

LARGEST_DATAGRAM = 1400
"""Bytes that pass every usual network in one piece: a presence that is longer goes with less in it."""

REMEMBERED = 64
"""Own datagrams that may come back: a second of them."""

GOODBYES = 3
"""Times that a member says that it leaves: nobody answers."""


class LinkAddress:
    """Address of any kind of link: a frozen dataclass; as text it has no password."""

    __slots__ = ()

    scheme: ClassVar[str]
    """The scheme by which its carrier is known."""


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
    address: LinkAddress = carrier_of(parts.scheme).address_of(parts, environment)
    return address


def carrier_of(scheme: str) -> "type[Carrier]":
    """What carries messages to addresses of a scheme."""
    found: type[Carrier] = links.find(scheme)
    return found


class LinkStatus:
    """State of one link: whether it is up, and what was counted on it."""

    def __init__(self, address: str) -> None:
        self.connected = False
        """Whether the broker listens."""
        self.detail = ""
        """Why it does not."""
        self.counters: Counter[str] = Counter()
        """What was dropped and what went wrong, by reason."""
        self.settled = asyncio.Event()
        """Set once the first try has ended, one way or the other."""
        self.address = address
        """Address of the link, without its password."""

    def up(self) -> None:
        """The broker listens."""
        self.counters["connected"] += 1
        self.connected, self.detail = True, ""
        self.settled.set()
        logger.info("link %s: connected", self.address)

    def down(self, reason: str) -> None:
        """The broker does not listen."""
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
        """The link ends because it is no longer wanted."""
        self.connected = False
        logger.info("link %s: closed", self.address)

    def warn(self, counter: str, text: str) -> None:
        """Something is wrong with a link that stands; the log hears of it the first time."""
        self.counters[counter] += 1
        if self.counters[counter] == 1:
            logger.warning("link %s: %s", self.address, text)


link = links.register
"""`@link("scheme")` makes a class known as the carrier of `--link scheme://...`."""


class Carrier(ABC):
    """Carries messages: by a broker, a network or a radio. All of it belongs to one event loop.

    A message is bytes that are signed already. One that is lost is not sent again: the next state is better
    than an old one. One that is forged, old or doubled is found out by the member that takes it.
    """

    name: ClassVar[str]
    """The scheme of its addresses; set by `@link`."""

    presence_s: ClassVar[float] = 1.0
    """Every member has said how it is within this time, s, where presences are not kept."""

    order_lead_s: ClassVar[float] = 6.0
    """An order is given so long before its time, s: to be heard and answered by all."""

    greeting_s: ClassVar[float] = 0.0
    """Those who begin at the same time may take so long to be heard by each other, s."""

    def __init__(
        self,
        address: Any,  # noqa: ANN401 - each carrier has addresses of its own
        *,
        formation: str,
        member: Member,
        presence: Presence,
        random: Random,
    ) -> None:
        """Make one that carries nothing yet.

        Args:
            address: what `address_of` has found.
            formation: name of the formation.
            member: takes what arrives, and says how it is.
            presence: what the member says about itself at first.
            random: keeps members that lost the same peer from coming back in step.

        Raises:
            InputError: the address names a file that cannot be read.
        """
        self.address = address
        """Where the others are."""
        self.status = LinkStatus(str(address))
        """Whether it stands."""
        self._formation = formation
        self._member = member
        self._presence = presence
        self._random = random
        self._stop, self._wake = asyncio.Event(), asyncio.Event()
        self.prepare()

    def prepare(self) -> None:  # noqa: B027 - most need nothing
        """Make ready what it carries by; called once, before all else.

        Raises:
            InputError: the address names a file that cannot be read.
        """

    @classmethod
    @abstractmethod
    def address_of(cls, parts: SplitResult, environment: Mapping[str, str]) -> LinkAddress:
        """The address that a text names.

        Args:
            parts: of the text.
            environment: with passwords, which lists of processes do not show.

        Raises:
            InputError: it names none; one line that says what would be right.
        """

    @abstractmethod
    async def visit(self) -> str:
        """Carry until told to stop or until it is of no use; why that is.

        Raises:
            Exception: whatever keeps it from being opened, or ends it.
        """

    @abstractmethod
    def send(self, parcel: Parcel) -> None:
        """Send a message once, without waiting."""

    def reason_of(self, error: Exception) -> str:
        """Why it does not stand, in one line."""
        return getattr(error, "strerror", None) or described_error(error)

    async def run(self) -> None:
        """Carry until told to stop; what goes wrong shows in the status, and is tried again for ever."""
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
        """Say goodbye; `run` ends soon after."""
        self._stop.set()
        self._wake.set()

    def announce(self, presence: Presence) -> None:
        """Go on saying this about the member, at once and every second."""
        self._presence = presence
        self._wake.set()

    async def until_due(self) -> None:
        """Wait until the presence is to be said again."""
        with suppress(TimeoutError):
            async with asyncio.timeout(BEAT_S):
                await self._wake.wait()


class DatagramCarrier(Carrier):
    """Carries messages by datagrams."""

    def prepare(self) -> None:
        """Make ready."""
        self._open = False
        self._broken = ""
        self._heard_s = -math.inf
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)

    @abstractmethod
    def open(self) -> None:
        """Open what it sends and hears by; `arrived` is called with all that is heard.

        Raises:
            OSError: it cannot be opened; it is tried again.
        """

    @abstractmethod
    def close(self) -> None:
        """Close it."""

    @abstractmethod
    def transmit(self, data: bytes) -> None:
        """Send a datagram to all, without waiting.

        Raises:
            OSError: it cannot be sent. A BlockingIOError loses this datagram; after any other exception it is
                opened again.
        """

    def arrived(self, data: bytes) -> None:
        """Take a datagram, of whomever; own ones that come back are passed over."""
        if data not in self._sent and self._member.take(data):
            self.heard()

    def heard(self) -> None:
        """Note that a member of the formation was heard: the link stands."""
        self._heard_s = asyncio.get_running_loop().time()
        if not self.status.connected:
            self._up()

    def broke(self, error: Exception) -> None:
        """Note that sending or hearing failed: it is opened again."""
        self._broken = self.reason_of(error)
        self._wake.set()

    def send(self, parcel: Parcel) -> None:
        """Send a message to all, once."""
        self._send(parcel.data)

    async def visit(self) -> str:
        """Carry from opening it until it is of no use; why that is."""
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
        """Say how this member is: once a second, and at the end."""
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
