"""In-memory link with delay, jitter and loss, in virtual time and repeatable by seeds."""

import heapq
from collections.abc import Mapping, Sequence
from random import Random

import msgspec

Mail = tuple[str, bytes]
"""Name of the publishing vehicle, and its message."""

ROUNDING_S = 1e-9
"""Tolerance of arrival times, s: sums of decimal fractions have rounding errors."""


class LinkQuality(msgspec.Struct, frozen=True, kw_only=True):
    """Delay, jitter and loss of a link."""

    delay_s: float
    """Mean delay, s."""
    jitter_s: float
    """Greatest deviation of a message's delay, s; messages may overtake each other."""
    loss: float
    """Probability that a message is lost, 0 to 1."""


class MemoryLink:
    """Link from many senders to one receiver."""

    def __init__(self, quality: LinkQuality, seeds: Mapping[str, str]) -> None:
        """Create a link with nothing in flight and random seeds by sender; other senders are ignored."""
        self.quality = quality
        """Delay, jitter and loss; may be changed at any time and apply to messages sent later."""
        self._seeds = seeds
        self._randoms: dict[str, Random] = {}
        self._in_flight: list[tuple[float, int, Sequence[Mail]]] = []
        self._sent = 0

    def send(self, mail: Sequence[Mail], now: float) -> None:
        """Send messages at this time, s."""
        quality = self.quality
        heard = [one for one in mail if one[0] in self._seeds]
        # Random numbers are drawn only where they matter; otherwise messages sent together arrive together.
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
        """Return the messages that have arrived by this time, in the order of arrival."""
        arrived: list[Mail] = []
        while self._in_flight and self._in_flight[0][0] <= now + ROUNDING_S:
            arrived += heapq.heappop(self._in_flight)[2]
        return arrived

    def clear(self) -> None:
        """Drop all messages in flight, as for a receiver that is not there."""
        self._in_flight.clear()

    def _launch(self, mail: Sequence[Mail], arrival: float) -> None:
        self._sent += 1
        heapq.heappush(self._in_flight, (arrival, self._sent, mail))

    def _random(self, sender: str) -> Random:
        """Return the random numbers of one sender, so that its losses do not depend on other senders."""
        if sender not in self._randoms:
            self._randoms[sender] = Random(self._seeds[sender])
        return self._randoms[sender]
