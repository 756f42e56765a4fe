"""An in-memory link that delays, jitters and loses messages, in virtual time and repeatable by a seed."""

import heapq
from collections.abc import Mapping, Sequence
from random import Random

import msgspec

Mail = tuple[str, bytes]
"""Name of the vehicle that published something, and what."""

ROUNDING_S = 1e-9
"""Times are sums of decimal fractions: what is due now must not wait for a rounding error."""


class LinkQuality(msgspec.Struct, frozen=True, kw_only=True):
    """What a link does to messages."""

    delay_s: float
    """Mean time of flight, s."""
    jitter_s: float
    """Each message takes the delay plus or minus up to this, s; messages may overtake each other."""
    loss: float
    """Probability that a message does not arrive, 0 to 1."""


class MemoryLink:
    """Many senders, one receiver."""

    def __init__(self, quality: LinkQuality, seeds: Mapping[str, str]) -> None:
        """Make one that has nothing in flight.

        Args:
            quality: what it does to messages.
            seeds: of the chance that messages meet, by sender; those of anybody else are for somebody else.
        """
        self.quality = quality
        """May be changed at any time: it counts when a message is sent."""
        self._seeds = seeds
        self._randoms: dict[str, Random] = {}
        self._in_flight: list[tuple[float, int, Sequence[Mail]]] = []
        self._sent = 0

    def send(self, mail: Sequence[Mail], now: float) -> None:
        """Hand messages over at this time."""
        quality = self.quality
        heard = [one for one in mail if one[0] in self._seeds]
        # Chance is asked only where it decides something: else what is sent together arrives together.
        if quality.loss > 0.0 or quality.jitter_s > 0.0:
            for one in heard:
                random = self._random(one[0])
                lost = random.random() < quality.loss
                flight = quality.delay_s + quality.jitter_s * random.uniform(-1.0, 1.0)
                if not lost:
                    self._launch([one], now + max(flight, 0.0))
        elif heard:
            self._launch(heard, now + max(quality.delay_s, 0.0))

    def receive(self, now: float) -> list[Mail]:
        """Messages that have arrived by this time, in the order of their arrival."""
        arrived: list[Mail] = []
        while self._in_flight and self._in_flight[0][0] <= now + ROUNDING_S:
            arrived += heapq.heappop(self._in_flight)[2]
        return arrived

    def clear(self) -> None:
        """Forget what is in flight, as for a receiver that is not there."""
        self._in_flight.clear()

    def _launch(self, mail: Sequence[Mail], arrival: float) -> None:
        self._sent += 1
        heapq.heappush(self._in_flight, (arrival, self._sent, mail))

    def _random(self, sender: str) -> Random:
        """Random numbers of one sender alone, so that its losses do not depend on the others."""
        if sender not in self._randoms:
            self._randoms[sender] = Random(self._seeds[sender])
        return self._randoms[sender]
