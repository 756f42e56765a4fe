"""Followers' states on their way to the other followers, in virtual time.

The aircraft of a formation may be flown by several processes. They exchange what followers publish at the
end of each window of some instants; it is handed to the links at the beginning of the window after next, so
that no process waits for another that is flying the same window. The number of processes changes nothing.
"""

from vfguide.companion.follower_role import PUBLISH_S
from vfguide.link.memory import Mail

WINDOWS = 2
"""From the window in which something is published to the one in which it is handed to the links."""


def window_length(rate_hz: float) -> int:
    """Instants in a window: a follower publishes about once in it."""
    return max(round(PUBLISH_S * rate_hz), 1)


class Exchange:
    """Mail by the window in which it is due."""

    def __init__(self) -> None:
        self._due: dict[int, list[Mail]] = {}

    def post(self, window: int, mail: list[Mail]) -> None:
        """Mail that was published in this window."""
        self._due.setdefault(window + WINDOWS, []).extend(mail)

    def collect(self, window: int) -> list[Mail]:
        """Mail that is due when this window begins."""
        return self._due.pop(window, [])
