"""Rehearsals in lockstep, flown once for all tests that look at them, and what is read from one."""

import fcntl
import hashlib
import os
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from tests.kit.missions import mission_with
from vfguide.companion.role import Event
from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.figures import pair_separations, seen_from_leader, slot_error
from vfguide.lab.report.metrics import Summary, summarise
from vfguide.mission import Mission
from vfguide.record.flight import FlightRecord
from vfguide.record.vehicle import VehicleRecord

FLIGHTS = "VFGUIDE_TEST_FLIGHTS"
"""Names a directory that keeps the flights of a session of tests, for all its processes."""


@dataclass(frozen=True)
class Flight:
    """What became of a formation."""

    record: FlightRecord
    events: Mapping[str, Sequence[Event]]

    @cached_property
    def summary(self) -> Summary:
        return summarise(self.record)

    @property
    def mean_m(self) -> float:
        """Mean distance from the slots over the last half, m."""
        mean = self.summary.formation.mean_error_m
        assert mean is not None
        return mean

    def errors(self, from_s: float = 0.0, to_s: float = np.inf) -> FloatArray:
        """Distances of the followers from their slots between two times, m."""
        record = self.record
        when = (record.time_s >= from_s) & (record.time_s <= to_s)
        off = [slot_error(record.reference, one).distance_m[when] for one in record.followers]
        return np.array(off)

    def nearest(
        self, from_s: float = 0.0, to_s: float = np.inf, *, among: set[str] | None = None
    ) -> float:
        """Least distance of any two between two times, m."""
        when = (self.record.time_s >= from_s) & (self.record.time_s < to_s)
        pairs = pair_separations(self.record)
        if among is not None:
            pairs = [one for one in pairs if {one.first, one.second} <= among]
        return min(float(one.distance_m[when].min()) for one in pairs)

    def vehicle(self, name: str) -> VehicleRecord:
        return next(one for one in self.record.vehicles if one.name == name)

    def places(self) -> dict[str, tuple[float, float]]:
        """(forward, right) of each follower at the end, m."""
        leader = self.record.leader
        seen = {one.name: seen_from_leader(leader, one) for one in self.record.followers}
        return {name: (float(ahead[-1]), float(right[-1])) for name, (ahead, right) in seen.items()}

    def height(self, name: str) -> FloatArray:
        """Height of a follower above the leader over time, m."""
        return self.vehicle(name).altitude_amsl_m - self.record.leader.altitude_amsl_m

    def modes(self, name: str) -> list[str]:
        """Modes of a companion, each that follows another."""
        numbers = self.vehicle(name).mode
        changed = [0, *(np.flatnonzero(np.diff(numbers)) + 1)]
        return [self.record.mode_names[numbers[at]] for at in changed]

    def words(self, name: str) -> str:
        """All that a companion has said."""
        return "\n".join(event.text for event in self.events[name])

    def texts(self) -> list[str]:
        """What all companions have said."""
        return [event.text for events in self.events.values() for event in events]


def fly(name: str | Mission, /, duration_s: float | None = None, **sections: Any) -> Flight:
    """Fly a mission with some of its sections otherwise, unless it was flown before.

    Args:
        name: of a mission that comes along, or a mission.
        duration_s: of the flight; the mission's if absent.
        sections: as of `mission_with`.
    """
    if duration_s is not None:
        sections["rehearsal"] = {**sections.get("rehearsal", {}), "duration_s": duration_s}
    mission = mission_with(name, **sections)
    if FLIGHTS not in os.environ:
        return _flown(mission)
    key = hashlib.sha256(mission.model_dump_json().encode()).hexdigest()[:24]
    kept = Path(os.environ[FLIGHTS], key)
    with kept.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if kept.exists():
            found: Flight = pickle.loads(kept.read_bytes())  # noqa: S301 - of this session
            return found
        flown = _flown(mission)
        kept.write_bytes(pickle.dumps(flown))
    return flown


def _flown(mission: Mission) -> Flight:
    flown = fly_lockstep(mission)
    return Flight(flown.record, flown.events)
