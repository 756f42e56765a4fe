"""The formation in virtual time, joined by a radio that all share: the real stations on an emulated channel.

Everything is as in flight but the port: followers learn the leader's session and clock over the radio, wait
for the beat and speak in their turns, and an operator whose orders the mission names joins with a radio of
its own. Aircraft hear at each of their steps what has arrived since the last.
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
"""An order is said for so long after its time: an answer may be missing."""

DECIDED_S = 1.0
"""The order before has to be decided before the next is given."""

PRESENCE = Presence(status="online", mode="tracking", time_s=0.0, version="0", signed=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioFlight:
    """A flight by radio."""

    flight: LockstepFlight
    """What happened."""
    air: Counter[str]
    """What was on the air, in packets and bytes."""
    refused: Counter[str]
    """What members did not believe, by reason."""
    leader_age_s: tuple[float, ...]
    """How old the leader's newest state was at each step of each follower in the last half, s."""
    verdicts: dict[int, dict[str, Verdict]]
    """What each vehicle has said last to each order, as the operator has heard it."""


class Channels:
    """What all stations of a flight have in common."""

    def __init__(self, mission: Mission, air: RadioAir, radio: Radio) -> None:
        """Make keys of chance, the same for the same seed.

        Args:
            mission: that is flown.
            air: that all are on.
            radio: at whose rates they speak.

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
        """By their numbers on the radio."""
        self.operator_key = Ed25519PrivateKey.from_private_bytes(
            Random(f"{seed} operator").randbytes(32)
        )
        public = public_bytes(self.operator_key)
        # What vehicles say is told by the radio's tags: only an operator signs.
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
        """Signatures of the member of this name, in its first or a later run."""
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
        """By which the member of this name learns the leader's; None for the leader itself."""
        if name == self.vehicles[0]:
            return None
        seed = f"{self.mission.rehearsal.seed} {name} {run or ''}".rstrip()
        return PeerClock(chance=count(1 + Random(seed).getrandbits(48)).__next__)

    def station(self, member: Member) -> Station:
        """A member's, not on the air yet."""
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
    """A member that asks for the leader's clock when that is due."""

    def __init__(self) -> None:
        self._asks_s = 0.0

    def ask(self, member: Member, now: float) -> None:
        """Ask, if it is time."""
        clock = member.peer_clock
        if clock is not None and now >= self._asks_s:
            member.ask()
            self._asks_s = now + clock.pause_s


class RadioAircraft:
    """One aircraft with its station."""

    def __init__(self, channels: Channels, name: str, *, log: TelemetryLog | None = None) -> None:
        """Put the aircraft at its start, and its station on the air."""
        self._channels, self._name = channels, name
        self._plan = flight_plan(channels.mission, name)
        self._inbox = list[Mail]()
        self._runs, self._alone = 0, False
        self.refused: Counter[str] = Counter()
        """What its members have not believed, by reason."""
        self.member = self._new_member()
        clock = SharedClock(
            to_own=self._to_own,
            from_own=self._from_own,
        )
        self.aircraft = Aircraft(
            channels.mission, name, log=log, clock=clock, orders=(), greeting_s=GREETING_S
        )
        self._voice = ClockQuestions()
        self._radio: EmulatedRadio = channels.air.add(channels.station(self.member))

    def step(self, now: float, heard: list[Mail]) -> None:
        """Hear, fly on, and say what there is to say.

        Args:
            now: virtual time, s.
            heard: of a leader without a companion, whom everybody hears by itself.
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
        """Pull the radio out for a while, or begin anew once another companion has begun."""
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
        """The companion as the others hear it: as it is in flight."""
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
    """Who gives the orders of the mission's time table, by a radio of its own."""

    def __init__(self, channels: Channels) -> None:
        """Join, with a key that the roster names."""
        self.verdicts: dict[int, dict[str, Verdict]] = {}
        """What each vehicle has said last to each order."""
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
        """Give the order that is due, again and again; ask for the formation's time."""
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
    """Fly a mission over the link that its rehearsal names; arguments and errors as of `fly_lockstep`.

    A radio joins all aircraft at every instant: they fly in one process.
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
    """Fly a mission to its end, or until it is told to stop.

    Args:
        mission: the mission; of its link only the radio is used, or a usual one.
        epoch_s: time 0 of the flight in seconds since 1970: telemetry logs are kept. None: they are not.
        progress: hears the virtual time.
        stop: asked before each step whether to end here; the first is flown in any case.

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
