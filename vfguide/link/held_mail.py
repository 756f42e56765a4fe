"""States that one who only watches has not looked at yet, of each sender the newest first.

A signature that is not looked at costs nothing, and of each sender the newest state is enough. A forged one
must not stand before a true one: those before it are kept until one is believed.
"""

from collections import deque
from collections.abc import Iterator

from vfguide.link.envelope import state_sender

WATCH_S = 0.25
"""s between looks of one who only watches."""

MOST_HELD = 64
"""States of one sender that are kept between two looks: honest ones are three or four."""

MOST_SENDERS = 128
"""Names are not believed yet: beyond this nothing is kept."""


class HeldMail:
    """What has come since the last look."""

    def __init__(self) -> None:
        """Make one that holds nothing."""
        self._held: dict[bytes, deque[bytes]] = {}

    def __len__(self) -> int:
        """How many senders' states wait."""
        return len(self._held)

    def put(self, data: bytes) -> bool:
        """Keep a state for the next look; False for what is none, or has no room."""
        sender = state_sender(data)
        if sender is None or (sender not in self._held and len(self._held) >= MOST_SENDERS):
            return False
        self._held.setdefault(sender, deque(maxlen=MOST_HELD)).append(data)
        return True

    def take(self) -> Iterator[tuple[bytes, ...]]:
        """The states of each sender, the newest first; nothing is held any more."""
        held, self._held = self._held, {}
        for states in held.values():
            yield tuple(reversed(states))

    def clear(self) -> None:
        """Forget everything."""
        self._held.clear()
