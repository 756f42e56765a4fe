"""An autopilot's boot time on the companion's clock."""

import math

REBOOT_S = 1.0
"""A boot time that jumps back by more than this is a reboot, not a late report."""

WINDOW_S = 30.0
"""How long a fast report is remembered: two clocks drift apart by some milliseconds in this time."""


class BootClock:
    """Learns when an autopilot booted from the reports that travelled fastest.

    A report is never read before it was made, so the least difference between the reader's clock and the
    autopilot's is the one with the least delay in it. The least of the present window and of the one before
    it counts: what is older may be off by the drift of the clocks.
    """

    def __init__(self) -> None:
        self.reset()

    def rebooted(self, boot_time_s: float) -> bool:
        """Whether this boot time shows that the autopilot has started anew."""
        return boot_time_s < self._newest - REBOOT_S

    def reset(self) -> None:
        """Forget the autopilot."""
        self._least = math.inf
        self._least_before = math.inf
        self._window_ends = -math.inf
        self._newest = -math.inf

    def shared_time(self, boot_time_s: float, now: float) -> float:
        """When a report that is read now was true, s on the companion's clock."""
        self._newest = max(self._newest, boot_time_s)
        if now >= self._window_ends:
            self._least_before, self._least = self._least, math.inf
            self._window_ends = now + WINDOW_S
        self._least = min(self._least, now - boot_time_s)
        return boot_time_s + min(self._least, self._least_before)
