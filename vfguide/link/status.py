"""Whether the link stands, and one line of the log for each change."""

import asyncio
import logging
from collections import Counter

logger = logging.getLogger(__name__)


class LinkStatus:
    """Of one link."""

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
        """Of the link, without its password."""

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
