"""Radio channel shared by several stations, in virtual time and repeatable by a seed.

A station's packets go over a serial line to its radio (ten bits per byte) and over the air. Another serial
line takes them to every other station. A radio sends a packet as soon as all of it has come, whether or not
it hears another. It hears nothing while it sends, and packets that overlap on the air destroy each other.
Every receiver has losses and bursts of its own. Half of the lost packets arrive as damaged bytes.
"""

import heapq
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from random import Random
from typing import Protocol

from vfguide.link.radio_schedule import Channel, Turn


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioQuality:
    """Speed and losses of the radios."""

    channel: Channel = field(default_factory=lambda: Channel(baud=57_600, air_bytes_s=4000.0))
    loss: float = 0.0
    """Probability that a receiver misses a packet outside bursts, 0 to 1."""
    burst_share: float = 0.0
    """Share of the time in bursts, in which a receiver misses everything, 0 to below 1."""
    burst_s: float = 1.0
    """Mean length of a burst."""


class Speaker(Protocol):
    """Station on the channel, as `vfguide.link.radio_station.Station`; times are on its own clock, s."""

    def begin(self, now: float) -> None:
        """Begin to hear."""

    def next_turn(self, now: float) -> Turn | None:
        """Return the next turn to send."""

    def speak(self, turn: Turn, now: float) -> bytes:
        """Return the bytes to send in this turn."""

    def hear(self, data: bytes, now: float) -> bool:
        """Take received bytes, cut anywhere."""


class Bursts:
    """Bursts of one receiver, with exponential times within and between them."""

    def __init__(self, quality: RadioQuality, random: Random) -> None:
        self._share, self._mean_s = quality.burst_share, quality.burst_s
        self._random = random
        self._deaf = random.random() < self._share
        self._ends_s = 0.0

    def is_deaf(self, now: float) -> bool:
        """Check whether a burst hits a packet that arrives now."""
        if self._share <= 0.0:
            return False
        while self._ends_s <= now:
            self._deaf = not self._deaf
            mean_s = self._mean_s * (1.0 if self._deaf else 1.0 / self._share - 1.0)
            self._ends_s += self._random.expovariate(1.0 / mean_s)
        return self._deaf


@dataclass(slots=True, kw_only=True, eq=False)
class EmulatedRadio:
    """Station's end of the channel."""

    station: Speaker
    bursts: Bursts
    offset_s: float
    """Station's clock at virtual time 0."""
    rate: float
    """Seconds of the station's clock per second of virtual time."""
    on: bool = True
    """Whether the station is plugged in."""
    line_free_s: float = 0.0
    """Virtual time at which the serial line to the radio is free again."""
    version: int = 0
    """Version of the next turn; turns of earlier versions are void."""

    def clock(self, now: float) -> float:
        """Convert a virtual time to the station's clock, s."""
        return self.offset_s + self.rate * now

    def virtual(self, clock_s: float) -> float:
        """Convert a time on the station's clock to virtual time, s."""
        return (clock_s - self.offset_s) / self.rate


@dataclass(slots=True, kw_only=True, eq=False)
class Transmission:
    """Packet on the air, in virtual time."""

    sender: EmulatedRadio | None
    """Sending radio; None for a packet from outside."""
    data: bytes
    begins_s: float
    ends_s: float
    destroyed: bool = False
    """Whether another packet overlaps."""


class RadioAir:
    """Channel with all its stations."""

    def __init__(self, quality: RadioQuality, *, seed: object = 0) -> None:
        """Make a channel without stations; `seed` determines all random events."""
        self.now = 0.0
        """Virtual time, s."""
        self.counters: Counter[str] = Counter()
        """Numbers of packets and bytes on the air, of collisions and of misses."""
        self.radios: list[EmulatedRadio] = []
        self.quality = quality
        self._seed = seed
        self._random = Random(f"{seed} air")
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self._on_air: list[Transmission] = []

    def add(self, station: Speaker, *, offset_s: float = 0.0, rate: float = 1.0) -> EmulatedRadio:
        """Plug in a station whose clock shows `offset_s` at virtual time 0 and runs `rate` times as fast."""
        random = Random(f"{self._seed} radio {len(self.radios)}")
        radio = EmulatedRadio(
            station=station, bursts=Bursts(self.quality, random), offset_s=offset_s, rate=rate
        )
        self.radios.append(radio)
        station.begin(radio.clock(self.now))
        self._plan(radio)
        return radio

    def run(self, until_s: float) -> None:
        """Advance to a virtual time, s."""
        while self._events and self._events[0][0] <= until_s:
            at_s, _, event = heapq.heappop(self._events)
            self.now = max(self.now, at_s)
            event()
        self.now = until_s

    def transmit(self, data: bytes, *, sender: EmulatedRadio | None = None) -> None:
        """Send a packet from a station's radio, or from outside, which needs no serial line."""
        channel, begins_s = self.quality.channel, self.now
        if sender is not None:
            begins_s = max(begins_s, sender.line_free_s) + len(data) * 10.0 / channel.baud
            sender.line_free_s = begins_s
        ends_s = begins_s + len(data) / channel.air_bytes_s
        sent = Transmission(sender=sender, data=data, begins_s=begins_s, ends_s=ends_s)
        self._at(begins_s, lambda: self._begin(sent))

    def _at(self, at_s: float, event: Callable[[], None]) -> None:
        heapq.heappush(self._events, (at_s, next(self._number), event))

    def _plan(self, radio: EmulatedRadio) -> None:
        """Schedule a station's next turn, and void the one before."""
        radio.version += 1
        turn = radio.station.next_turn(radio.clock(self.now))
        if turn is not None and math.isfinite(turn.at_s):
            version = radio.version
            at_s = max(radio.virtual(turn.at_s), self.now)
            self._at(at_s, lambda: self._take_turn(radio, turn, version))

    def _take_turn(self, radio: EmulatedRadio, turn: Turn, version: int) -> None:
        if version != radio.version:
            return
        data = radio.station.speak(turn, max(radio.clock(self.now), turn.at_s))
        if data and radio.on:
            self.transmit(data, sender=radio)
        self._plan(radio)

    def _begin(self, sent: Transmission) -> None:
        self.counters["packets"] += 1
        self.counters["bytes"] += len(sent.data)
        for other in self._on_air:
            other.destroyed = sent.destroyed = True
        self._on_air.append(sent)
        self._at(sent.ends_s, lambda: self._end(sent))

    def _end(self, sent: Transmission) -> None:
        self._on_air.remove(sent)
        if sent.destroyed:
            self.counters["in collisions"] += 1
        line_s = len(sent.data) * 10.0 / self.quality.channel.baud
        sending = {other.sender for other in self._on_air}
        for radio in self.radios:
            if radio is sent.sender or radio in sending or not radio.on:
                continue
            data = self._received(sent, radio)
            if data:
                self._at(self.now + line_s, lambda r=radio, d=data: self._deliver(r, d))  # type: ignore[misc]

    def _received(self, sent: Transmission, radio: EmulatedRadio) -> bytes:
        """Return a packet as a radio receives it: whole or, where it is lost, empty or damaged."""
        lost = sent.destroyed or radio.bursts.is_deaf(self.now)
        if not lost and self.quality.loss > 0.0:
            lost = self._random.random() < self.quality.loss
        if not lost:
            return sent.data
        self.counters["missed"] += 1
        if self._random.random() < 0.5:
            return b""
        damaged = bytearray(sent.data[: self._random.randrange(1, len(sent.data) + 1)])
        damaged[self._random.randrange(len(damaged))] ^= self._random.randrange(1, 256)
        return bytes(damaged)

    def _deliver(self, radio: EmulatedRadio, data: bytes) -> None:
        """Hand bytes to a station in two pieces, as serial ports do."""
        if not radio.on:
            return
        now, cut = radio.clock(self.now), self._random.randrange(len(data) + 1)
        radio.station.hear(data[:cut], now)
        radio.station.hear(data[cut:], now)
        self._plan(radio)
