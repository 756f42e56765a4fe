"""Whether the broker hears this vehicle: its own states come back.

A broker whose access list forbids a topic takes messages for it without a word and drops them. And another
vehicle may fly under the same name by mistake.
"""

from collections import deque

REMEMBERED = 256
"""States that may be on their way there and back; some seconds of them."""

DEAF_CHECKS = 2
"""Checks in a row with states sent and none heard, after which it is no delay any more."""


class Echo:
    """States of one vehicle, as sent and as heard."""

    def __init__(self) -> None:
        self._sent: deque[bytes] = deque(maxlen=REMEMBERED)
        self._unheard_since: float | None = None
        self._speaks = self._hears = False
        self._deaf = 0

    def speak(self, data: bytes, now: float) -> None:
        """A state is published."""
        self._sent.append(data)
        self._speaks = True
        if self._unheard_since is None:
            self._unheard_since = now

    def hear(self, data: bytes) -> bool:
        """A state under the own name came from the broker; whether it is one's own."""
        if data not in self._sent:
            return False
        self._hears = True
        self._unheard_since = None
        return True

    def age(self, now: float) -> float:
        """For how long states have been published without one coming back, s; 0 where all is well."""
        return 0.0 if self._unheard_since is None else max(now - self._unheard_since, 0.0)

    def check(self) -> bool:
        """To be called every second or so while connected: whether the broker is deaf to this vehicle."""
        self._deaf = self._deaf + 1 if self._speaks and not self._hears else 0
        self._speaks = self._hears = False
        return self._deaf >= DEAF_CHECKS
