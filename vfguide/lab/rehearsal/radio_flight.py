"""The formation in virtual time, joined by a radio that all share: the real stations on an emulated channel.

Everything is as in flight but the port: followers learn the leader's session and clock over the radio, wait
for the beat and speak in their turns. Aircraft hear at each of their steps what has arrived since the last.
"""

import time
from collections import Counter
from dataclasses import dataclass
from itertools import count
from random import Random

from vfguide.companion.plan import flight_plan
from vfguide.companion.shared_clock import SAME_CLOCK, SharedClock
from vfguide.lab.rehearsal.aircraft import Aircraft
from vfguide.lab.rehearsal.emulated_radio import Air, RadioQuality
from vfguide.lab.rehearsal.lockstep import Flight, instants
from vfguide.lab.rehearsal.recorder import flight_record
from vfguide.link.member import Member, ignore
from vfguide.link.memory import Mail
from vfguide.link.peer_clock import PeerClock
from vfguide.link.presence import Presence
from vfguide.link.radio_schedule import make_timetable
from vfguide.link.radio_station import Station
from vfguide.link.trust import Trust
from vfguide.mission.model import Mission


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioRates:
    """What the leader's address says about its radio."""

    leader_hz: float = 10.0
    """Beats per second, and with them states of the leader."""
    followers_hz: float = 2.5
    """States per second of each follower, at least; no more than one at each beat."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RadioFlight:
    """A flight by radio."""

    flight: Flight
    """What happened."""
    air: Counter[str]
    """What was on the air, in packets and bytes."""
    refused: Counter[str]
    """What members did not believe, by reason."""
    leader_age_s: tuple[float, ...]
    """How old the leader's newest state was at each step of each follower in the last half, s."""


class Crew:
    """One aircraft with its station."""

    def __init__(
        self, mission: Mission, name: str, air: Air, rates: RadioRates, key: bytes
    ) -> None:
        """Put the aircraft at its start, and its station on the air."""
        plan, leader = flight_plan(mission, name), mission.leader.vehicle
        seed = f"{mission.rehearsal.seed} {name}"
        self.inbox = list[Mail]()
        chance = count(1 + Random(seed).getrandbits(48))
        self._clock = None if plan.leads else PeerClock(chance=chance.__next__)
        receive = (lambda data: self.inbox.append((leader, data))) if not plan.leads else ignore
        trust = Trust(
            formation=mission.name,
            name=name,
            leader=leader,
            session=1 + Random(f"{seed} session").getrandbits(63),
            roster=None,
        )
        self.member = Member(
            trust,
            clock=lambda: air.now,
            receive=receive,
            neighbours=plan.neighbours,
            receive_neighbour=lambda vehicle, data: self.inbox.append((vehicle, data)),
            peer_clock=self._clock,
        )
        self.aircraft = Aircraft(mission, name, clock=self._shared_clock())
        vehicles = (leader, *sorted(mission.followers_by_name))
        self.station = Station(
            self.member,
            formation=mission.name,
            vehicles=vehicles,
            key=key,
            channel=air.quality.channel,
            timetable=make_timetable(
                len(vehicles),
                leader_hz=rates.leader_hz,
                followers_hz=rates.followers_hz,
                channel=air.quality.channel,
            ),
        )
        self.member.send = lambda parcel: self.station.post(parcel, air.now)
        self.station.announce(
            Presence(status="online", mode="tracking", time_s=0.0, version="0", signed=True)
        )
        self._asks_s = 0.0
        air.add(self.station)

    def step(self, now: float) -> None:
        """Hear, fly on, publish, and ask for the leader's clock where that is due."""
        mail, self.inbox = self.inbox, []
        for _, data in self.aircraft.step(now, mail):
            self.member.publish(data)
        if self._clock is not None and now >= self._asks_s:
            self.member.ask()
            self._asks_s = now + self._clock.pause_s

    def _shared_clock(self) -> SharedClock:
        if self._clock is None:
            return SAME_CLOCK
        return SharedClock(to_own=self._clock.to_local, from_own=self._clock.to_peer)


def fly_by_radio(
    mission: Mission, *, rates: RadioRates | None = None, quality: RadioQuality | None = None
) -> RadioFlight:
    """Fly a mission to its end.

    Args:
        mission: the mission; what it says about its link is not used.
        rates: that its leader's address asks for.
        quality: of the radios.

    Raises:
        InputError: the formation does not fit onto the channel.
    """
    began = time.perf_counter()
    silent = mission.rehearsal.model_copy(
        update={"link_delay_s": 0.0, "link_jitter_s": 0.0, "link_loss": 0.0}
    )
    flown = mission.model_copy(update={"rehearsal": silent})
    air = Air(quality or RadioQuality(), seed=mission.rehearsal.seed)
    names = [mission.leader.vehicle, *mission.followers_by_name]
    key = bytes(Random(f"{mission.rehearsal.seed} key").randbytes(32))
    crews = [Crew(flown, name, air, rates or RadioRates(), key) for name in names]
    times, ages = [], []
    for now in instants(flown):
        air.run(now)
        for crew in crews:
            crew.step(now)
        times.append(now)
        if now >= 0.5 * flown.rehearsal.duration_s:
            ages += [crew.aircraft.companion.leader_age(now) for crew in crews[1:]]
    refused: Counter[str] = Counter()
    for crew in crews:
        refused += crew.member.counters
    flight = Flight(
        record=flight_record(
            flown,
            times,
            [crew.aircraft.recorder.record() for crew in crews],
            wall_s=time.perf_counter() - began,
        ),
        events={crew.aircraft.name: crew.aircraft.events for crew in crews},
        logs={},
        interrupted=False,
    )
    return RadioFlight(flight=flight, air=air.counters, refused=refused, leader_age_s=tuple(ages))
