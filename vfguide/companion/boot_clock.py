"""An autopilot's boot time on the clock that the formation shares."""

import math

REBOOT_S = 1.0
"""A boot time that jumps back by more than this is a reboot, not a late report."""


class BootClock:
    """Learns when an autopilot booted from the reports that travelled fastest.

    A report is never read before it was made, so the least difference between the reader's clock and the
    autopilot's is the one with the least delay in it.
    """

    def __init__(self) -> None:
        self._offset = math.inf
        self._newest = -math.inf

    def rebooted(self, boot_time_s: float) -> bool:
        """Whether this boot time shows that the autopilot has started anew."""
        return boot_time_s < self._newest - REBOOT_S

    def reset(self) -> None:
        """Forget the autopilot."""
        self._offset = math.inf
        self._newest = -math.inf

    def shared_time(self, boot_time_s: float, now: float) -> float:
        """When a report that is read now was true, s on the shared clock."""
        self._newest = max(self._newest, boot_time_s)
        self._offset = min(self._offset, now - boot_time_s)
        return boot_time_s + self._offset
