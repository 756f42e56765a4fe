"""What is left of a flight in containers."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.lab.report.figures import pair_separations, slot_error
from vfguide.record.flight import FlightRecord


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A flight in containers, after its end."""

    status: int
    """Exit status of the judge."""
    directory: Path
    """What the judge wrote."""
    logs: dict[str, str]
    """What each container had to say."""
    seen: Any
    """What the scenario came back with."""

    @property
    def summary(self) -> dict[str, Any]:
        content: dict[str, Any] = json.loads((self.directory / "summary.json").read_text())
        return content

    @property
    def record(self) -> FlightRecord:
        return FlightRecord.load(self.directory / "flight.npz")

    def errors(self, vehicle: str, from_s: float, to_s: float) -> FloatArray:
        """Distances of a follower from its slot, m."""
        record = self.record
        follower = next(one for one in record.followers if one.name == vehicle)
        during = (record.time_s >= from_s) & (record.time_s < to_s)
        return np.asarray(slot_error(record.leader, follower).distance_m[during])

    def greatest(self, from_s: float, to_s: float, *vehicles: str) -> float:
        """Greatest distance of any of these followers from its slot, m."""
        return max(float(self.errors(name, from_s, to_s).max()) for name in vehicles)

    def least_separation_m(self, *vehicles: str) -> float:
        """Of any two of these vehicles at any time, m."""
        return min(
            float(pair.distance_m.min())
            for pair in pair_separations(self.record)
            if {pair.first, pair.second} <= set(vehicles)
        )

    def modes(self, vehicle: str) -> list[str]:
        """Modes that a companion went into, in order."""
        messages = (
            json.loads(line[line.index("{") :])["message"]
            for line in self.logs[vehicle].splitlines()
            if "{" in line
        )
        return [text.split(" -> ")[1] for text in messages if " -> " in text]
