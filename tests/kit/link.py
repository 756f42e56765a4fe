"""A formation's members on a wire in virtual time, which somebody may have in hand."""

import heapq
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable
from itertools import count
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from vfguide.link.codec import Kind, Scheme, encode_signed, formation_number
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member, Parcel
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust

FORMATION, LEADER = "circle", "lead"

KEYS = {
    name: Ed25519PrivateKey.from_private_bytes(bytes([number]) * 32)
    for number, name in enumerate(("lead", "f1", "f2", "eye"), start=1)
}
PUBLIC = {name: public_bytes(key) for name, key in KEYS.items()}
ROSTER = Roster(
    formation=FORMATION,
    vehicles={name: PUBLIC[name] for name in ("lead", "f1", "f2")},
    operators={"eye": PUBLIC["eye"]},
)

Carried = Iterable[tuple[float, bytes]]
"""Delays in s, and what arrives after each."""


def trust_of(name: str, session: int, *, signed: bool = True, **options: object) -> Trust:
    """What a member signs with, and whom it believes; who has no key is given none."""
    usual = {
        "formation": FORMATION,
        "leader": LEADER,
        "roster": ROSTER if signed else None,
        "key": KEYS.get(name) if signed else None,
    }
    return Trust(name=name, session=session, **(usual | options))  # type: ignore[arg-type]


class Station:
    """One member, and what it has heard."""

    def __init__(
        self, wire: "Wire", name: str, *, session: int, skew_s: float = 0.0, signed: bool = True
    ) -> None:
        self.heard: list[tuple[float, bytes]] = []
        """States of the leader, and when they came."""
        self.neighbours: list[tuple[str, bytes]] = []
        self.orders: list[tuple[bytes, bytes, bool]] = []
        """Orders, each with its envelope, and whether a vehicle repeated it."""
        self.replies: list[tuple[str, bytes]] = []
        self.revoked: list[str] = []
        """Vehicles whose keys are out, as often as that was told."""
        self.skew_s = skew_s
        leads = name == LEADER
        self.clock: Any = None if leads else PeerClock(chance=count(1 + 1000 * session).__next__)
        options = {} if leads else {"receive": self._note}
        self.member = Member(
            trust_of(name, session, signed=signed),
            clock=lambda: wire.now + self.skew_s,
            neighbours=[one for one in ("f1", "f2") if one != name],
            receive_neighbour=lambda *said: self.neighbours.append(said),
            receive_order=lambda *order: self.orders.append(order),
            receive_reply=lambda *reply: self.replies.append(reply),
            receive_revocation=self.revoked.append,
            peer_clock=self.clock,
            **options,  # type: ignore[arg-type]
        )
        self.wire = wire
        self.member.send = lambda parcel: wire.send(self, parcel)

    @property
    def counters(self) -> Counter[str]:
        return self.member.counters

    def _note(self, data: bytes) -> None:
        self.heard.append((round(self.wire.now, 6), data))


def sealed(body: bytes) -> bytes:
    """A message with its checksum."""
    return body + struct.pack("<I", zlib.crc32(body))


def signed_as(signer: str, sender: str, kind: Kind, body: bytes = b"", **fields: Any) -> bytes:
    """A message in somebody's name by whoever has somebody's key, in the session that f1 is in."""
    said = {"session": 2, "epoch": 1, "sequence": 5, "time_s": 1.0} | fields
    number = formation_number(FORMATION)
    signed = encode_signed(Scheme.ED25519, kind, formation=number, sender=sender, body=body, **said)
    return signed + KEYS[signer].sign(signed)


def straight(parcel: Parcel) -> Carried:
    """An honest wire: everything arrives once, after 10 ms."""
    yield 0.01, parcel.data


class Wire:
    """Carries messages from each station to all others."""

    def __init__(self, carry: Callable[[Parcel], Carried] = straight) -> None:
        self.now = 0.0
        self.sent: list[Parcel] = []
        """All that was said."""
        self.carry = carry
        self.stations: list[Station] = []
        self._under_way: list[tuple[float, int, Station | None, bytes]] = []
        self._number = count()

    def station(self, name: str, **options: object) -> Station:
        """A new member on the wire."""
        station = Station(self, name, **options)  # type: ignore[arg-type]
        self.stations.append(station)
        return station

    def send(self, sender: Station, parcel: Parcel) -> None:
        """Take a message from a station."""
        self.sent.append(parcel)
        for delay_s, data in self.carry(parcel):
            self.inject(data, delay_s, sender)

    def inject(self, data: bytes, delay_s: float = 0.0, sender: Station | None = None) -> None:
        """Let something arrive at everybody but its sender."""
        item = (self.now + delay_s, next(self._number), sender, data)
        heapq.heappush(self._under_way, item)

    def run(self, seconds: float) -> None:
        """Let time pass and messages arrive."""
        ends = self.now + seconds
        while self._under_way and self._under_way[0][0] <= ends:
            self.now, _, sender, data = heapq.heappop(self._under_way)
            for station in self.stations:
                if station is not sender:
                    station.member.take(data)
        self.now = ends

    def fly(self, leader: Station, seconds: float, *others: Station) -> None:
        """Have a leader publish 20 states a second, the others five, and ask for its clock every second."""
        for step in range(round(seconds * 20)):
            leader.member.publish(b"lead %d" % step)
            for one in others:
                if step % 4 == 0:
                    one.member.publish(b"%s %d" % (one.member.name.encode(), step))
                if step % 20 == 0:
                    one.member.ask()
            self.run(0.05)


def formation(
    seconds: float = 0.0, carry: Callable[[Parcel], Carried] = straight, first_session: int = 1
) -> tuple[Wire, Station, Station, Station]:
    """A wire, a leader and two followers whose clocks are apart, after some seconds of flight."""
    wire = Wire(carry)
    leader = wire.station(LEADER, session=first_session)
    one = wire.station("f1", session=first_session + 1, skew_s=100.0)
    other = wire.station("f2", session=first_session + 2, skew_s=-7.0)
    wire.fly(leader, seconds, one, other)
    return wire, leader, one, other
