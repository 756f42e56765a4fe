"""Winds of thousands of formations at once."""

import math
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.mission.rehearsal import ArticleWind, CalmWind, SteadyWind


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingingWind:
    """The article's form: W = mean + swell cos(rate t + phase), toward centre + swing sin(rate t + phase)."""

    mean: FloatArray
    """m/s."""
    swell: FloatArray
    """m/s."""
    centre: FloatArray
    """rad."""
    swing: FloatArray
    """rad."""
    rate: FloatArray
    """rad/s."""
    phase: FloatArray
    """rad."""

    def at(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """(north, east) of the winds, m/s, toward."""
        angle = self.rate * time_s + self.phase
        speed = self.mean + self.swell * np.cos(angle)
        toward = self.centre + self.swing * np.sin(angle)
        return speed * np.cos(toward), speed * np.sin(toward)


def swinging_wind(wind: CalmWind | ArticleWind | SteadyWind, count: int) -> SwingingWind:
    """The wind of a mission, for so many formations."""
    still = np.zeros(count)
    mean, swell, centre, swing, rate = 0.0, 0.0, 0.0, 0.0, 0.0
    if isinstance(wind, SteadyWind):
        mean, centre = wind.speed_m_s, math.radians(wind.toward_deg)
    elif isinstance(wind, ArticleWind):
        mean, swell, centre, swing, rate = 5.0, 3.0, 0.75 * math.pi, math.pi, 0.1
    return SwingingWind(
        mean=still + mean,
        swell=still + swell,
        centre=still + centre,
        swing=still + swing,
        rate=still + rate,
        phase=still,
    )
