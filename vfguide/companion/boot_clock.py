"""An autopilot's boot time on the companion's clock."""

import math

REBOOT_S = 1.0
"""A boot time that jumps back by more than this is no late report of an ordinary link."""

CERTAIN_S = 0.15
"""For so long boot times have to go on from there, as time does. What a radio or a router repeats comes
singly, all at once, or among newer reports: the companion may engage anew only after a real reboot."""

WINDOW_S = 30.0
"""How long a fast report is remembered: two clocks drift apart by some milliseconds in this time."""


class BootClock:
    """Learns when an autopilot booted from the reports that travelled fastest.

    A report is never read before it was made, so the least difference between the reader's clock and the
    autopilot's is the one with the least delay in it. The least of the present window and of the one before
    it counts: what is older may be off by the drift of the clocks.
    """

    def __init__(self) -> None:
        self._jumped: tuple[float, float] | None = None
        self.reset()

    def rebooted(self, boot_time_s: float, now: float) -> bool:
        """Whether this boot time, read now, shows that the autopilot has started anew."""
        if boot_time_s >= self._newest - REBOOT_S:
            self._jumped = None
            return False
        if self._jumped is None or boot_time_s < self._jumped[0]:
            self._jumped = (boot_time_s, now)
            return False
        went_on, passed = boot_time_s - self._jumped[0], now - self._jumped[1]
        return went_on >= CERTAIN_S and abs(went_on - passed) <= 0.5 * went_on

    def reset(self) -> None:
        """Forget the autopilot."""
        self._least = math.inf
        self._least_before = math.inf
        self._window_ends = -math.inf
        self._newest = -math.inf
        self._jumped = None

    def shared_time(self, boot_time_s: float, now: float) -> float:
        """When a report that is read now was true, s on the companion's clock."""
        self._newest = max(self._newest, boot_time_s)
        if now >= self._window_ends:
            self._least_before, self._least = self._least, math.inf
            self._window_ends = now + WINDOW_S
        self._least = min(self._least, now - boot_time_s)
        return boot_time_s + min(self._least, self._least_before)
