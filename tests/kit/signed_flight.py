"""A formation in virtual time whose members sign what they say, and believe others as on a real link."""

import math
from collections.abc import Callable, Collection, Iterable
from functools import partial
from itertools import count
from random import Random

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.timing import SharedClock
from vfguide.lab.rehearsal.aircraft import OPERATOR, Aircraft
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.link.codec import Envelope, Kind, Scheme, decode_envelope, encode_signed, is_leaders
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member, Parcel
from vfguide.link.memory import LinkQuality, Mail, MemoryLink
from vfguide.link.order_codec import ORDER_MAGIC, REPLY_MAGIC
from vfguide.link.peer_clock import PeerClock
from vfguide.link.trust import Trust
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord

ELSEWHERE = "elsewhere"
"""Who says what no member's own program has said."""

PASS_ON_S = 1.0
"""Between two statements about revoked keys, as on a real link."""

Overhears = Callable[[str, bytes], None]
"""Called with the sender of a message, as the wire knows it, and the envelope."""


class SealedLink(MemoryLink):
    """One member's end of the wire: takes envelopes, and hands on what is believed of them."""

    def __init__(self, mission: Mission, name: str, names: Iterable[str]) -> None:
        rehearsal = mission.rehearsal
        quality = LinkQuality(
            delay_s=rehearsal.link_delay_s,
            jitter_s=rehearsal.link_jitter_s,
            loss=rehearsal.link_loss,
        )
        super().__init__(quality, {one: f"{rehearsal.seed} {one} {name}" for one in names})
        self.take: Callable[[bytes], object] = len
        """What becomes of an envelope."""
        self.believed: list[Mail] = []
        """What was believed since this was asked last."""
        self.gone = False
        """Whether its companion has ended."""

    def send(self, mail: object, now: float) -> None:
        """Pass over what an aircraft is handed beside the wire."""

    def carry(self, sender: str, data: bytes, now: float) -> None:
        """Let an envelope arrive after the time that it takes."""
        super().send([(sender, data)], now)

    def receive(self, now: float) -> list[Mail]:
        for _, data in super().receive(now):
            self.take(data)
        found, self.believed = self.believed, []
        return found

    def clear(self) -> None:
        super().clear()
        self.gone = True


class Enrolled:
    """One member: an aircraft's companion, or an operator's program."""

    def __init__(self, flight: "SignedFlight", name: str) -> None:
        self.flight, self.name = flight, name
        self.link = SealedLink(flight.mission, name, [*flight.names, OPERATOR, ELSEWHERE])
        self.silenced = frozenset[Kind]()
        """Kinds of messages that somebody keeps back."""
        self._sealed: dict[bytes, bytes] = {}
        self._ask_s = self._pass_on_s = 0.0
        self.aircraft: Aircraft | None = None
        self.begin()
        if name != OPERATOR:
            # It has its own clock by what the leader answers, through restarts.
            clock = SharedClock(to_own=self._to_own, from_own=self._from_own)
            self.aircraft = Aircraft(flight.mission, name, clock=clock, orders=[(math.inf, b"")])
            self.aircraft._link = self.link  # noqa: SLF001

    def begin(self) -> None:
        """A program that knows nothing yet, but for the keys that were revoked."""
        flight, mission = self.flight, self.flight.mission
        leader = mission.leader.vehicle
        kept = self.member.trust.statements.values() if hasattr(self, "member") else ()
        session = next(flight.sessions)
        chance = Random(f"{flight.mission.rehearsal.seed} {session}")
        self.clock = None if self.name == leader else PeerClock(partial(chance.getrandbits, 64))
        trust = Trust(
            formation=mission.name,
            name=self.name,
            leader=leader,
            session=session,
            roster=flight.roster if flight.signed else None,
            key=flight.keys[self.name] if flight.signed else None,
            deputies=mission.deputies,
        )
        trust.recall(kept)
        follows = {} if self.clock is None else {"receive": partial(self._hear_state, leader)}
        others = set(flight.names) - {leader, self.name}
        if self.name != OPERATOR:
            others &= set(flight_plan(mission, self.name).neighbours)
        self.member = Member(
            trust,
            clock=lambda: flight.now,
            neighbours=others,
            receive_neighbour=self._hear_state,
            receive_lead=self._note if mission.deputies else None,
            receive_order=self._hear_order,
            receive_reply=self._note,
            peer_clock=self.clock,
            **follows,  # type: ignore[arg-type]
        )
        self.member.send = self._send
        self.link.take = self.member.take
        self.link.believed.clear()
        self.link.gone = False
        self._ask_s = flight.now

    def step(self) -> list[Mail]:
        """One turn; what an operator's program hears in it."""
        flight = self.flight
        if self.aircraft is None:
            self._look_round()
            return self.link.receive(flight.now)
        if self.link.gone and not self.aircraft.loses("companion", flight.now):
            self.begin()
        if not self.aircraft.loses("companion", flight.now):
            self._look_round()
            self._settle(self.aircraft)
        for _, body in self.aircraft.step(flight.now, []):
            self._say(body)
        return []

    def _look_round(self) -> None:
        """What is due by time alone: a question for the leader's clock, what is known of revoked keys."""
        now, member = self.flight.now, self.member
        if self.clock is not None and (now >= self._ask_s or member.hurry.is_set()):
            member.ask()
            self._ask_s = now + self.clock.pause_s
        if now >= self._pass_on_s:
            self._pass_on_s = now + PASS_ON_S
            member.pass_on()

    def _settle(self, aircraft: Aircraft) -> None:
        """As a companion's process does: it stands back, or answers for the clock."""
        companion = aircraft.companion
        out = companion.stand_back(self.flight.now, self.member.standing_back)
        aircraft.events += out.events
        aircraft._replies += aircraft.emulator.receive(out.to_autopilot)  # noqa: SLF001
        if companion.leadership is not None:
            holder, term = companion.leadership
            self.member.stands_in = term > 0 and holder == self.name

    def _say(self, body: bytes) -> None:
        """Say as a member what a companion wants said."""
        if body.startswith(ORDER_MAGIC):
            self.member.say(Kind.REPEAT, self._sealed[body])
        elif body.startswith(REPLY_MAGIC):
            self.member.say(Kind.REPLY, body)
        elif is_leaders(body):
            self.member.say(Kind.LEADER, body)
        else:
            self.member.publish(body)

    def _send(self, parcel: Parcel) -> None:
        if parcel.kind not in self.silenced:
            self.flight.carry(self.name, parcel.data)

    def _note(self, sender: str, body: bytes) -> None:
        self.link.believed.append((sender, body))

    def _hear_state(self, sender: str, body: bytes) -> None:
        # The emulated aircraft tells orders by their first bytes, a real one by what was signed.
        if not body.startswith((ORDER_MAGIC, REPLY_MAGIC)):
            self._note(sender, body)

    def _hear_order(self, body: bytes, sealed: bytes, repeated: bool) -> None:
        self._sealed[body] = sealed
        self._note(ELSEWHERE if repeated else OPERATOR, body)

    def _to_own(self, time_s: float) -> float:
        return time_s if self.clock is None else self.clock.to_local(time_s)

    def _from_own(self, time_s: float) -> float:
        return time_s if self.clock is None else self.clock.to_peer(time_s)


class SignedFlight:
    """All members, and the wire between them."""

    def __init__(self, mission: Mission, *, signed: bool = True) -> None:
        """Put everybody into the air, with keys of their own if they sign at all."""
        self.mission = mission
        self.signed = signed
        self.names = [mission.leader.vehicle, *mission.followers_by_name]
        self.now = 0.0
        self.times: list[float] = []
        self.sessions = count(1000)
        self.keys = {
            name: Ed25519PrivateKey.from_private_bytes(bytes([number]) * 32)
            for number, name in enumerate([*self.names, OPERATOR], 1)
        }
        public = {name: public_bytes(key) for name, key in self.keys.items()}
        operators = {OPERATOR: public.pop(OPERATOR)}
        self.roster = Roster(formation=mission.name, vehicles=public, operators=operators)
        self.overhears: list[Overhears] = []
        """Called with all that is said."""
        self.members = {name: Enrolled(self, name) for name in [*self.names, OPERATOR]}
        self.operator = self.members[OPERATOR]

    @property
    def aircraft(self) -> dict[str, Aircraft]:
        """Those that fly."""
        made = ((name, one.aircraft) for name, one in self.members.items())
        return {name: one for name, one in made if one is not None}

    def step(self) -> list[Mail]:
        """One turn of everybody; what the operator hears in it."""
        self.now = len(self.times) / self.mission.rehearsal.rate_hz
        self.times.append(self.now)
        heard = list[Mail]()
        for one in self.members.values():
            heard += one.step()
        return heard

    def fly(self, until_s: float) -> None:
        """Go on until a time."""
        while self.now < until_s:
            self.step()

    def carry(self, sender: str, data: bytes, to: Collection[str] | None = None) -> None:
        """Let an envelope arrive at everybody else, or at some, after the time that it takes."""
        for name, one in self.members.items():
            if name != sender and (to is None or name in to):
                one.link.carry(sender, data, self.now)
        for overhears in self.overhears:
            overhears(sender, data)

    def record(self) -> FlightRecord:
        """What was flown."""
        records = [one.recorder.record() for one in self.aircraft.values()]
        return flight_record(self.mission, self.times, records, wall_s=0.0)


class Impostor:
    """Somebody who hears all, has a member's private key, and speaks in its name.

    It goes on where the member is: in its session, with the number after its newest one.
    """

    def __init__(self, flight: SignedFlight, name: str) -> None:
        """Hear all from now on."""
        self.flight, self.name = flight, name
        self.newest: dict[Kind, Envelope] = {}
        """What the member has said itself, the newest of each kind."""
        self._sequence = 0
        flight.overhears.append(self._overhear)

    def _overhear(self, sender: str, data: bytes) -> None:
        if sender == ELSEWHERE:
            return
        envelope = decode_envelope(data)
        if envelope.sender == self.name:
            self.newest[envelope.kind] = envelope
            self._sequence = max(self._sequence, envelope.sequence)
        self.hear(envelope)

    def hear(self, envelope: Envelope) -> None:
        """Take what anybody says."""

    @property
    def state(self) -> bytes | None:
        """The newest state of the member; None while none was heard."""
        told = self.newest.get(Kind.STATE)
        return None if told is None else told.body

    def say(
        self,
        kind: Kind,
        body: bytes,
        *,
        sequence: int | None = None,
        time_s: float = math.nan,
        to: Collection[str] | None = None,
    ) -> None:
        """Say something as the member does: now, unless a time (s) is given."""
        own = self.flight.members[self.name].member.trust
        known = next(iter(self.newest.values()), None)
        if known is None:
            return
        if sequence is None:
            self._sequence += 1
            sequence = self._sequence
        signed = encode_signed(
            Scheme.ED25519,
            kind,
            formation=known.formation,
            sender=self.name,
            session=own._session,  # noqa: SLF001
            epoch=known.epoch,
            sequence=sequence,
            time_s=self.flight.now if math.isnan(time_s) else time_s,
            body=body,
        )
        key = self.flight.keys[self.name]
        self.flight.carry(ELSEWHERE, signed + key.sign(signed), to)
