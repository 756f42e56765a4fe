"""Members of a formation that share a radio, in virtual time."""

from collections import Counter
from itertools import count
from typing import Any

from tests.kit.link import FORMATION, KEYS, LEADER, trust_of
from tests.kit.radio import state_at
from vfguide.lab.rehearsal.emulated_radio import EmulatedRadio, RadioAir, RadioQuality
from vfguide.link.codec import decode
from vfguide.link.member import Member, ignore
from vfguide.link.packed import PackedKind, decode_packet
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.radio_schedule import Channel, Framer, make_timetable
from vfguide.link.radio_station import Station

CHANNEL = Channel(baud=57_600, air_bytes_s=4000.0)
KEY = bytes(range(32))
NAMES = (LEADER, "f1", "f2")
STEP_S = 0.05
ASK_S = 0.2


class Craft:
    """One member with its station on the air."""

    def __init__(
        self,
        channel: "Shared",
        name: str,
        *,
        session: int,
        key: bytes = KEY,
        formation: str = FORMATION,
        vehicles: tuple[str, ...] = NAMES,
        watches: bool = False,
        orders: bool = False,
        offset_s: float = 0.0,
        rate: float = 1.0,
        listens_first: bool | None = None,
    ) -> None:
        leads = name == LEADER
        air = channel.air
        self.name = name
        self.heard: list[tuple[float, float]] = []
        """Times of the leader's states, and when they came, s of virtual time."""
        self.neighbours: list[tuple[str, float]] = []
        self.presences: dict[str, Presence] = {}
        self.orders: list[tuple[bytes, bool]] = []
        """Orders, and whether each was repeated by a vehicle."""
        self.replies: list[tuple[str, bytes]] = []
        self.publishes = not (watches or orders)
        self.peer_clock: Any = (
            None if leads or watches else PeerClock(chance=count(1 + 1000 * session).__next__)
        )
        signed = formation == FORMATION and not watches and name in KEYS
        trust = trust_of(name, session, signed=signed, formation=formation, watches=watches)

        def note(data: bytes) -> None:
            self.heard.append((decode(data).time_s, air.now))

        def note_neighbour(vehicle: str, data: bytes) -> None:
            self.neighbours.append((vehicle, decode(data).time_s))

        def note_order(data: bytes, sealed: bytes, repeated: bool) -> None:
            self.sealed = sealed
            self.orders.append((data, repeated))

        self.member = Member(
            trust,
            clock=lambda: offset_s + rate * air.now,
            receive=ignore if leads or watches else note,
            neighbours=[one for one in vehicles[1:] if one != name],
            receive_neighbour=note_neighbour,
            receive_presence=self.presences.__setitem__ if watches or orders else None,
            receive_order=None if watches else note_order,
            receive_reply=None if watches else lambda *reply: self.replies.append(reply),
            peer_clock=self.peer_clock,
        )
        table = make_timetable(len(vehicles), leader_hz=10.0, followers_hz=2.5, channel=CHANNEL)
        self.station = Station(
            self.member,
            formation=formation,
            vehicles=vehicles,
            key=key,
            channel=CHANNEL,
            timetable=table if leads else None,
            listens_first=not leads if listens_first is None else listens_first,
        )
        self.member.send = lambda parcel: self.station.post(parcel, self.member.clock())
        self.station.announce(Presence(status="online", mode="tracking", time_s=0.0, version="1"))
        self.asks_s = air.now
        self.radio: EmulatedRadio = air.add(self.station, offset_s=offset_s, rate=rate)

    @property
    def counters(self) -> Counter[str]:
        return self.member.counters

    @property
    def refused(self) -> set[str]:
        return {one.removeprefix("refused: ") for one in self.counters if "refused" in one}

    def step(self, now: float) -> None:
        """Publish a state of now, and ask where that is due."""
        if self.publishes:
            time_s = self.member.formation_time()
            if time_s >= 0.0:
                self.member.publish(state_at(time_s))
        if self.peer_clock is not None and now >= self.asks_s:
            self.member.ask()
            self.asks_s = now + self.peer_clock.pause_s


class Shared:
    """The air with those who are on it."""

    def __init__(self, quality: RadioQuality | None = None) -> None:
        self.air = RadioAir(quality or RadioQuality(channel=CHANNEL), seed=3)
        self.crafts: list[Craft] = []

    def craft(self, name: str, *, session: int, **options: object) -> Craft:
        one = Craft(self, name, session=session, **options)  # type: ignore[arg-type]
        self.crafts.append(one)
        return one

    def fly(self, seconds: float) -> None:
        """Let time pass; 20 states a second of each."""
        ends = self.air.now + seconds
        while self.air.now < ends - 1e-9:
            for one in self.crafts:
                if one.radio.on:
                    one.step(self.air.now)
            self.air.run(self.air.now + STEP_S)

    def gone(self, craft: Craft) -> None:
        craft.radio.on = False

    def record(self) -> list[bytes]:
        """A list that everything on the air goes to from now on."""
        taken: list[bytes] = []
        transmit = self.air.transmit

        def note(data: bytes, *, sender: EmulatedRadio | None = None) -> None:
            taken.append(data)
            transmit(data, sender=sender)

        self.air.transmit = note  # type: ignore[method-assign]
        return taken


def formation(
    seconds: float = 0.0, quality: RadioQuality | None = None
) -> tuple[Shared, Craft, Craft, Craft]:
    """A leader and two followers on clocks of their own, after some seconds of flight."""
    channel = Shared(quality)
    crafts = (
        channel.craft(LEADER, session=1, offset_s=1000.0),
        channel.craft("f1", session=2, offset_s=50.0, rate=1.00005),
        channel.craft("f2", session=3, offset_s=7.0, rate=0.99995),
    )
    channel.fly(seconds)
    return channel, *crafts


def together(*names: str, **options: object) -> tuple[Any, ...]:
    """The air and those who are on it, all by one clock."""
    channel = Shared()
    return channel, *(
        channel.craft(name, session=session, **options) for session, name in enumerate(names, 1)
    )


def packets_of(frames: list[bytes]) -> list[PackedKind]:
    framer = Framer(Counter())
    return [decode_packet(packet).kind for frame in frames for packet in framer.feed(frame)]


def last_of(frames: list[bytes], *, sender: int) -> bytes:
    """The last that a vehicle of this number has sent."""
    packets = [(Framer(Counter()).feed(frame)[0], frame) for frame in frames]
    return [frame for packet, frame in packets if decode_packet(packet).sender == sender][-1]
