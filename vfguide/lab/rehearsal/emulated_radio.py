"""A radio channel that several stations share, in virtual time and repeatable by a seed.

Each station's packets go over a serial line to its radio (ten bits a byte), from there over the air, and over
another serial line to every other station. A radio keeps a packet until all of it has come, and sends it then
whether or not it hears another: it hears nothing while it sends, and two packets that are on the air together
destroy each other. Every receiver has losses and bursts of its own. Of what was destroyed, half arrives as
damaged bytes.
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
    """What the radios do to packets."""

    channel: Channel = field(default_factory=lambda: Channel(baud=57_600, air_bytes_s=4000.0))
    """How fast they are."""
    loss: float = 0.0
    """Probability that a receiver misses a packet outside bursts, 0 to 1."""
    burst_share: float = 0.0
    """Share of the time that a receiver is in a burst, in which it misses everything, 0 to below 1."""
    burst_s: float = 1.0
    """Mean length of a burst, s."""


class Speaker(Protocol):
    """What can be on the air: `vfguide.link.radio_station.Station`. Times are on its own clock, s."""

    def begin(self, now: float) -> None:
        """Begin to hear."""

    def next_turn(self, now: float) -> Turn | None:
        """When it sends next."""

    def speak(self, turn: Turn, now: float) -> bytes:
        """What it sends then."""

    def hear(self, data: bytes, now: float) -> bool:
        """Take bytes, cut anywhere."""


class Bursts:
    """One receiver's bursts: exponential times within and between them."""

    def __init__(self, quality: RadioQuality, random: Random) -> None:
        self._share, self._mean_s = quality.burst_share, quality.burst_s
        self._random = random
        self._deaf = random.random() < self._share
        self._ends_s = 0.0

    def is_deaf(self, now: float) -> bool:
        """Whether a burst hits what arrives now."""
        if self._share <= 0.0:
            return False
        while self._ends_s <= now:
            self._deaf = not self._deaf
            mean_s = self._mean_s * (1.0 if self._deaf else 1.0 / self._share - 1.0)
            self._ends_s += self._random.expovariate(1.0 / mean_s)
        return self._deaf


@dataclass(slots=True, kw_only=True, eq=False)
class EmulatedRadio:
    """A station's end of the channel."""

    station: Speaker
    """What it belongs to."""
    bursts: Bursts
    """That it hears nothing in."""
    offset_s: float
    """The station's clock at virtual time 0, s."""
    rate: float
    """Seconds of that clock in a second."""
    on: bool = True
    """Whether it is plugged in."""
    line_free_s: float = 0.0
    """When the line to it is free again, s of virtual time."""
    version: int = 0
    """Version of its next turn; earlier ones are void."""

    def clock(self, now: float) -> float:
        """What the station's clock shows at a virtual time, s."""
        return self.offset_s + self.rate * now

    def virtual(self, clock_s: float) -> float:
        """The virtual time at which the station's clock shows this, s."""
        return (clock_s - self.offset_s) / self.rate


@dataclass(slots=True, kw_only=True, eq=False)
class Transmission:
    """A packet on the air."""

    sender: EmulatedRadio | None
    """None for one from outside."""
    data: bytes
    """What is sent."""
    begins_s: float
    """Virtual time, s."""
    ends_s: float
    """Virtual time, s."""
    destroyed: bool = False
    """Whether another is on the air, too."""


class RadioAir:
    """The channel with all its stations."""

    def __init__(self, quality: RadioQuality, *, seed: object = 0) -> None:
        """Make a channel that nobody is on.

        Args:
            quality: what the radios do to packets.
            seed: of all chance.
        """
        self.now = 0.0
        """Virtual time, s."""
        self.counters: Counter[str] = Counter()
        """Packets and bytes on the air, and what became of them."""
        self.radios: list[EmulatedRadio] = []
        """Those of the stations."""
        self.quality = quality
        """What the radios do to packets."""
        self._seed = seed
        self._random = Random(f"{seed} air")
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        self._number = count()
        self._on_air: list[Transmission] = []

    def add(self, station: Speaker, *, offset_s: float = 0.0, rate: float = 1.0) -> EmulatedRadio:
        """Plug a station in now.

        Args:
            station: one that has not begun.
            offset_s: its clock at virtual time 0, s.
            rate: seconds of that clock in a second.
        """
        random = Random(f"{self._seed} radio {len(self.radios)}")
        radio = EmulatedRadio(
            station=station,
            bursts=Bursts(self.quality, random),
            offset_s=offset_s,
            rate=rate,
        )
        self.radios.append(radio)
        station.begin(radio.clock(self.now))
        self._plan(radio)
        return radio

    def run(self, until_s: float) -> None:
        """Let everything happen up to a virtual time, s."""
        while self._events and self._events[0][0] <= until_s:
            at_s, _, event = heapq.heappop(self._events)
            self.now = max(self.now, at_s)
            event()
        self.now = until_s

    def transmit(self, data: bytes, *, sender: EmulatedRadio | None = None) -> None:
        """Have a radio send: that of a station, or one from outside that needs no line."""
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
        """See when a station's next turn is; what was planned before is void."""
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
        """What a radio makes of a packet; nothing, or damaged bytes, where it is lost."""
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
        """Hand bytes to a station, cut somewhere as serial ports do."""
        if not radio.on:
            return
        now, cut = radio.clock(self.now), self._random.randrange(len(data) + 1)
        radio.station.hear(data[:cut], now)
        radio.station.hear(data[cut:], now)
        self._plan(radio)
