"""What a rehearsal costs, and where the time goes: run with `make bench`.

Every figure is the median of several runs in this process on this machine; the parts are timed in the same
flight, so that their shares can be compared even where the machine is noisy.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from sitl_stub import Autopilot
from vfguide.companion.core import Companion
from vfguide.companion.roles import FollowerRole, LeaderRole
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.rehearsal.recorder import VehicleRecorder
from vfguide.mavlink.codec import Codec
from vfguide.mission import Mission, load_mission

MISSION = Path(__file__).parents[2] / "missions" / "circle-wind.yaml"
RUNS = 5
TIMED_S = 60.0

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


def real_time_factor(mission: Mission, processes: int) -> float:
    """Flight seconds for each second of the wall clock."""
    record = fly_lockstep(mission, processes=processes).record
    return record.duration_s / record.wall_s


def cost_of(mission: Mission, part: str) -> tuple[float, int]:
    """(microseconds of a call, calls) of a part in one flight."""
    owner, name = PARTS[part]
    with calls_timed(owner, name) as durations:
        fly_lockstep(mission)
    return statistics.fmean(durations) * 1e6, len(durations)


def main() -> None:
    """Print both tables."""
    mission = load_mission(MISSION)
    say = sys.stdout.write
    say(f"{MISSION.name}, {len(mission.vehicles)} vehicles, Python {sys.version.split()[0]}, ")
    say(f"{os.cpu_count()} processors\n\nflight seconds for each second of the wall clock, 300 s\n")
    for processes in (1, 2):
        factors = [real_time_factor(mission, processes) for _ in range(RUNS)]
        say(f"  {processes} process{'es' * (processes > 1):2}  {statistics.median(factors):6.1f}")
        say(f"   ({min(factors):.1f} to {max(factors):.1f})\n")
    short = mission.rehearsal.model_copy(update={"duration_s": TIMED_S})
    timed = mission.model_copy(update={"rehearsal": short})
    say("\nmicroseconds of a call, one process, 60 s\n")
    for part in PARTS:
        costs = [cost_of(timed, part) for _ in range(RUNS)]
        say(f"  {part:32}{statistics.median(cost for cost, _ in costs):7.1f}")
        say(f"   x {costs[0][1]}\n")


if __name__ == "__main__":
    main()
