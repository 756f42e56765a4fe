"""Winds to fly in: the vector the air moves toward, as a function of simulation time."""

import math
from dataclasses import dataclass
from typing import Protocol


class Wind(Protocol):
    """A wind that is the same everywhere and may change with time."""

    def at(self, time_s: float) -> tuple[float, float]:
        """Wind (north, east) in m/s at simulation time `time_s`, toward where the air moves."""
        ...


@dataclass(frozen=True, slots=True)
class CalmWind:
    """No wind at all."""

    def at(self, time_s: float) -> tuple[float, float]:
        """(0, 0)."""
        del time_s  # a calm has no time
        return 0.0, 0.0


class SteadyWind:
    """The same wind for ever: `speed_m_s` toward `toward_rad` (clockwise from north)."""

    __slots__ = ("_wind_m_s",)

    def __init__(self, speed_m_s: float, toward_rad: float) -> None:
        self._wind_m_s = (speed_m_s * math.cos(toward_rad), speed_m_s * math.sin(toward_rad))

    def at(self, time_s: float) -> tuple[float, float]:
        """The one wind, (north, east) in m/s."""
        del time_s  # it is steady
        return self._wind_m_s


@dataclass(frozen=True, slots=True)
class ArticleWind:
    """The wind of the article's simulations.

    W(t) = 5 + 3 cos(0.1 t) m/s toward psi_w(t) = 135 deg + pi sin(0.1 t) rad: it turns by up to
    0.31 rad/s and swings through the whole circle every 63 s.
    """

    def at(self, time_s: float) -> tuple[float, float]:
        """Wind (north, east) in m/s at `time_s`."""
        speed_m_s = 5.0 + 3.0 * math.cos(0.1 * time_s)
        toward_rad = 0.75 * math.pi + math.pi * math.sin(0.1 * time_s)
        return speed_m_s * math.cos(toward_rad), speed_m_s * math.sin(toward_rad)


WIND_ESTIMATE_TIME_CONSTANT_S = 20.0
"""How slowly an autopilot's own estimate of the wind follows the wind."""


def followed_wind_m_s(
    known_m_s: tuple[float, float], wind_m_s: tuple[float, float], span_s: float
) -> tuple[float, float]:
    """An autopilot's estimate (north, east) after a span in this wind: a first-order lag."""
    share = -math.expm1(-span_s / WIND_ESTIMATE_TIME_CONSTANT_S)
    (known_north, known_east), (north, east) = known_m_s, wind_m_s
    return known_north + share * (north - known_north), known_east + share * (east - known_east)
