"""What a process takes of the computer, as Linux accounts it."""

import os
import time
from dataclasses import dataclass
from pathlib import Path

from vfguide.record.latency import Usage

TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


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
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return None
    # Counted from the third field of proc(5): user and system time, resident pages.
    busy_s = (int(fields[11]) + int(fields[12])) / TICKS_PER_SECOND
    resident = int(fields[21]) * PAGE_BYTES
    return Account(at_s=time.monotonic(), busy_s=busy_s, rss_mb=resident / 1e6)


def accounts_of(pids: dict[str, int]) -> dict[str, Account]:
    """What processes have taken, by name; those that have ended are left out."""
    found = {name: account_of(pid) for name, pid in pids.items()}
    return {name: account for name, account in found.items() if account is not None}
