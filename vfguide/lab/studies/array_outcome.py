"""What thousands of flights come down to, gathered while they are flown: no track is kept."""

from dataclasses import dataclass

import numpy as np

from vfguide.angles import wrap_angle
from vfguide.elementwise import FloatArray
from vfguide.state import Setpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One number for each formation; the window is the last half of the flight, as in a flight report."""

    mean_error_m: FloatArray
    """Distance from the slot, mean over followers and window."""
    max_error_m: FloatArray
    """The greatest in the window."""
    settle_10m_s: FloatArray
    """Last time anybody was 10 m or more from the slot; infinite: at the end still."""
    settle_1m_s: FloatArray
    """The same for 1 m."""
    chatter_rad_s: FloatArray
    """Course setpoints' variation that is not net turning, per second; mean over followers."""
    speed_variation_m_s2: FloatArray
    """Speed setpoints' variation per second; mean over followers."""
    limited: FloatArray
    """Share of the followers' setpoints that a limit cut, in the window."""


class Watch:
    """Hears what happens, step by step; what comes after its time it leaves to others."""

    def __init__(self, duration_s: float) -> None:
        self._duration_s = duration_s
        self._total: FloatArray | float = 0.0
        self._samples = 0
        self._greatest: FloatArray | float = 0.0
        self._out_10m: FloatArray | float = 0.0
        self._out_1m: FloatArray | float = 0.0
        self._told: Setpoint[FloatArray] | None = None
        self._speeding: FloatArray | float = 0.0
        self._variation: FloatArray | float = 0.0
        self._turned: FloatArray | float = 0.0
        self._limited: FloatArray | float = 0.0

    def __call__(
        self, time_s: float, distances: FloatArray, setpoint: Setpoint[FloatArray] | None
    ) -> None:
        """One instant: distances from the slots, followers by formations, and their setpoints."""
        if time_s > self._duration_s + 1e-6:
            return
        farthest = distances.max(axis=0)
        self._out_10m = np.where(farthest < 10.0, self._out_10m, time_s)
        self._out_1m = np.where(farthest < 1.0, self._out_1m, time_s)
        if time_s < self._duration_s / 2.0 - 1e-6 or setpoint is None:
            return
        self._samples += 1
        self._total = self._total + distances.mean(axis=0)
        self._greatest = np.maximum(self._greatest, farthest)
        self._limited = self._limited + np.mean(setpoint.limited, axis=0)
        if self._told is not None:
            change = wrap_angle(setpoint.course - self._told.course)
            self._speeding = self._speeding + np.abs(setpoint.speed - self._told.speed)
            self._variation = self._variation + np.abs(change)
            self._turned = self._turned + change
        self._told = setpoint

    def outcome(self) -> Outcome:
        """What it came to."""
        window = self._duration_s / 2.0
        end = self._duration_s - 1e-6
        excess = np.asarray(self._variation - np.abs(self._turned))
        out_10m, out_1m = np.asarray(self._out_10m), np.asarray(self._out_1m)
        return Outcome(
            mean_error_m=np.asarray(self._total) / self._samples,
            max_error_m=np.asarray(self._greatest),
            settle_10m_s=np.where(out_10m < end, out_10m, np.inf),
            settle_1m_s=np.where(out_1m < end, out_1m, np.inf),
            chatter_rad_s=np.maximum(excess, 0.0).mean(axis=0) / window,
            speed_variation_m_s2=np.asarray(self._speeding).mean(axis=0) / window,
            limited=np.asarray(self._limited) / self._samples,
        )
