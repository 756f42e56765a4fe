"""The emulated radio channel: serial lines, the air, collisions, losses and bursts."""

from itertools import pairwise
from random import Random

import pytest

from vfguide.lab.rehearsal.emulated_radio import Bursts, EmulatedRadio, RadioAir, RadioQuality
from vfguide.link.radio_schedule import Channel, Turn

CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)
DATA = bytes(range(1, 41))
"""40 bytes: 6.944 ms over the line, 10 ms over the air."""


class Listener:
    """Notes what it hears, and speaks at one time."""

    def __init__(self, air: RadioAir, speaks_s: float | None = None, **clock: float) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self._air = air
        self._turn = None if speaks_s is None else Turn(at_s=speaks_s)
        self.radio: EmulatedRadio = air.add(self, **({"offset_s": 0.0, "rate": 1.0} | clock))

    def begin(self, now: float) -> None:
        self.began_s = now

    def next_turn(self, now: float) -> Turn | None:
        return self._turn if self._turn is not None and self._turn.at_s >= now else None

    def speak(self, turn: Turn, now: float) -> bytes:
        assert now == turn.at_s
        self._turn = None
        return DATA

    def hear(self, data: bytes, now: float) -> bool:
        if data:
            self.heard.append((now, data))
        return bool(data)

    @property
    def content(self) -> bytes:
        return b"".join(data for _, data in self.heard)


def test_a_packet_takes_two_lines_and_the_air():
    air = RadioAir(RadioQuality(channel=CHANNEL))
    sender, listener = Listener(air, 1.0), Listener(air)
    air.run(2.0)
    assert listener.content == DATA
    assert listener.heard[0][0] == pytest.approx(1.0 + 2 * 400 / 57_600 + 0.01)
    assert not sender.heard
    assert air.counters == {"packets": 1, "bytes": 40}


@pytest.mark.parametrize(("apart_s", "collide"), [(0.0099, True), (0.0101, False)])
def test_packets_collide_where_they_are_on_the_air_together(apart_s, collide):
    air = RadioAir(RadioQuality(channel=CHANNEL))
    Listener(air, 1.0)
    Listener(air, 1.0 + apart_s)
    third = Listener(air)
    air.run(2.0)
    assert air.counters["in collisions"] == (2 if collide else 0)
    assert (third.content == DATA + DATA) is not collide
    assert DATA not in third.content or not collide


def test_a_radio_that_is_unplugged_neither_hears_nor_is_heard():
    air = RadioAir(RadioQuality(channel=CHANNEL))
    first, second = Listener(air, 1.0), Listener(air, 1.5)
    second.radio.on = False
    air.run(2.0)
    assert not first.heard
    assert not second.heard


def test_every_receiver_loses_its_own_share():
    air = RadioAir(RadioQuality(channel=CHANNEL, loss=0.25))
    listeners = [Listener(air), Listener(air)]
    for number in range(2000):
        air.transmit(b"%d" % number + b" whole")
        air.run(air.now + 0.05)
    for one in listeners:
        # Four deviations of 2000 trials: 0.04.
        assert one.content.count(b" whole") / 2000 == pytest.approx(0.75, abs=0.04)
    assert listeners[0].content != listeners[1].content


def test_bursts_take_their_share_of_the_time_and_last_as_long_as_they_should():
    quality = RadioQuality(channel=CHANNEL, burst_share=0.2, burst_s=2.0)
    bursts = Bursts(quality, Random(1))
    deaf = [bursts.is_deaf(0.1 * number) for number in range(200_000)]
    assert sum(deaf) / len(deaf) == pytest.approx(0.2, abs=0.02)
    begun = sum(now and not before for before, now in pairwise(deaf))
    assert 0.1 * sum(deaf) / begun == pytest.approx(2.0, abs=0.2)


def test_a_clock_that_runs_otherwise_moves_turns():
    """A clock that shows 100 s at the start and runs twice as fast: 102 s is after a second."""
    air = RadioAir(RadioQuality(channel=CHANNEL))
    listener = Listener(air)
    fast = Listener(air, 102.0, offset_s=100.0, rate=2.0)
    assert fast.began_s == 100.0
    air.run(2.0)
    assert listener.heard[0][0] == pytest.approx(1.0 + 2 * 400 / 57_600 + 0.01)
