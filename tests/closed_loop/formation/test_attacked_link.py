"""An attacker forges, replays and delays messages on the link: the formation flies as without the attack."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from msgspec.structs import replace

import vfguide.lab.rehearsal.aircraft
from tests.kit.missions import on_the_circle
from vfguide.lab.rehearsal.aircraft import Aircraft, step_all
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.lab.report.figures import slot_error
from vfguide.link.codec import (
    Kind,
    Scheme,
    checksum,
    decode,
    decode_envelope,
    encode,
    encode_signed,
)
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member, Parcel
from vfguide.link.memory import LinkQuality, Mail, MemoryLink
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

Attack = Callable[[bytes, "Wire"], list[bytes]]
"""What is heard in addition to a message."""

FLOWN_S = 30.0

SETTLED_S = 20.0

ASKED_EACH_S = 1.0

DEGREES_60_M = 60.0 / 111_000.0


@dataclass
class Wire:
    """What is between the members."""

    attack: Attack
    signed: bool
    now: float = 0.0
    said: list[bytes] = field(default_factory=list)
    """All messages so far."""
    members: dict[str, Member] = field(default_factory=dict)
    believed: dict[str, list[Mail]] = field(default_factory=dict)
    """States that each member has believed and not used yet, with their senders."""

    def enrol(self, mission: Mission) -> None:
        """Make everybody a member."""
        leader = mission.leader.vehicle
        names = [leader, *mission.followers_by_name]
        keys = {
            name: Ed25519PrivateKey.from_private_bytes(bytes([number + 1]) * 32)
            for number, name in enumerate(names)
        }
        roster = Roster(
            formation=mission.name, vehicles={name: public_bytes(key) for name, key in keys.items()}
        )
        for number, name in enumerate(names):
            book = self.believed.setdefault(name, [])
            trust = Trust(
                formation=mission.name,
                name=name,
                leader=leader,
                session=1000 + number,
                roster=roster if self.signed else None,
                key=keys[name] if self.signed else None,
            )

            def take(data: bytes, book: list[Mail] = book) -> None:
                book.append((leader, data))

            def take_neighbour(vehicle: str, data: bytes, book: list[Mail] = book) -> None:
                book.append((vehicle, data))

            follows = name != leader
            member = Member(
                trust,
                clock=lambda: self.now,
                neighbours=[one for one in names[1:] if one != name],
                receive_neighbour=take_neighbour,
                peer_clock=PeerClock() if follows else None,
                **({"receive": take} if follows else {}),  # type: ignore[arg-type]
            )
            member.send = lambda parcel, name=name: self.carry(name, parcel)  # type: ignore[misc]
            self.members[name] = member

    def carry(self, sender: str, parcel: Parcel) -> None:
        """Hand a message to everybody else, and whatever the attack makes of it."""
        for data in (parcel.data, *self.attack(parcel.data, self)):
            self.said.append(data)
            for name, member in self.members.items():
                if name != sender:
                    member.take(data)


class WiredLink(MemoryLink):
    """One aircraft's end of the wire."""

    wire: Wire
    name: str

    def receive(self, now: float) -> list[Mail]:
        del now
        arrived = list(self.wire.believed[self.name])
        self.wire.believed[self.name].clear()
        return arrived

    def send(self, mail: object, now: float) -> None:
        del mail, now


def fly(mission: Mission, wire: Wire, patch: pytest.MonkeyPatch) -> FlightRecord:
    """Fly a mission over a wire; the leader is heard at the instant at which it speaks."""
    wire.enrol(mission)
    links = iter(wire.members)

    def link(quality: LinkQuality, seeds: dict[str, str]) -> WiredLink:
        made = WiredLink(quality, seeds)
        made.wire, made.name = wire, next(links)
        return made

    with patch.context() as patched:
        patched.setattr(vfguide.lab.rehearsal.aircraft, "MemoryLink", link)
        aircraft = [Aircraft(mission, name) for name in wire.members]
    leader, *followers = aircraft
    rate_hz, times = mission.rehearsal.rate_hz, list[float]()
    for number in range(round(FLOWN_S * rate_hz)):
        wire.now = number / rate_hz
        if number % round(ASKED_EACH_S * rate_hz) == 0:
            for one in followers:
                wire.members[one.name].ask()
        for name, data in (*leader.step(wire.now, []), *step_all(followers, wire.now, [])):
            wire.members[name].publish(data)
        times.append(wire.now)
    records = [one.recorder.record() for one in aircraft]
    return flight_record(mission, times, records, wall_s=0.0)


def nothing(data: bytes, wire: Wire) -> list[bytes]:
    """An honest wire."""
    del data, wire
    return []


def forged_states(data: bytes, wire: Wire) -> list[bytes]:
    """The same sender 60 m farther north, newer in all but the signature; with and without one."""
    del wire
    real = decode_envelope(data)
    if real.kind is not Kind.STATE:
        return []
    state = decode(real.body)
    body = encode(replace(state, latitude_deg=state.latitude_deg + DEGREES_60_M))
    made = []
    for scheme in Scheme:
        signed = encode_signed(
            scheme,
            real.kind,
            formation=real.formation,
            sender=real.sender,
            session=real.session,
            epoch=real.epoch,
            sequence=real.sequence + 1_000,
            time_s=real.time_s + 1.0,
            body=body,
        )
        made.append(signed + (checksum(signed) if scheme is Scheme.UNSIGNED else real.tag))
    return made


def replayed_and_reflected(data: bytes, wire: Wire) -> list[bytes]:
    """What was said five and twenty seconds ago, in the same words, and this once more."""
    return [data, *wire.said[-400:-390], *wire.said[:3]]


def test_an_attacked_formation_flies_bit_for_bit_as_if_it_were_not(monkeypatch):
    mission = on_the_circle(rate_hz=10.0)
    calm = fly(mission, Wire(nothing, signed=True), monkeypatch)
    for follower in calm.followers:
        late = calm.time_s >= SETTLED_S
        assert slot_error(calm.leader, follower).distance_m[late].max() < 1.0
    for attack in (forged_states, replayed_and_reflected):
        wire = Wire(attack, signed=True)
        beset = fly(mission, wire, monkeypatch)
        for before, now in zip(calm.vehicles, beset.vehicles, strict=True):
            assert np.array_equal(before.north_m, now.north_m)
            assert np.array_equal(before.east_m, now.east_m)
        refused = sum(sum(member.counters.values()) for member in wire.members.values())
        assert refused > 1000


def test_without_signatures_who_forges_the_leader_leads(monkeypatch):
    """What --insecure means, and that the attack of the test above is one: followers leave their slots."""
    mission = on_the_circle(rate_hz=10.0)
    led_astray = fly(mission, Wire(forged_states, signed=False), monkeypatch)
    farthest = max(
        float(slot_error(led_astray.leader, follower).distance_m.max())
        for follower in led_astray.followers
    )
    assert farthest > 10.0
