"""Whether the broker hears this vehicle: its own states come back.

A broker whose access list forbids a topic takes messages for it without a word and drops them. And another
vehicle may fly under the same name by mistake.

To hear oneself takes as much of the computer as to speak. So it is done now and then, for a moment.
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
        self._speaks = False
        self._deaf = 0
        self.heard = False
        """Whether a state has come back since it was last listened for."""

    def listen(self) -> None:
        """Begin to listen for own states."""
        self._speaks = self.heard = False
        self._deaf = 0

    def speak(self, data: bytes) -> None:
        """A state is published."""
        self._sent.append(data)
        self._speaks = True

    def hear(self, data: bytes) -> bool:
        """A state under the own name came from the broker; whether it is one's own."""
        if data not in self._sent:
            return False
        self.heard = True
        return True

    def check(self) -> bool:
        """To be called every second or so while listening: whether the broker is deaf to this vehicle."""
        self._deaf = self._deaf + 1 if self._speaks and not self.heard else 0
        self._speaks = False
        return self._deaf >= DEAF_CHECKS
