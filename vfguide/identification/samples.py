"""What was told and what was seen, as arrays."""

from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Samples:
    """One stretch of a flight. All arrays but the setpoints' have one entry for each report."""

    time_s: FloatArray
    """Of the reports, s."""
    direction: FloatArray
    """What the turn rate turns, heading or course, unwrapped, rad."""
    speed: FloatArray
    """The speed that is held, m/s."""
    wind_north: FloatArray
    """Wind toward north, m/s; nothing where ground speed and course are held."""
    wind_east: FloatArray
    """Wind toward east, m/s."""
    told_s: FloatArray
    """When setpoints went out, s; the first before the first report."""
    told: FloatArray
    """The setpoints: course, unwrapped, rad, or speed, m/s."""


def mean_told(samples: Samples, dead_time: float) -> FloatArray:
    """Mean setpoint that acts between each report and the next, after a dead time (s).

    Exact for setpoints that are held until the next, and smooth in the dead time, so that it can be fitted.
    """
    knots = np.append(samples.told_s, max(samples.time_s[-1], samples.told_s[-1]) + 1.0)
    total = np.concatenate(([0.0], np.cumsum(samples.told * np.diff(knots))))
    # Before the first setpoint that is known there was another like it.
    first, early = knots[0], np.minimum(samples.time_s - dead_time - knots[0], 0.0)
    until = np.interp(np.maximum(samples.time_s - dead_time, first), knots, total)
    area = until + early * samples.told[0]
    mean: FloatArray = np.diff(area) / np.diff(samples.time_s)
    return mean
