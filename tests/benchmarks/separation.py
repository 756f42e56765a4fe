"""Followers that stray, at random and several at a time: how near do any two vehicles come?

Counted where it is in somebody's hands: one of the two must be a follower that its companion steers and
has steered for the time that it takes to hear of the others. Two that nobody steers meet by chance, and
the leader gives way to nobody.

Run with `.venv/bin/python tests/benchmarks/separation.py [FLIGHTS]`. Exit status 1 where two came within 5 m.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from random import Random

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

import sitl_stub
import vfguide.rehearsal.aircraft
from vfguide.companion.core import Companion
from vfguide.companion.outgoing import Outgoing, Snapshot
from vfguide.companion.plan import adapter_of, flight_plan
from vfguide.elementwise import BoolArray
from vfguide.mission.load import load_mission
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord
from vfguide.rehearsal.aircraft import Aircraft, Mail, step_all
from vfguide.rehearsal.emulators import emulator_of
from vfguide.rehearsal.exchange import Exchange, window_length
from vfguide.rehearsal.recorder import flight_record
from vfguide.report.geometry import pair_separations, slot_error

MISSIONS = Path(__file__).parents[2] / "missions"
GUIDED, LOITER = 15, 12
BEGIN_S = 25.0
"""Everybody is in the slot by then."""

HEARING_S = 2.0
"""From the start of a companion until it has heard of the others and its vehicle has answered."""

AFTERWARDS_S = 60.0
LEAST_M = 5.0


class Dead:
    """A companion that is no more."""

    def __init__(self, snapshot: Snapshot) -> None:
        self.snapshot = snapshot

    def receive_link(self, data: bytes, now: float) -> None:
        """Nothing."""

    def receive_neighbour(self, vehicle: str, data: bytes, now: float) -> None:
        """Nothing."""

    def receive_mavlink(self, data: bytes, now: float) -> Outgoing:
        """Nothing."""
        del data, now
        return Outgoing()


@dataclass(frozen=True, slots=True, order=True)
class Event:
    """Something happens to a follower."""

    time_s: float
    what: str
    vehicle: str


def random_events(random: Random, names: list[str]) -> list[Event]:
    """One to three followers are borrowed by their pilots, or lose their companions for a while."""
    events = []
    for name in random.sample(names, random.choice([1, 1, 2, 3])):
        begins_s = BEGIN_S + random.uniform(0.0, 10.0)
        if random.random() < 0.5:
            lasts_s = random.uniform(2.0, 14.0)
            events += [
                Event(begins_s, "taken", name),
                Event(begins_s + lasts_s, "given back", name),
            ]
        else:
            lasts_s = random.uniform(2.0, 10.0)
            events += [Event(begins_s, "dead", name), Event(begins_s + lasts_s, "restarted", name)]
    return sorted(events)


def fly(mission: Mission, events: list[Event]) -> FlightRecord:
    """Fly a mission on which these things happen."""
    names = [mission.leader.vehicle, *mission.followers_by_name]
    emulators: dict[str, sitl_stub.Autopilot] = {}

    def emulator(mission: Mission, name: str) -> sitl_stub.Autopilot:
        return emulators.setdefault(name, emulator_of(mission, name))

    vfguide.rehearsal.aircraft.emulator_of = emulator
    formation = {name: Aircraft(mission, name) for name in names}
    rate_hz, exchange = mission.rehearsal.rate_hz, Exchange()
    length, times, waiting = window_length(rate_hz), [], list(events)
    for step in range(round((events[-1].time_s + AFTERWARDS_S) * rate_hz)):
        times.append(step / rate_hz)
        while waiting and waiting[0].time_s <= times[-1]:
            happen(mission, waiting.pop(0), formation, emulators)
        mail: list[Mail] = exchange.collect(step // length) if step % length == 0 else []
        sent = step_all(list(formation.values()), times[-1], mail)
        exchange.post(step // length, [one for one in sent if one[0] != names[0]])
    return flight_record(
        mission, times, [one.recorder.record() for one in formation.values()], wall_s=0.0
    )


def happen(
    mission: Mission,
    event: Event,
    formation: dict[str, Aircraft],
    emulators: dict[str, sitl_stub.Autopilot],
) -> None:
    """Let something happen to an aircraft."""
    name, aircraft = event.vehicle, formation[event.vehicle]
    if event.what == "dead":
        aircraft.companion = Dead(aircraft.companion.snapshot)
    elif event.what == "restarted":
        plan = flight_plan(mission, name)
        aircraft.companion = Companion(plan, adapter_of(mission.vehicles[name]), engage=True)
    else:
        mode = LOITER if event.what == "taken" else GUIDED
        order = mavlink.MAVLink_command_long_message(
            emulators[name].system_id, 1, mavlink.MAV_CMD_DO_SET_MODE, 0, 1, mode, 0, 0, 0, 0, 0
        )
        emulators[name].receive(order.pack(mavlink.MAVLink(None, srcSystem=255)))


def steered(record: FlightRecord, name: str, leader: str, events: list[Event]) -> BoolArray:
    """When a vehicle can give way."""
    free = np.full(record.time_s.shape, name != leader)
    own = [event.time_s for event in events if event.vehicle == name]
    for begins_s, ends_s in zip(own[::2], own[1::2], strict=True):
        free &= (record.time_s < begins_s) | (record.time_s > ends_s + HEARING_S)
    return free


def nearest_steered(record: FlightRecord, leader: str, events: list[Event]) -> float:
    """Least distance (m) of two vehicles of which one can give way."""
    return min(
        float(pair.distance_m[when].min())
        for pair in pair_separations(record)
        if (
            when := steered(record, pair.first, leader, events)
            | steered(record, pair.second, leader, events)
        ).any()
    )


def main(flights: int) -> int:
    """Fly them all; the exit status."""
    nearest, back = [], []
    for number in range(flights):
        mission = load_mission(MISSIONS / ("circle-wind.yaml" if number % 3 else "line-wind.yaml"))
        events = random_events(Random(number), list(mission.followers_by_name))
        record = fly(mission, events)
        errors = np.array([slot_error(record.leader, one).distance_m for one in record.followers])
        late = record.time_s > BEGIN_S
        astray = record.time_s[late & (errors > 1.0).any(axis=0)]
        nearest.append(nearest_steered(record, mission.leader.vehicle, events))
        back.append(max(float(astray.max()) - events[-1].time_s, 0.0) if astray.size else 0.0)
        what = ", ".join(f"{one.time_s:.1f} {one.vehicle} {one.what}" for one in events)
        sys.stdout.write(
            f"{number:3} {mission.name}: {nearest[-1]:5.1f} m, greatest error "
            f"{errors[:, late].max():4.0f} m, back within 1 m {back[-1]:4.1f} s after the last; {what}\n"
        )
        sys.stdout.flush()
    sys.stdout.write(
        f"nearest two: {min(nearest):.1f} m; back within 1 m: median {np.median(back):.1f} s, "
        f"latest {max(back):.1f} s\n"
    )
    return int(min(nearest) < LEAST_M)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
