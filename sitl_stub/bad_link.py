"""A MAVLink connection that is slow and loses datagrams, between an autopilot and its companion."""

import heapq
import itertools
import math
from typing import Protocol

from numpy.random import default_rng

from sitl_stub.truth import Truth


class Emulated(Protocol):
    """What can be served: an autopilot, or one behind a bad link."""

    @property
    def system_id(self) -> int:
        """MAVLink system id."""
        ...

    @property
    def next_due_s(self) -> float:
        """The next simulation time at which anything happens by itself."""
        ...

    def receive(self, data: bytes) -> bytes:
        """Take a datagram at the present simulation time; returns what is to be sent."""
        ...

    def advance(self, to_s: float) -> bytes:
        """Fly to a simulation time; returns what is to be sent."""
        ...

    def reboot(self) -> None:
        """Start the autopilot anew."""
        ...

    def truth(self) -> Truth:
        """The true state now."""
        ...


class BadLink:
    """An autopilot behind a slow and lossy link, in both directions alike.

    Each datagram takes the delay, more or less by the jitter, or does not arrive. One with less delay
    overtakes one with more.
    """

    def __init__(
        self,
        autopilot: Emulated,
        *,
        delay_s: float = 0.0,
        jitter_s: float = 0.0,
        loss: float = 0.0,
        seed: int = 0,
    ) -> None:
        """Put the link before an autopilot that has not flown yet.

        Raises:
            ValueError: a number is out of its range; the message names it.
        """
        if not (0.0 <= jitter_s <= delay_s < math.inf):
            raise ValueError(f"jitter {jitter_s!r} s must be within 0 and the delay, {delay_s!r} s")
        if not 0.0 <= loss < 1.0:
            raise ValueError(f"loss must be 0 to below 1, not {loss!r}")
        self._autopilot = autopilot
        self._delay_s, self._jitter_s, self._loss = delay_s, jitter_s, loss
        self._random = default_rng((seed, autopilot.system_id, 2))
        self._order = itertools.count()
        self._up: list[tuple[int, int, bytes]] = []
        self._down: list[tuple[int, int, bytes]] = []
        self._now_s = 0.0

    @property
    def system_id(self) -> int:
        """MAVLink system id."""
        return self._autopilot.system_id

    @property
    def next_due_s(self) -> float:
        """The next simulation time at which the autopilot does something or a datagram arrives."""
        arrivals_s = (queue[0][0] * 1e-6 for queue in (self._up, self._down) if queue)
        return min(self._autopilot.next_due_s, *arrivals_s, math.inf)

    def receive(self, data: bytes) -> bytes:
        """Take a datagram on its way to the autopilot; returns nothing, since answers take their time."""
        self._travel(self._up, data)
        return b""

    def advance(self, to_s: float) -> bytes:
        """Fly to a simulation time; returns what has arrived from the autopilot by then."""
        to_us = round(to_s * 1e6)
        while self._up and self._up[0][0] <= to_us:
            arrival_us, _, data = heapq.heappop(self._up)
            self._fly_to(max(arrival_us * 1e-6, self._now_s))
            self._travel(self._down, self._autopilot.receive(data))
        self._fly_to(to_s)
        arrived = []
        while self._down and self._down[0][0] <= to_us:
            arrived.append(heapq.heappop(self._down)[2])
        return b"".join(arrived)

    def reboot(self) -> None:
        """Start the autopilot anew."""
        self._autopilot.reboot()

    def truth(self) -> Truth:
        """The true state now."""
        return self._autopilot.truth()

    def _fly_to(self, to_s: float) -> None:
        """Fly on, sending each instant's telemetry at its own time."""
        while (next_s := self._autopilot.next_due_s) < to_s:
            self._now_s = max(next_s, self._now_s)
            self._travel(self._down, self._autopilot.advance(self._now_s))
        self._now_s = to_s
        self._travel(self._down, self._autopilot.advance(to_s))

    def _travel(self, queue: list[tuple[int, int, bytes]], data: bytes) -> None:
        if data and not (self._loss and self._random.random() < self._loss):
            spread_s = (
                self._jitter_s * (2.0 * self._random.random() - 1.0) if self._jitter_s else 0.0
            )
            arrival_us = round((self._now_s + self._delay_s + spread_s) * 1e6)
            heapq.heappush(queue, (arrival_us, next(self._order), data))
