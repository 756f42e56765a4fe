"""Whether a connection stands, what went wrong in it, and one line of the log for each change."""

import asyncio
import logging
import os
from collections import Counter

from vfguide.mavlink.address import Address

logger = logging.getLogger(__name__)

REMEDY = "it is tried for ever: see that the autopilot is on, and that --mavlink names its end"
"""Whatever keeps it from being connected: a port that is not there, nobody who listens, nobody who speaks."""


class Status:
    """Of one connection."""

    def __init__(self, address: Address) -> None:
        self.connected = False
        """Whether there is somebody to send to."""
        self.counters: Counter[str] = Counter()
        """What was not sent or not delivered, by reason."""
        self.settled = asyncio.Event()
        """Set once the first try has ended, one way or the other."""
        self._address = str(address)
        self._detail = ""
        self._closed = False

    def up(self, peer: str) -> None:
        """There is somebody to send to."""
        self._change(connected=True, detail=peer)

    def down(self, reason: str) -> None:
        """There is nobody to send to."""
        self._change(connected=False, detail=reason)

    def warn(self, text: str) -> None:
        """Something else is odd about it."""
        logger.warning("MAVLink %s: %s", self._address, text, extra=self._fields(text))

    def close(self) -> None:
        """The connection ends because it is no longer wanted; what follows is no news."""
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
        return {
            "mavlink_address": self._address,
            "connected": self.connected,
            "detail": detail,
        }


def reason_of(error: Exception) -> str:
    """What went wrong, in one line."""
    if isinstance(error, ConnectionError) and error.errno:
        # asyncio puts a sentence of its own in the place of the system's.
        return os.strerror(error.errno)
    text = (isinstance(error, OSError) and error.strerror) or str(error) or type(error).__name__
    return " ".join(text.split())
