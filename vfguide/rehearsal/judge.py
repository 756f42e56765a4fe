"""True states of a live rehearsal, as the emulators send them; and the flight record that they make."""

import asyncio
import json
from collections import defaultdict
from dataclasses import fields

import sitl_stub
from vfguide.mission.model import Mission

FIELDS = frozenset(field.name for field in fields(sitl_stub.Truth))


class Judge(asyncio.DatagramProtocol):
    """Collects the true states of every vehicle at each sample time."""

    def __init__(self, mission: Mission) -> None:
        """Listen for the vehicles of a mission."""
        self._names = {vehicle.system_id: name for name, vehicle in mission.vehicles.items()}
        self._rate_hz = mission.rehearsal.rate_hz
        self.truths: dict[str, dict[int, sitl_stub.Truth]] = defaultdict(dict)
        """By vehicle and number of the sample."""

    def datagram_received(self, data: bytes, _address: object) -> None:
        """One JSON object of one vehicle at one time."""
        content = json.loads(data)
        name = self._names[content.pop("system_id")]
        truth = sitl_stub.Truth(**{key: content[key] for key in FIELDS})
        self.truths[name][round(truth.time_s * self._rate_hz)] = truth

    @property
    def time_s(self) -> float:
        """The newest time of which every vehicle's state is known; negative before the first."""
        if len(self.truths) < len(self._names):
            return -1.0
        return min(max(samples) for samples in self.truths.values()) / self._rate_hz

    def common_samples(self) -> list[int]:
        """Numbers of the samples that are known of every vehicle, in order."""
        if len(self.truths) < len(self._names):
            return []
        return sorted(set.intersection(*(set(samples) for samples in self.truths.values())))
