"""An in-memory link that delays, jitters and loses messages, in virtual time and repeatable by a seed."""

import heapq
import math
from dataclasses import dataclass
from random import Random

ROUNDING_S = 1e-9
"""Times are sums of decimal fractions: what is due now must not wait for a rounding error."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkQuality:
    """What a link does to messages."""

    delay_s: float
    """Mean time of flight, s."""
    jitter_s: float
    """Each message takes the delay plus or minus up to this, s; messages may overtake each other."""
    loss: float
    """Probability that a message does not arrive, 0 to 1."""


class MemoryLink:
    """One sender, one receiver."""

    def __init__(self, quality: LinkQuality, seed: str) -> None:
        self.quality = quality
        """May be changed at any time: it counts when a message is sent."""
        self._random = Random(seed)
        self._in_flight: list[tuple[float, int, bytes]] = []
        self._sent = 0
        self.due = math.inf
        """When the next message arrives, s; never, if infinite."""

    def send(self, data: bytes, now: float) -> None:
        """Hand a message over at this time."""
        quality = self.quality
        lost, flight = False, quality.delay_s
        # Chance is asked only where it decides something: most of a flight's messages pass here.
        if quality.loss > 0.0 or quality.jitter_s > 0.0:
            lost = self._random.random() < quality.loss
            flight += quality.jitter_s * self._random.uniform(-1.0, 1.0)
        if not lost:
            self._sent += 1
            heapq.heappush(self._in_flight, (now + max(flight, 0.0), self._sent, data))
            self.due = self._in_flight[0][0]

    def receive(self, now: float) -> list[bytes]:
        """Messages that have arrived by this time, in the order of their arrival."""
        arrived = []
        while self.due <= now + ROUNDING_S:
            arrived.append(heapq.heappop(self._in_flight)[2])
            self.due = self._in_flight[0][0] if self._in_flight else math.inf
        return arrived
