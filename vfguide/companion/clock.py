"""Companion clock: this computer's monotonic clock, scaled to another rate in a rehearsal.

The time of day is not used: satellite navigation or the network may step it, even in flight. Between
computers, the link measures the clocks' difference.
"""

import time

import msgspec


class Clock(msgspec.Struct, frozen=True, kw_only=True):
    """Clock that never steps and counts seconds from an arbitrary moment."""

    epoch_s: float = 0.0
    """Moment at which this and the monotonic clock agree, s of the monotonic clock."""
    rate: float = 1.0
    """Seconds of this clock per real second. Rehearsals run faster than real time, and give emulators and
    companions the same rate, so that time-outs shrink with everything else."""

    def now(self) -> float:
        """Return the time, s."""
        return self.epoch_s + (time.monotonic() - self.epoch_s) * self.rate

    def real_seconds(self, seconds: float) -> float:
        """Return the real duration of some seconds of this clock."""
        return seconds / self.rate
