"""True states of a live rehearsal, as the emulators send them; and the flight record that they make."""

import asyncio
import json
import math
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import fields, replace
from typing import Any

import numpy as np

import sitl_stub
from vfguide.companion.role import Snapshot
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import VfguideError
from vfguide.lab.rehearsal.recorder import UNSEEN, VehicleRecorder, flight_record
from vfguide.mission.model import Mission
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import GuidanceStep, GuidanceTrack
from vfguide.record.guidance_series import lead_series, slot_series
from vfguide.state import Setpoint

NUMBERS = frozenset(field.name for field in fields(sitl_stub.Truth)) - {"mode", "armed"}
"""Fields of a true state that are numbers."""

AFTERWARDS_S = 60.0
"""After the end of the flight nobody's true state is of interest."""

MODES = frozenset(mode.value for mode in Mode)


class TruthCollector(asyncio.DatagramProtocol):
    """Collects the true states of every vehicle at each sample time."""

    def __init__(self, mission: Mission) -> None:
        """Listen for the vehicles of a mission."""
        self._mission = mission
        flying = (mission.leader.vehicle, *mission.followers_by_name)
        self._names = {mission.vehicles[name].system_id: name for name in flying}
        self._rate_hz = mission.rehearsal.rate_hz
        self.truths: dict[str, dict[int, sitl_stub.Truth]] = defaultdict(dict)
        """By vehicle and number of the sample."""

    def datagram_received(self, data: bytes, _address: object) -> None:
        """One JSON object of one vehicle at one time; anything else is nobody's true state."""
        decoded = decode_truth(data)
        if decoded is not None and decoded[0] in self._names:
            system_id, truth = decoded
            if truth.time_s > self._mission.rehearsal.duration_s + AFTERWARDS_S:
                return
            self.truths[self._names[system_id]][round(truth.time_s * self._rate_hz)] = truth

    @property
    def time_s(self) -> float:
        """The newest time of which every vehicle's state is known; negative before the first."""
        if len(self.truths) < len(self._names):
            return -1.0
        return min(max(samples) for samples in self.truths.values()) / self._rate_hz

    def last_seen_s(self) -> dict[str, float]:
        """The newest time of which each vehicle's state is known; negative before the first."""
        return {
            name: max(self.truths[name]) / self._rate_hz if name in self.truths else -1.0
            for name in self._names.values()
        }

    def common_samples(self) -> list[int]:
        """Numbers of the samples that are known of every vehicle, in order."""
        if len(self.truths) < len(self._names):
            return []
        return sorted(set.intersection(*(set(samples) for samples in self.truths.values())))

    def record(
        self,
        *,
        wall_s: float,
        tracks: Mapping[str, GuidanceTrack] | None = None,
        only_at_s: float | None = None,
        events: Iterable[FlightEvent] = (),
    ) -> FlightRecord:
        """What has been seen so far.

        Args:
            wall_s: how long the flight took, s of real time.
            tracks: what companions did, by vehicle, at times of the flight; as far as it is known.
            only_at_s: the newest sample alone that is not after this time, s, for a display.
            events: what companions said, at times of the flight.

        Raises:
            VfguideError: nothing has.
        """
        last_s = self._mission.rehearsal.duration_s
        last = round((last_s if only_at_s is None else min(only_at_s, last_s)) * self._rate_hz)
        samples = [one for one in self.common_samples() if one <= last]
        if only_at_s is not None:
            samples = samples[-1:]
        if not samples:
            raise VfguideError("nothing was seen of the flight")
        times = [sample / self._rate_hz for sample in samples]
        vehicles = []
        for name in (self._mission.leader.vehicle, *self._mission.followers_by_name):
            recorder = VehicleRecorder(self._mission, name)
            track = (tracks or {}).get(name)
            for sample, time_s in zip(samples, times, strict=True):
                # The answer to the report of this sample comes a little later.
                step = track.at(time_s + 0.5 / self._rate_hz) if track is not None else None
                recorder.sample(self.truths[name][sample], snapshot_of(step))
            record = recorder.record()
            if track is not None:
                record = replace(record, **self._series(name, track, np.array(times)))
            vehicles.append(record)
        return flight_record(
            self._mission, times, vehicles, wall_s=wall_s, mode="live", events=events
        )

    def _series(self, name: str, track: GuidanceTrack, times: FloatArray) -> dict[str, Any]:
        """The slots that a vehicle flew in, where they were ordered, and what it led by."""
        mission, follower = self._mission, self._mission.followers_by_name.get(name)
        found: dict[str, Any] = {}
        if follower is not None:
            slot = follower.slot
            found |= slot_series(track, times, (slot.forward_m, slot.right_m, slot.up_m))
        if mission.deputies:
            found |= lead_series(track, times, mission.origin.altitude_amsl_m)
        return found


def snapshot_of(step: GuidanceStep | None) -> Snapshot:
    """What a companion had last done, as in a rehearsal in virtual time."""
    if step is None or step.mode not in MODES:
        return UNSEEN
    setpoint = None
    if math.isfinite(step.course_rad):
        setpoint = Setpoint(course=step.course_rad, speed=step.speed_m_s, limited=step.limited)
    return Snapshot(
        mode=Mode(step.mode), setpoint=setpoint, lyapunov=step.lyapunov_m2, path=step.path
    )


def decode_truth(data: bytes) -> tuple[int, sitl_stub.Truth] | None:
    """System and true state of a datagram; None if it is none."""
    try:
        content = json.loads(data)
        numbers: dict[str, Any] = {name: float(content[name]) for name in NUMBERS}
        mode, armed = str(content["mode"]), bool(content["armed"])
        system_id = int(content["system_id"])
    # Deep nesting exhausts the parser, and a huge integer is no float.
    except (ValueError, TypeError, LookupError, RecursionError, OverflowError):
        return None
    if not all(math.isfinite(number) for number in numbers.values()) or numbers["time_s"] < 0.0:
        return None
    return system_id, sitl_stub.Truth(**numbers, mode=mode, armed=armed)
