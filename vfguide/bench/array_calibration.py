"""The companions' calibration of airspeeds, for thousands at once: the same arithmetic on arrays."""

from typing import Any

import numpy as np

from vfguide.angles import wrap_angle
from vfguide.elementwise import FloatArray, hypot
from vfguide.guidance.airspeed_calibration import Calibration, calibrated, calibration_of
from vfguide.guidance.navigation import Sample
from vfguide.state import VehicleState


class Calibrations:
    """One for each vehicle."""

    def __init__(self) -> None:
        self._known: Calibration = calibration_of(slips=False)
        self._heading: FloatArray | None = None
        self._time_s = 0.0

    @property
    def scale(self) -> FloatArray:
        """True airspeeds over the reported ones."""
        return np.asarray(self._known.scale)

    def learn(
        self,
        sample: Sample[FloatArray],
        reported_airspeed: FloatArray,
        state: VehicleState[FloatArray],
    ) -> None:
        """Learn from a report (its airspeed apart, as it came) and the state that it led to."""
        before, self._heading = self._heading, sample.heading
        interval, self._time_s = sample.time_s - self._time_s, sample.time_s
        if before is None:
            return
        # Elementwise functions take arrays for what they call floats. Nobody here is too slow to learn from.
        seen: dict[str, Any] = {
            "reported_airspeed": reported_airspeed,
            "heading": sample.heading,
            "turn_rate": wrap_angle(sample.heading - before) / interval,
            "velocity_north": sample.velocity_north,
            "velocity_east": sample.velocity_east,
            "wind_rate": hypot(state.wind_rate_north, state.wind_rate_east),
        }
        self._known = calibrated(self._known, **seen, period=interval)
