"""What processes take of the computer, from outside."""

import os
import time
from dataclasses import dataclass

import psutil

from vfguide.record.latency import Usage


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """What a process has taken so far."""

    at_s: float
    """When, s of the monotonic clock."""
    busy_s: float
    """Processor time, s."""
    rss_mb: float
    """Resident memory, 10^6 bytes."""

    def since(self, earlier: "Account") -> Usage:
        """What it took between the two."""
        share = (self.busy_s - earlier.busy_s) / max(self.at_s - earlier.at_s, 0.01)
        return Usage(cpu_share=round(share, 4), rss_mb=round(self.rss_mb, 1))


def account_of(pid: int) -> Account | None:
    """What a process has taken; None if it has ended."""
    try:
        process = psutil.Process(pid)
        with process.oneshot():
            times, memory = process.cpu_times(), process.memory_info()
    except psutil.Error:
        return None
    return Account(at_s=time.monotonic(), busy_s=times.user + times.system, rss_mb=memory.rss / 1e6)


def accounts_of(pids: dict[str, int]) -> dict[str, Account]:
    """What processes have taken, by name; those that have ended are left out."""
    found = {name: account_of(pid) for name, pid in pids.items()}
    return {name: account for name, account in found.items() if account is not None}


def load() -> list[float]:
    """How busy the computer is: processes that ran or wanted to, over 1, 5 and 15 minutes."""
    return [round(average, 2) for average in os.getloadavg()]
