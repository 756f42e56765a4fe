"""What the emulators of a live flight tell of the truth, and flights whose programs run elsewhere.

Programs that run elsewhere, as in containers, share nothing but a file: a judge writes it, emulators wait
for it.

The file holds one number: Unix time of simulation time 0, s. One that is left from an earlier flight lies in
the past, and nobody who waits now takes it for his own.
"""

import asyncio
import json
import math
import time
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterable, Mapping
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import sitl_stub
from vfguide.companion.role import Snapshot
from vfguide.companion.supervisor import Mode
from vfguide.elementwise import FloatArray
from vfguide.errors import InputError, VfguideError
from vfguide.lab.rehearsal.recorder import UNSEEN, VehicleRecorder, flight_record
from vfguide.link.opening import WatchedFormation, presences
from vfguide.link.presence import Presence
from vfguide.mission.model import Mission
from vfguide.record.events import FlightEvent
from vfguide.record.flight import FlightRecord
from vfguide.record.guidance_log import (
    GuidanceStep,
    GuidanceTrack,
    age_series,
    lead_series,
    slot_series,
)
from vfguide.record.latency import Latency, latency_of
from vfguide.record.response import VehicleResponse
from vfguide.state import Setpoint

NUMBERS = frozenset(sitl_stub.Truth.__struct_fields__) - {"mode", "armed"}
"""Fields of a true state that are numbers."""

AFTERWARDS_S = 60.0
"""After the end of the flight nobody's true state is of interest."""

MODES = frozenset(mode.value for mode in Mode)

FILE_LOOK_S = 0.05
"""Real time between looks at the file."""

LEAD_S = 5.0
"""Real time that emulators get to start before simulation time 0."""

LISTEN_S = 1.0
"""Real time to hear from every companion."""

PATIENCE_S = 20.0
"""Real time without a true state of some vehicle, after which the flight counts as broken."""


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
        responses: Mapping[str, VehicleResponse | None] | None = None,
    ) -> FlightRecord:
        """What has been seen so far.

        Args:
            wall_s: how long the flight took, s of real time.
            tracks: what companions did, by vehicle, at times of the flight; as far as it is known.
            only_at_s: the newest sample alone that is not after this time, s, for a display.
            events: what companions said, at times of the flight.
            responses: by what companions flew, by vehicle; as far as it is known.

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
            record = replace(recorder.record(), response=(responses or {}).get(name))
            if track is not None:
                record = replace(record, **self._series(name, track, np.array(times)))
            vehicles.append(record)
        return flight_record(
            self._mission, times, vehicles, wall_s=wall_s, mode="live", events=events
        )

    def _series(self, name: str, track: GuidanceTrack, times: FloatArray) -> dict[str, Any]:
        """The slots that a vehicle flew in, where they were ordered, what it heard and what it led by."""
        mission, follower = self._mission, self._mission.followers_by_name.get(name)
        found: dict[str, Any] = {}
        if follower is not None:
            slot = follower.slot
            found |= slot_series(track, times, (slot.forward_m, slot.right_m, slot.up_m))
            found |= age_series(track, times)
        if mission.deputies:
            found |= lead_series(track, times, mission.origin.altitude_amsl_m)
        return found


def snapshot_of(step: GuidanceStep | None) -> Snapshot:
    """What a companion had last done, as in a rehearsal in virtual time."""
    if step is None or step.mode not in MODES:
        return UNSEEN
    setpoint = None
    if math.isfinite(step.course_rad):
        setpoint = Setpoint(course=step.course_rad, speed=step.speed_m_s, turn_limited=step.limited)
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


def give_start(file: Path, *, epoch_s: float) -> None:
    """Write the signal, so that nobody ever reads half of it.

    Raises:
        InputError: the file cannot be written.
    """
    partial = file.with_name(file.name + ".partial")
    try:
        partial.write_text(f"{epoch_s!r}\n", encoding="ascii")
        partial.replace(file)
    except OSError as error:
        raise InputError(f"{file}: cannot be written ({error.strerror})") from error


def await_start(
    file: Path,
    *,
    patience_s: float,
    clock: Callable[[], float] = time.time,
    sleep: Callable[[float], None] = time.sleep,
) -> float:
    """Unix time of simulation time 0, s, as soon as a signal is given for a time that is still to come.

    Args:
        file: where the signal appears.
        patience_s: how long to wait for it, s.
        clock: Unix time, s.
        sleep: lets time pass.

    Raises:
        VfguideError: none has come for this long.
    """
    began_s = clock()
    while clock() - began_s < patience_s:
        with suppress(OSError, ValueError):
            epoch_s = float(file.read_text(encoding="ascii"))
            if began_s < epoch_s < math.inf:
                return epoch_s
        sleep(FILE_LOOK_S)
    raise VfguideError(
        f"no flight has begun within {patience_s:g} s: {file} holds no start to come"
    )


class WatchedFlight:
    """What a judge knows of a flight that runs elsewhere."""

    def __init__(self, mission: Mission, *, watched: WatchedFormation, speedup: float) -> None:
        """Prepare to watch.

        Args:
            mission: the mission.
            watched: the formation's links, where companions say how they are.
            speedup: simulation seconds for each real one.
        """
        self.mission = mission
        self.truth_collector = TruthCollector(mission)
        self._watched = watched
        self._speedup = speedup
        self._epoch_s = 0.0

    @property
    def names(self) -> list[str]:
        """Vehicles, leader first."""
        return [self.mission.leader.vehicle, *self.mission.followers_by_name]

    @property
    def elapsed_s(self) -> float:
        """Real time since simulation time 0."""
        return time.time() - self._epoch_s

    async def _presences(self) -> dict[str, Presence]:
        """What companions say of themselves; nothing while there is no broker."""
        try:
            return dict(await presences(self._watched, seconds=LISTEN_S, random=Random()))
        except VfguideError:
            return {}

    async def missing(self) -> list[str]:
        """Vehicles whose companions are not online."""
        found = await self._presences()
        online = {name for name, presence in found.items() if presence.status == "online"}
        return [name for name in self.mission.companions if name not in online]

    async def latency(self) -> Latency | None:
        """What the companions say of their latencies; None where nobody is heard."""
        found = await self._presences()
        figures = {name: presence.figures for name, presence in found.items()}
        return latency_of(figures, leader=self.mission.leader.vehicle) if figures else None

    def start(self, file: Path) -> None:
        """Tell the emulators when to begin.

        Raises:
            InputError: the file cannot be written.
        """
        self._epoch_s = time.time() + LEAD_S
        give_start(file, epoch_s=self._epoch_s)

    def check(self) -> None:
        """See that every emulator still flies.

        Raises:
            VfguideError: one has not been heard for too long.
        """
        elapsed_s = self.elapsed_s
        for name, seen_s in self.truth_collector.last_seen_s().items():
            silence_s = elapsed_s - max(seen_s, 0.0) / self._speedup
            if silence_s > PATIENCE_S:
                raise VfguideError(f"{name}: no true state for {silence_s:.0f} s; has it ended?")


@asynccontextmanager
async def watched_flight(
    mission: Mission, *, truth: tuple[str, int], watched: WatchedFormation, speedup: float
) -> AsyncIterator[WatchedFlight]:
    """A flight to watch, with an open ear for true states at a host and port.

    Raises:
        VfguideError: the port is not to be had.
    """
    flight = WatchedFlight(mission, watched=watched, speedup=speedup)
    loop = asyncio.get_running_loop()
    try:
        transport, _ = await loop.create_datagram_endpoint(
            lambda: flight.truth_collector, local_addr=truth
        )
    except OSError as error:
        host, port = truth
        raise VfguideError(f"udpin://{host}:{port}: cannot listen ({error.strerror})") from error
    try:
        yield flight
    finally:
        transport.close()
