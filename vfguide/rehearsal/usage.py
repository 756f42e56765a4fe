"""What a process takes of the computer, as Linux accounts it."""

import os
from pathlib import Path

TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


def usage_of(pid: int) -> dict[str, float]:
    """Share of one core since the process began, and resident memory in MB; empty if it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        uptime_s = float(Path("/proc/uptime").read_text().split()[0])
    except OSError:
        return {}
    # Counted from the third field of proc(5): user and system time, start time, resident pages.
    busy_s = (int(fields[11]) + int(fields[12])) / TICKS_PER_SECOND
    lived_s = uptime_s - int(fields[19]) / TICKS_PER_SECOND
    resident = int(fields[21]) * PAGE_BYTES
    return {
        "cpu_share": round(busy_s / max(lived_s, 0.01), 4),
        "rss_mb": round(resident / 1e6, 1),
    }
