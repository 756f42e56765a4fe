"""What a process takes of the computer, from outside."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

PROCESSES = Path("/proc")

TICKS_PER_S = os.sysconf("SC_CLK_TCK")

USER_TICKS, SYSTEM_TICKS = 11, 12
"""Places in /proc/PID/stat, counted from behind the program's name."""


@dataclass(frozen=True, slots=True)
class Usage:
    """What a process has taken so far."""

    wall_s: float
    """When, s of the monotonic clock."""
    cpu_s: float
    """Processor time, s."""
    memory_mb: float
    """Resident memory, 10^6 bytes."""

    def cpu_percent_since(self, earlier: "Usage") -> float:
        """Share of one core."""
        return 100.0 * (self.cpu_s - earlier.cpu_s) / max(self.wall_s - earlier.wall_s, 1e-9)


def usage_of(pid: int) -> Usage | None:
    """What a process has taken; None if it is gone."""
    try:
        stat = (PROCESSES / str(pid) / "stat").read_text()
        status = (PROCESSES / str(pid) / "status").read_text()
    except OSError:
        return None
    # The name is in parentheses and may hold anything.
    fields = stat.rpartition(")")[2].split()
    ticks = int(fields[USER_TICKS]) + int(fields[SYSTEM_TICKS])
    resident = next((line for line in status.splitlines() if line.startswith("VmRSS:")), None)
    memory_kib = 0 if resident is None else int(resident.split()[1])
    return Usage(time.monotonic(), ticks / TICKS_PER_S, memory_kib * 1024 / 1e6)


def load() -> list[float]:
    """How busy the computer is: processes that ran or wanted to, over 1, 5 and 15 minutes."""
    return [round(average, 2) for average in os.getloadavg()]
