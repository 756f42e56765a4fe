"""One emulated autopilot with its companion, joined by MAVLink bytes."""

from collections import deque
from collections.abc import Callable, Sequence

from vfguide.companion.consent import MemoryStore
from vfguide.companion.core import Companion
from vfguide.companion.plan import adapter_of, flight_plan
from vfguide.companion.role import Event
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.lab.rehearsal.emulators import emulator_of
from vfguide.lab.rehearsal.foreign_leader import ForeignLeader, LeaderAnswers, arrival_of
from vfguide.lab.rehearsal.operator import OPERATOR, order_mail
from vfguide.lab.rehearsal.recorder import UNSEEN, VehicleRecorder
from vfguide.link.codec import is_leaders
from vfguide.link.memory import ROUNDING_S, LinkQuality, Mail, MemoryLink
from vfguide.link.order_codec import ORDER_MAGIC, REPLY_MAGIC
from vfguide.mission.model import Mission
from vfguide.record.tlog import TelemetryLog

Instant = tuple[float, Sequence[Mail]]
"""Virtual time, and the states that the links are handed then."""


class Aircraft:
    """An aircraft of a rehearsal, in virtual time."""

    def __init__(
        self,
        mission: Mission,
        name: str,
        *,
        log: TelemetryLog | None = None,
        clock: SharedClock = SAME_CLOCK,
        orders: Sequence[tuple[float, bytes]] | None = None,
        greeting_s: float = 0.0,
    ) -> None:
        """Put the aircraft of this name at its start.

        Args:
            mission: the mission.
            name: of the vehicle.
            log: notes every datagram of the MAVLink connection.
            clock: the formation's, as this aircraft knows it.
            orders: (when in s, what) an operator gives; those of the mission's time table if absent.
            greeting_s: as of `Companion`.
        """
        rehearsal = mission.rehearsal
        quality = LinkQuality(
            delay_s=rehearsal.link_delay_s,
            jitter_s=rehearsal.link_jitter_s,
            loss=rehearsal.link_loss,
        )
        vehicle = mission.vehicles[name]
        plan = flight_plan(mission, name)
        self.name = name
        self.events = list[Event]()
        """What the companion reported."""
        self.recorder = VehicleRecorder(mission, name)
        self.log = log
        self._emulator = emulator_of(mission, name)
        self._consent = MemoryStore()
        self._losses = tuple(loss for loss in rehearsal.losses if loss.vehicle == name)
        self._lost = False
        self._make: Callable[[], Companion] = lambda: Companion(
            plan,
            adapter_of(vehicle),
            engage=True,
            clock=clock,
            consent=self._consent,
            greeting_s=greeting_s,
        )
        self.companion = self._make()
        """May be replaced by one that knows nothing, as when the process is restarted."""
        self.leads = plan.leads
        """Whether it is the leader."""
        self._leader = mission.leader.vehicle
        self._answers = LeaderAnswers(mission, name) if mission.leader.is_foreign else None
        seeds = {other: f"{rehearsal.seed} {other} {name}" for other in mission.followers_by_name}
        seeds.pop(name, None)
        if not (plan.leads or self._answers):
            seeds[self._leader] = f"{rehearsal.seed} {name}"
        self._orders = deque(order_mail(mission) if orders is None else orders)
        if self._orders:
            seeds[OPERATOR] = f"{rehearsal.seed} {OPERATOR} {name}"
        self._link = MemoryLink(quality, seeds)
        self._replies = b""

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this time, report, be guided, answer.

        Args:
            now: virtual time, s.
            mail: states of others that the link is handed at this time; they arrive when it lets them.

        Returns:
            states that this aircraft publishes.
        """
        if self.loses("companion", now):
            self._fly_alone(now)
            return []
        alone = self.loses("link", now)
        companion, emulator = self.companion, self._emulator
        while self._orders and self._orders[0][0] <= now + ROUNDING_S:
            order = self._orders.popleft()[1]
            self._link.send([] if alone else [(OPERATOR, order)], now)
        self._hear(now, [] if alone else mail)
        telemetry = self._replies + emulator.advance(now)
        truth = emulator.truth()
        out = companion.receive_mavlink(telemetry, now)
        self._replies = emulator.receive(out.to_autopilot)
        if self._answers is not None:
            self._answers.ask(out.to_leader, now)
        self.events += out.events
        self.recorder.sample(truth, companion.snapshot)
        if self.log is not None:
            self.log.add(now, telemetry)
            self.log.add(now, out.to_autopilot)
        said = [*out.to_link, *out.to_followers, *out.replies, *out.repeats]
        return [] if alone else [(self.name, data) for data in said]

    def loses(self, what: str, now: float) -> bool:
        """Whether the vehicle is without its companion or its link now."""
        return any(loss.what == what and loss.lasts(now) for loss in self._losses)

    def _fly_alone(self, now: float) -> None:
        """Fly on to this time without a companion; the next one knows nothing."""
        if not self._lost:
            self._lost, self.companion = True, self._make()
        self._replies = b""
        telemetry = self._emulator.advance(now)
        self._link.clear()
        self.recorder.sample(self._emulator.truth(), UNSEEN)
        if self.log is not None:
            self.log.add(now, telemetry)

    def _hear(self, now: float, mail: Sequence[Mail]) -> None:
        """Whatever arrives over the link by now."""
        if self._answers is not None:
            heard = [arrival_of(data) for sender, data in mail if sender == self._leader]
            for datagram, arrival_s in [*heard, *self._answers.due(now)]:
                self.companion.receive_link(datagram, arrival_s)
        self._link.send(mail, now)
        for sender, data in self._link.receive(now):
            if data.startswith(ORDER_MAGIC):
                self.companion.receive_order(data, data, now, repeated=sender != OPERATOR)
            elif data.startswith(REPLY_MAGIC):
                self.companion.receive_reply(sender, data, now)
            elif is_leaders(data):
                self.companion.receive_lead(sender, data, now)
            elif sender == self._leader:
                self.companion.receive_link(data, now)
            else:
                self.companion.receive_neighbour(sender, data, now)


def aircraft_of(
    mission: Mission, name: str, *, log: TelemetryLog | None = None
) -> Aircraft | ForeignLeader:
    """The aircraft of this name at its start; see there."""
    if mission.leader.is_foreign and name == mission.leader.vehicle:
        return ForeignLeader(mission, log=log)
    return Aircraft(mission, name, log=log)


def step_all(
    formation: Sequence[Aircraft | ForeignLeader], now: float, mail: Sequence[Mail]
) -> list[Mail]:
    """One turn of each aircraft, leader first: what it publishes is heard at the same time by all others.

    Args:
        formation: the aircraft, or those of them that this process flies.
        now: virtual time, s.
        mail: states from elsewhere that the link is handed at this time.

    Returns:
        everything that these aircraft publish at this time.
    """
    heard, published = list(mail), []
    for aircraft in formation:
        sent = aircraft.step(now, heard)
        if aircraft.leads:
            heard += sent
        published += sent
    return published


class Candidates:
    """Those who may lead, the mission's leader first: what they say as leaders is heard at once by all."""

    def __init__(self, aircraft: Sequence[Aircraft | ForeignLeader]) -> None:
        """Put them in order."""
        self._aircraft = aircraft
        self._said: list[tuple[int, Mail]] = []

    def step(self, now: float, mail: Sequence[Mail]) -> tuple[list[Mail], list[Mail]]:
        """One turn of each, in order; who comes before another hears it as a leader an instant later.

        Args:
            now: virtual time, s.
            mail: states from elsewhere that the link is handed at this time.

        Returns:
            what all others hear at this time; and what deputies say as followers, heard as of any other.
        """
        before, self._said = self._said, []
        at_once: list[Mail] = []
        later: list[Mail] = []
        for number, one in enumerate(self._aircraft):
            missed = [said for sender, said in before if sender > number]
            for sent in one.step(now, [*mail, *missed, *at_once]):
                leads = is_leaders(sent[1])
                (at_once if leads or one.leads else later).append(sent)
                if leads:
                    self._said.append((number, sent))
        return at_once, later


def fly_window(
    formation: Sequence[Aircraft | ForeignLeader], window: Sequence[Instant]
) -> list[Mail]:
    """Let each aircraft, one after the other, fly a whole window of the exchange.

    Within it none hears what another publishes, so the order changes nothing; and what an aircraft and its
    companion are made of stays in the processor's cache, which a hundred of them do not fit into.

    Args:
        formation: followers that this process flies.
        window: its instants, with whatever is heard from elsewhere.

    Returns:
        everything that they publish in it.
    """
    return [
        sent for aircraft in formation for now, mail in window for sent in aircraft.step(now, mail)
    ]
