"""The formation in virtual time: as fast as the computer goes, and the same bytes for the same seed."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import sitl_stub
from vfguide.companion.core import Companion, Event, Snapshot
from vfguide.companion.plan import adapter_of, flight_plan
from vfguide.link.memory import LinkQuality, MemoryLink
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.rehearsal.emulators import emulator_of
from vfguide.rehearsal.recorder import Recorder

Tap = Callable[[str, float, bytes], None]
"""Called with a vehicle's name, the time and each datagram that crosses its MAVLink connection."""

Progress = Callable[[float], None]
"""Called with the virtual time."""


@dataclass(slots=True)
class Aircraft:
    """One emulated autopilot with its companion."""

    name: str
    """Of the vehicle."""
    emulator: sitl_stub.Autopilot
    """The far end of the MAVLink connection."""
    companion: Companion
    """The near end."""
    link: MemoryLink | None
    """What brings leader states here; None for the leader."""
    replies: bytes = b""
    """What the emulator has answered since its last telemetry."""
    events: list[Event] = field(default_factory=list)
    """What the companion reported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """A flight that was flown, to its end or to where it was stopped."""

    record: FlightRecord
    """What happened."""
    events: dict[str, list[Event]]
    """What each companion reported, by vehicle."""
    interrupted: bool
    """Whether it was stopped before its end."""


def formation_of(mission: Mission) -> list[Aircraft]:
    """The aircraft of a mission, leader first."""
    rehearsal = mission.rehearsal
    quality = LinkQuality(
        delay_s=rehearsal.link_delay_s,
        jitter_s=rehearsal.link_jitter_s,
        loss=rehearsal.link_loss,
    )
    names = [mission.leader.vehicle, *mission.followers_by_name]
    return [
        Aircraft(
            name=name,
            emulator=emulator_of(mission, name),
            companion=Companion(
                flight_plan(mission, name), adapter_of(mission.vehicles[name]), engage=True
            ),
            link=MemoryLink(quality, f"{rehearsal.seed} {name}") if number else None,
        )
        for number, name in enumerate(names)
    ]


def instants(mission: Mission) -> Iterator[float]:
    """Times of the samples of a flight, s, from 0 to its duration."""
    rate_hz = mission.rehearsal.rate_hz
    for step in range(round(mission.rehearsal.duration_s * rate_hz) + 1):
        yield step / rate_hz


def fly_lockstep(
    mission: Mission, *, tap: Tap | None = None, progress: Progress | None = None
) -> Flight:
    """Fly a mission to its end, or until KeyboardInterrupt.

    Args:
        mission: the mission.
        tap: hears every datagram.
        progress: hears the virtual time at each step.
    """
    began = time.perf_counter()
    formation = formation_of(mission)
    recorder = Recorder(mission, [aircraft.emulator for aircraft in formation])
    interrupted = False
    try:
        for now in instants(mission):
            snapshots = [step(aircraft, formation, now, tap) for aircraft in formation]
            recorder.sample(now, snapshots)
            if progress is not None:
                progress(now)
    except KeyboardInterrupt:
        interrupted = True
    return Flight(
        record=recorder.record(wall_s=time.perf_counter() - began),
        events={aircraft.name: aircraft.events for aircraft in formation},
        interrupted=interrupted,
    )


def step(aircraft: Aircraft, formation: list[Aircraft], now: float, tap: Tap | None) -> Snapshot:
    """One aircraft's turn: fly on, report, be guided, answer; leader states go to all the others."""
    companion, emulator = aircraft.companion, aircraft.emulator
    if aircraft.link is not None:
        for data in aircraft.link.receive(now):
            companion.receive_link(data, now)
    telemetry = aircraft.replies + emulator.advance(now)
    out = companion.receive_mavlink(telemetry, now)
    aircraft.replies = emulator.receive(out.to_autopilot)
    aircraft.events += out.events
    for data in out.to_link:
        for other in formation:
            if other.link is not None:
                other.link.send(data, now)
    if tap is not None:
        for datagram in (telemetry, out.to_autopilot):
            if datagram:
                tap(aircraft.name, now, datagram)
    return companion.snapshot
