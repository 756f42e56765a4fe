"""The clock of a companion: this computer's monotonic one, or in a rehearsal one that runs at another rate.

The time of day is not used: it steps when satellite navigation or the network sets it, in flight too. Between
computers the link measures how far their clocks are apart.
"""

import time

import msgspec


class Clock(msgspec.Struct, frozen=True, kw_only=True):
    """Seconds of a clock that never steps and counts from an arbitrary moment."""

    epoch_s: float = 0.0
    """Where the two clocks show the same, s of the monotonic clock."""
    rate: float = 1.0
    """Seconds that pass on this clock for each real one: rehearsals run faster than real time, and hand
    the same rate to emulators and companions. Time-outs then shrink with everything else."""

    def now(self) -> float:
        """The time, s."""
        return self.epoch_s + (time.monotonic() - self.epoch_s) * self.rate

    def real_seconds(self, seconds: float) -> float:
        """How long some seconds of this clock really take."""
        return seconds / self.rate
