"""What carries a formation's messages: the contract of a link, and whether it stands."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Mapping
from random import Random
from typing import Any, ClassVar
from urllib.parse import SplitResult

from vfguide.link.address import LinkAddress
from vfguide.link.member import Member, Parcel
from vfguide.link.presence import Presence
from vfguide.registry import links

logger = logging.getLogger(__name__)


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
        del formation
        self.address = address
        """Where the others are."""
        self.status = LinkStatus(str(address))
        """Whether it stands."""
        self._member = member
        self._presence = presence
        self._random = random

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
    async def run(self) -> None:
        """Carry until told to stop; what goes wrong shows in the status, and is tried again."""

    @abstractmethod
    def stop(self) -> None:
        """Let `run` end."""

    @abstractmethod
    def send(self, parcel: Parcel) -> None:
        """Send a message once, without waiting."""

    @abstractmethod
    def announce(self, presence: Presence) -> None:
        """Go on saying this about the member."""
