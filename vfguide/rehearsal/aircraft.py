"""One emulated autopilot with its companion, joined by MAVLink bytes."""

from collections.abc import Sequence

from vfguide.companion.core import Companion, Event
from vfguide.companion.plan import adapter_of, flight_plan
from vfguide.link.memory import LinkQuality, MemoryLink
from vfguide.mission.model import Mission
from vfguide.record.tlog import TelemetryLog
from vfguide.rehearsal.emulators import emulator_of
from vfguide.rehearsal.recorder import VehicleRecorder


class Aircraft:
    """An aircraft of a rehearsal, in virtual time."""

    def __init__(self, mission: Mission, name: str, *, log: TelemetryLog | None = None) -> None:
        """Put the aircraft of this name at its start.

        Args:
            mission: the mission.
            name: of the vehicle.
            log: notes every datagram of the MAVLink connection.
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
        self.events: list[Event] = []
        """What the companion reported."""
        self.recorder = VehicleRecorder(mission, name)
        self.log = log
        self._emulator = emulator_of(mission, name)
        self._companion = Companion(plan, adapter_of(vehicle), engage=True)
        self._link = None if plan.leads else MemoryLink(quality, f"{rehearsal.seed} {name}")
        self._replies = b""

    def step(self, now: float, published: Sequence[bytes]) -> list[bytes]:
        """Fly on to this time, report, be guided, answer.

        Args:
            now: virtual time, s.
            published: leader states that were sent at this time; they arrive when the link lets them.

        Returns:
            leader states that this aircraft sends.
        """
        companion, emulator = self._companion, self._emulator
        if self._link is not None:
            for data in published:
                self._link.send(data, now)
            for data in self._link.receive(now):
                companion.receive_link(data, now)
        telemetry = self._replies + emulator.advance(now)
        truth = emulator.truth()
        out = companion.receive_mavlink(telemetry, now)
        self._replies = emulator.receive(out.to_autopilot)
        self.events += out.events
        self.recorder.sample(truth, companion.snapshot)
        if self.log is not None:
            self.log.add(now, telemetry)
            self.log.add(now, out.to_autopilot)
        return out.to_link


def step_all(formation: Sequence[Aircraft], now: float, published: list[bytes]) -> list[bytes]:
    """One turn of each aircraft, leader first: whoever comes later hears what was published before.

    Returns:
        everything published at this time.
    """
    for aircraft in formation:
        published = published + aircraft.step(now, published)
    return published
