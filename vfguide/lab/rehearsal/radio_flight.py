"""Flight of a formation in virtual time, with the real radio stations on an emulated shared channel.

Only the port differs from flight: followers learn the leader's session and clock by radio, wait for the beat
and transmit in their turns. Where the mission has orders, an operator joins with a radio of its own.
Aircraft receive at each step the messages that arrived since the last.
"""

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from random import Random

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.timing import SharedClock
from vfguide.formation.arrangement import Manoeuvre
from vfguide.lab.rehearsal.aircraft import OPERATOR, REPEAT_S, Aircraft, EmulatedForeignLeader
from vfguide.lab.rehearsal.emulated_radio import EmulatedRadio, RadioAir, RadioQuality
from vfguide.lab.rehearsal.lockstep import (
    LockstepFlight,
    Progress,
    flight_of,
    fly_lockstep,
    instants,
    outcome_of,
)
from vfguide.link.codec import ENVELOPE_MAGIC, Kind
from vfguide.link.keys import Roster, public_bytes
from vfguide.link.member import Member, ignore
from vfguide.link.memory import Mail
from vfguide.link.order_codec import REPLY_MAGIC, Verdict, decode_reply, encode_order
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.radio_schedule import Channel, make_timetable
from vfguide.link.radio_station import GREETING_S, ORDER_LEAD_S, Station
from vfguide.link.trust import Trust
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import timetable
from vfguide.mission.rehearsal import Radio
from vfguide.record.tlog import TelemetryLog

AFTER_S = 3.0
"""Time for which an order is repeated after its start, s, since an answer may be missing."""

DECIDED_S = 1.0
"""Pause after the start of one order before the next is given, s: the first has to be decided."""

PRESENCE = Presence(status="online", mode="tracking", time_s=0.0, version="0", signed=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioFlight:
    """Flight by radio."""

    flight: LockstepFlight
    air: Counter[str]
    """Radio traffic in packets and bytes."""
    refused: Counter[str]
    """Messages that members rejected, by reason."""
    leader_age_s: tuple[float, ...]
    """Age of the leader's newest state at each step of each follower in the last half, s."""
    verdicts: dict[int, dict[str, Verdict]]
    """Last answer to each order by each vehicle, as heard by the operator."""


class Channels:
    """Keys, roster and timetable that all stations of a flight share."""

    def __init__(self, mission: Mission, air: RadioAir, radio: Radio) -> None:
        """Make random keys, the same for the same seed.

        Raises:
            InputError: the formation does not fit onto the channel.
        """
        self.mission, self.air = mission, air
        seed = mission.rehearsal.seed
        names = [mission.leader.vehicle, *mission.followers_by_name]
        if mission.leader.is_foreign:
            names.remove(mission.leader.vehicle)
        leader = mission.timekeeper
        self.vehicles = (leader, *sorted(set(names) - {leader}))
        """Vehicle names in order of their radio numbers."""
        self.operator_key = Ed25519PrivateKey.from_private_bytes(
            Random(f"{seed} operator").randbytes(32)
        )
        public = public_bytes(self.operator_key)
        # Radio tags authenticate the vehicles: only an operator signs.
        self.roster = Roster(
            formation=mission.name,
            vehicles=dict.fromkeys(self.vehicles, public),
            operators={OPERATOR: public},
        )
        self._radio_key = Random(f"{seed} key").randbytes(32)
        self._timetable = make_timetable(
            len(self.vehicles),
            leader_hz=radio.leader_hz,
            followers_hz=radio.followers_hz,
            channel=air.quality.channel,
        )

    def trust(self, name: str, run: int, key: Ed25519PrivateKey | None = None) -> Trust:
        """Return the trust of a member in its run of this number, 0 for the first."""
        seed = f"{self.mission.rehearsal.seed} {name} session {run or ''}".rstrip()
        return Trust(
            formation=self.mission.name,
            name=name,
            leader=self.vehicles[0],
            session=1 + Random(seed).getrandbits(63),
            roster=self.roster,
            key=key,
        )

    def peer_clock(self, name: str, run: int) -> PeerClock | None:
        """Return the clock by which a member learns the leader's; None for the leader itself."""
        if name == self.vehicles[0]:
            return None
        seed = f"{self.mission.rehearsal.seed} {name} {run or ''}".rstrip()
        return PeerClock(chance=count(1 + Random(seed).getrandbits(48)).__next__)

    def station(self, member: Member) -> Station:
        """Return a new station of a member, not on the air yet."""
        station = Station(
            member,
            formation=self.mission.name,
            vehicles=self.vehicles,
            key=self._radio_key,
            channel=self.air.quality.channel,
            timetable=self._timetable,
            listens_first=self.air.now > 0.0,
        )
        member.send = lambda parcel: station.post(parcel, self.air.now)
        station.announce(PRESENCE)
        return station


class ClockQuestions:
    """Timer of a member's questions for the leader's clock."""

    def __init__(self) -> None:
        self._asks_s = 0.0

    def ask(self, member: Member, now: float) -> None:
        """Let the member ask, if that is due."""
        clock = member.peer_clock
        if clock is not None and now >= self._asks_s:
            member.ask()
            self._asks_s = now + clock.pause_s


class RadioAircraft:
    """Aircraft with its station."""

    def __init__(self, channels: Channels, name: str, *, log: TelemetryLog | None = None) -> None:
        """Put the aircraft at its start, and its station on the air."""
        self._channels, self._name = channels, name
        self._plan = flight_plan(channels.mission, name)
        self._inbox = list[Mail]()
        self._runs, self._alone = 0, False
        self.refused: Counter[str] = Counter()
        """Messages that its members of earlier runs rejected, by reason."""
        self.member = self._new_member()
        clock = SharedClock(to_own=self._to_own, from_own=self._from_own)
        self.aircraft = Aircraft(
            channels.mission, name, log=log, clock=clock, orders=(), greeting_s=GREETING_S
        )
        self._voice = ClockQuestions()
        self._radio: EmulatedRadio = channels.air.add(channels.station(self.member))

    def step(self, now: float, heard: list[Mail]) -> None:
        """Fly on to this virtual time, s, and hand messages to the station.

        `heard` is the telemetry of a leader without a companion, which does not come by radio.
        """
        aircraft = self.aircraft
        self._plug(lost=aircraft.loses("companion", now), alone=aircraft.loses("link", now))
        mail, self._inbox = [*heard, *self._inbox], []
        for _, data in aircraft.step(now, mail):
            if data.startswith(REPLY_MAGIC):
                self.member.say(Kind.REPLY, data)
            elif data.startswith(ENVELOPE_MAGIC):
                self.member.say(Kind.REPEAT, data)
            else:
                self.member.publish(data)
        self._voice.ask(self.member, now)

    def _plug(self, *, lost: bool, alone: bool) -> None:
        """Turn the radio off during a loss, and start a new member after the companion's restart."""
        self._radio.on = not (lost or alone)
        if self._alone and not lost:
            self._runs += 1
            self.refused += self.member.counters
            self.member = self._new_member()
            self._radio.station = self._channels.station(self.member)
            self._radio.station.begin(self._channels.air.now)
            self._voice = ClockQuestions()
        self._alone = lost

    def _new_member(self) -> Member:
        """Return a member of the link, connected to the companion as in flight."""
        channels, name = self._channels, self._name
        leader = channels.vehicles[0]
        return Member(
            channels.trust(name, self._runs),
            clock=lambda: channels.air.now,
            receive=ignore if name == leader else self._note(leader),
            neighbours=[one for one in self._plan.neighbours if one != leader],
            receive_neighbour=lambda vehicle, data: self._inbox.append((vehicle, data)),
            receive_order=self._take_order,
            receive_reply=self._take_reply,
            peer_clock=channels.peer_clock(name, self._runs),
        )

    def _note(self, leader: str) -> Callable[[bytes], None]:
        return lambda data: self._inbox.append((leader, data))

    def _take_order(self, data: bytes, sealed: bytes, repeated: bool) -> None:
        now = self._channels.air.now
        self.aircraft.companion.receive_order(data, sealed, now, repeated=repeated)

    def _take_reply(self, vehicle: str, data: bytes) -> None:
        self.aircraft.companion.receive_reply(vehicle, data, self._channels.air.now)

    def _to_own(self, peer_s: float) -> float:
        clock = self.member.peer_clock
        return peer_s if clock is None else clock.to_local(peer_s)

    def _from_own(self, own_s: float) -> float:
        clock = self.member.peer_clock
        return own_s if clock is None else clock.to_peer(own_s)


class RadioOperator:
    """Operator with a radio, who gives the orders of the mission's time table."""

    def __init__(self, channels: Channels) -> None:
        self.verdicts: dict[int, dict[str, Verdict]] = {}
        air = channels.air
        self._voice = ClockQuestions()
        self.member = Member(
            channels.trust(OPERATOR, 0, channels.operator_key),
            clock=lambda: air.now,
            receive=lambda _: None,
            neighbours=channels.vehicles[1:],
            receive_neighbour=ignore,
            receive_presence=ignore,
            receive_order=lambda *_: None,
            receive_reply=self._note,
            peer_clock=channels.peer_clock(OPERATOR, 0),
        )
        self._orders = list[tuple[float, float, bytes]]()
        before_s = -math.inf
        for order, _ in timetable(channels.mission):
            aborts = order.flown is Manoeuvre.ABORT
            begins_s = order.time_s if aborts else order.time_s - ORDER_LEAD_S
            begins_s = max(begins_s, before_s + DECIDED_S)
            self._orders.append((begins_s, order.time_s + AFTER_S, encode_order(order)))
            before_s = order.time_s
        self._said_s = -math.inf
        air.add(channels.station(self.member))

    def step(self, now: float) -> None:
        """Repeat the order that is due, and ask for the formation's time."""
        self._voice.ask(self.member, now)
        if not math.isfinite(self.member.formation_time()) or now - self._said_s < REPEAT_S:
            return
        due = [data for begins_s, ends_s, data in self._orders if begins_s <= now < ends_s]
        if due:
            self._said_s = now
            self.member.say(Kind.ORDER, due[-1])

    def _note(self, vehicle: str, data: bytes) -> None:
        reply = decode_reply(data)
        self.verdicts.setdefault(reply.number, {})[vehicle] = reply.verdict


def fly_rehearsal(
    mission: Mission,
    *,
    processes: int = 1,
    epoch_s: float | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> LockstepFlight:
    """Fly a mission over the link of its rehearsal; for arguments and errors see `fly_lockstep`.

    By radio all aircraft fly in one process, since the radio joins them at every instant.
    """
    if mission.rehearsal.radio is None:
        return fly_lockstep(
            mission, processes=processes, epoch_s=epoch_s, progress=progress, stop=stop
        )
    return fly_by_radio(mission, epoch_s=epoch_s, progress=progress, stop=stop).flight


def fly_by_radio(
    mission: Mission,
    *,
    epoch_s: float | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> RadioFlight:
    """Fly a mission by its radio, or else the default one, without its link's other settings.

    For the arguments see `fly_lockstep`.

    Raises:
        InputError: the formation does not fit onto the channel.
    """
    began = time.perf_counter()
    silent = mission.rehearsal.model_copy(
        update={"link_delay_s": 0.0, "link_jitter_s": 0.0, "link_loss": 0.0}
    )
    flown = mission.model_copy(update={"rehearsal": silent})
    radio = mission.rehearsal.radio or Radio()
    quality = RadioQuality(
        channel=Channel(baud=radio.baud, air_bytes_s=radio.air_bytes_s),
        loss=radio.loss,
        burst_share=radio.bursts,
    )
    air = RadioAir(quality, seed=mission.rehearsal.seed)
    channels = Channels(flown, air, radio)

    def log() -> TelemetryLog | None:
        return None if epoch_s is None else TelemetryLog(epoch_s)

    foreign = EmulatedForeignLeader(flown, log=log()) if flown.leader.is_foreign else None
    names = [flown.leader.vehicle, *flown.followers_by_name]
    crews = [
        RadioAircraft(channels, name, log=log()) for name in names if name in channels.vehicles
    ]
    operator = RadioOperator(channels) if flown.orders else None
    times, ages, interrupted = list[float](), list[float](), False
    for now in instants(flown):
        if interrupted := stop() and bool(times):
            break
        air.run(now)
        heard = [] if foreign is None else foreign.step(now, [])
        for crew in crews:
            crew.step(now, heard)
        if operator is not None:
            operator.step(now)
        times.append(now)
        if progress is not None:
            progress(now)
        if now >= 0.5 * flown.rehearsal.duration_s:
            followers = (crew.aircraft for crew in crews if not crew.aircraft.leads)
            ages += [one.companion.leader_age(now) for one in followers]
    aircraft: list[Aircraft | EmulatedForeignLeader] = [] if foreign is None else [foreign]
    aircraft += [crew.aircraft for crew in crews]
    refused: Counter[str] = Counter()
    for crew in crews:
        refused += crew.refused + crew.member.counters
    return RadioFlight(
        flight=flight_of(
            flown,
            times,
            [outcome_of(one) for one in aircraft],
            wall_s=time.perf_counter() - began,
            interrupted=interrupted,
        ),
        air=air.counters,
        refused=refused,
        leader_age_s=tuple(ages),
        verdicts={} if operator is None else operator.verdicts,
    )
