"""A leader without a companion in virtual time: it flies by itself, is heard late, and answers late."""

import heapq
from collections.abc import Iterator, Sequence
from random import Random
from struct import Struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.role import Event
from vfguide.lab.rehearsal.emulators import BOOTED_S, foreign_leader_of
from vfguide.lab.rehearsal.recorder import UNSEEN, VehicleRecorder
from vfguide.link.memory import Mail
from vfguide.mission.model import Mission
from vfguide.record.tlog import TelemetryLog

TIME = Struct("<d")
"""When a datagram arrived, s, in the mail of a leader without a companion."""


class ForeignLeader:
    """The aircraft."""

    leads = True
    """Whether it is the leader."""

    def __init__(self, mission: Mission, *, log: TelemetryLog | None = None) -> None:
        """Put it at its start.

        Args:
            mission: the mission.
            log: notes what is heard of it.
        """
        self.name = mission.leader.vehicle
        self.events = list[Event]()
        """It reports nothing."""
        self.recorder = VehicleRecorder(mission, self.name)
        self.log = log
        self._emulator = foreign_leader_of(mission)

    def step(self, now: float, mail: Sequence[Mail]) -> list[Mail]:
        """Fly on to this time; what arrives of it, as mail. It hears nobody."""
        del mail
        emulator, heard = self._emulator, []
        while True:
            # What arrives between two steps is read when it comes: nobody would be late by a step.
            arrival_s = min(emulator.next_due_s, now)
            if datagram := emulator.advance(arrival_s):
                heard.append((self.name, TIME.pack(arrival_s) + datagram))
                if self.log is not None:
                    self.log.add(arrival_s, datagram)
            if arrival_s >= now:
                break
        self.recorder.sample(emulator.truth(), UNSEEN)
        return heard


def arrival_of(data: bytes) -> tuple[bytes, float]:
    """A datagram of a leader without a companion out of the mail, and when it arrived, s."""
    return data[TIME.size :], TIME.unpack_from(data)[0]


class LeaderAnswers:
    """Its answers to one follower's questions for its time, which take as long as all that it says.

    The leader flies ahead of its followers in virtual time, and cannot be asked; its clock is known.
    """

    def __init__(self, mission: Mission, follower: str) -> None:
        """Make it, with nothing asked.

        Args:
            mission: the mission.
            follower: name of the one who asks.
        """
        self._heard = mission.rehearsal.leader_telemetry
        self._random = Random(f"{mission.rehearsal.seed} {follower} asks")
        self._codec = mavlink.MAVLink(None, srcSystem=mission.leader_vehicle.system_id)
        self._codec.srcComponent = mavlink.MAV_COMP_ID_AUTOPILOT1
        self._on_the_way: list[tuple[float, bytes]] = []

    def ask(self, datagram: bytes, now: float) -> None:
        """Take what the follower says."""
        for message in self._codec.parse_buffer(datagram) or ():
            if message.get_type() != "TIMESYNC" or self._random.random() < self._heard.loss:
                continue
            there_s, back_s = self._travel_s(), self._travel_s()
            shown_ns = round((BOOTED_S + now + there_s) * 1e9)
            answer = mavlink.MAVLink_timesync_message(shown_ns, message.ts1)
            arrival_s = now + there_s + back_s
            heapq.heappush(self._on_the_way, (arrival_s, bytes(answer.pack(self._codec))))

    def due(self, now: float) -> Iterator[tuple[bytes, float]]:
        """Answers that have arrived by this time, and when."""
        while self._on_the_way and self._on_the_way[0][0] <= now:
            arrival_s, answer = heapq.heappop(self._on_the_way)
            yield answer, arrival_s

    def _travel_s(self) -> float:
        spread_s = self._heard.jitter_s
        return self._heard.delay_s + self._random.uniform(-spread_s, spread_s)
