"""What a rehearsal costs, and where the time goes: run with `make bench`.

Every figure is the median of several runs in this process on this machine; the parts are timed in the same
flight, so that their shares can be compared even where the machine is noisy.

The unit that does not depend on the machine is what pymavlink takes for the same messages: one `pack` of
each message of the flight and one `parse_buffer` of its bytes, as a program does that only sends and hears
them. Flights and pymavlink take turns, in processor time.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot
from tests.benchmarks.results import Cases
from tests.kit.figures import tell
from tests.kit.missions import mission_with, shipped
from vfguide.companion.core import Companion
from vfguide.companion.roles import FollowerRole, LeaderRole
from vfguide.lab.rehearsal.lockstep import fly_lockstep, instants
from vfguide.lab.rehearsal.recorder import VehicleRecorder
from vfguide.mavlink.codec import Codec
from vfguide.mission import Mission
from vfguide.record.tlog import TelemetryLog

NAME = "circle-wind"
RUNS = 5
TIMED_S = 60.0
JOINED_S = 30.0
"""By then all are in their slots."""

PARTS: dict[str, tuple[type, str]] = {
    "emulator: flies, reports": (Autopilot, "advance"),
    "emulator: commands, answers": (Autopilot, "receive"),
    "emulator: true state": (Autopilot, "truth"),
    "companion: everything": (Companion, "receive_mavlink"),
    "  of it, decoding": (Codec, "decode"),
    "  of it, a leader's guidance": (LeaderRole, "step"),
    "  of it, a follower's guidance": (FollowerRole, "step"),
    "  of it, encoding": (Codec, "encode"),
    "record": (VehicleRecorder, "sample"),
}


@contextmanager
def calls_timed(owner: type, name: str) -> Iterator[list[float]]:
    """Durations of every call of a method, s, as they happen."""
    method: Callable[..., object] = getattr(owner, name)
    durations: list[float] = []

    def timed(*arguments: object, **options: object) -> object:
        began = time.perf_counter()
        try:
            return method(*arguments, **options)
        finally:
            durations.append(time.perf_counter() - began)

    setattr(owner, name, timed)
    try:
        yield durations
    finally:
        setattr(owner, name, method)


def flight_cost(mission: Mission) -> float:
    """Processor time of one flight in one process, s."""
    began = time.process_time()
    fly_lockstep(mission)
    return time.process_time() - began


@contextmanager
def datagrams_kept() -> Iterator[list[tuple[float, bytes]]]:
    """(time in s, content) of every datagram of a flight with telemetry logs, in either direction."""
    method, kept = TelemetryLog.add, list[tuple[float, bytes]]()
    TelemetryLog.add = lambda _, now, datagram: kept.append((now, datagram))  # type: ignore[method-assign]
    try:
        yield kept
    finally:
        TelemetryLog.add = method  # type: ignore[method-assign]


def pymavlink_cost(datagrams: Sequence[bytes]) -> float:
    """Processor time in which pymavlink parses these datagrams and packs their messages, s."""
    parser, packer = mavlink.MAVLink(None), mavlink.MAVLink(None)
    began = time.process_time()
    for datagram in datagrams:
        for message in parser.parse_buffer(datagram) or ():
            message.pack(packer)
    return time.process_time() - began


def cases() -> Cases:
    """Measure a step's cost against pymavlink's for its messages, also once all have joined."""
    mission = lasting(TIMED_S)
    with datagrams_kept() as kept:
        fly_lockstep(mission, epoch_s=0.0)
    joining = lasting(JOINED_S)
    parts = [[one for _, one in kept], [one for now, one in kept if now <= JOINED_S]]
    rows = []
    for _ in range(RUNS):
        whole, before = flight_cost(mission), flight_cost(joining)
        whole_bytes, before_bytes = (pymavlink_cost(part) for part in parts)
        rows.append((whole, whole_bytes, whole - before, whole_bytes - before_bytes))
    steps = [len(list(instants(one))) * len(one.vehicles) for one in (mission, joining)]
    for name, place, count in (
        (f"0 to {mission.rehearsal.duration_s:g} s", 0, steps[0]),
        ("once all have joined", 2, steps[0] - steps[1]),
    ):
        own = statistics.median(row[place] for row in rows) / count * 1e6
        plain = statistics.median(row[place + 1] for row in rows) / count * 1e6
        ratio = statistics.median(row[place] / row[place + 1] for row in rows)
        yield name, {"step_us": own, "pymavlink_us": plain, "ratio": ratio}


def lasting(duration_s: float) -> Mission:
    """The mission, flown for so long, s."""
    return mission_with(NAME, rehearsal={"duration_s": duration_s})


def main() -> None:
    """Print the tables; with `--ratios` those of the ratios alone."""
    mission, timed = shipped(NAME), lasting(TIMED_S)
    python = f"Python {sys.version.split()[0]}, {os.cpu_count()} processors"
    tell(f"{NAME}.yaml, {len(mission.vehicles)} vehicles, {python}")
    tell(
        "\nmicroseconds of processor time for a vehicle and step, pymavlink's own for its messages"
    )
    for name, figures in cases():
        tell(f"  {name:24}" + "   ".join(f"{key} {value:.4g}" for key, value in figures.items()))
    if "--ratios" in sys.argv:
        return
    tell("\nflight seconds for each second of the wall clock, 300 s")
    for processes in (1, 2):
        records = [fly_lockstep(mission, processes=processes).record for _ in range(RUNS)]
        factors = [record.duration_s / record.wall_s for record in records]
        spread = f"({min(factors):.1f} to {max(factors):.1f})"
        name = f"{processes} process{'es' * (processes > 1):2}"
        tell(f"  {name}  {statistics.median(factors):6.1f}   {spread}")
    tell("\nmicroseconds of a call, one process, 60 s")
    for part, (owner, name) in PARTS.items():
        means = []
        for _ in range(RUNS):
            with calls_timed(owner, name) as durations:
                fly_lockstep(timed)
            means.append(statistics.fmean(durations) * 1e6)
        tell(f"  {part:32}{statistics.median(means):7.1f}   x {len(durations)}")


if __name__ == "__main__":
    main()
