"""The air at a place and a time: a wind, and what the standards add to it.

Turbulence is a field that drifts with the wind (see `turbulence`). A discrete gust is the standards' "one
minus cosine", at the same time for all. Shear is MIL-F-8785C's logarithmic profile, by which the wind grows
with height.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sitl_stub.earth import ECCENTRICITY_SQUARED, radii_m
from sitl_stub.turbulence import (
    FOOT_M,
    Turbulence,
    TurbulenceField,
    Vector,
    low_altitude_intensity,
)
from sitl_stub.wind import SteadyWind, Wind

ROUGHNESS_M = 0.15 * FOOT_M
"""z0 of the profile: MIL-F-8785C's for landing, over open ground; 2 feet elsewhere."""

LEAST_HEIGHT_M = 1.0
"""Nearer to the ground the profile ends."""


class Place(NamedTuple):
    """Where the air is asked for."""

    latitude_rad: float
    """Geodetic."""
    longitude_rad: float
    """Geodetic."""
    altitude_m: float
    """Above mean sea level, here as good as above the ellipsoid."""
    height_m: float
    """Above the ground at home."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscreteGust:
    """A gust of (1 - cos) / 2: from nothing to its greatest and back."""

    start_s: float
    """Simulation time of its beginning."""
    length_s: float
    """How long it lasts."""
    north_m_s: float
    """Greatest, toward north."""
    east_m_s: float
    """Greatest, toward east."""

    def __post_init__(self) -> None:
        """Refuse what is no gust.

        Raises:
            ValueError: a number is out of its range.
        """
        whole = (self.start_s, self.length_s, self.north_m_s, self.east_m_s)
        if not all(map(math.isfinite, whole)) or self.start_s < 0.0 or self.length_s <= 0.0:
            raise ValueError(f"{self} is no gust")

    def at(self, time_s: float) -> tuple[float, float]:
        """(north, east) at a simulation time, m/s."""
        share = (time_s - self.start_s) / self.length_s
        if not 0.0 < share < 1.0:
            return 0.0, 0.0
        shape = 0.5 * (1.0 - math.cos(2.0 * math.pi * share))
        return shape * self.north_m_s, shape * self.east_m_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Shear:
    """How the wind grows with height: W(h) = W(h0) ln(h / z0) / ln(h0 / z0)."""

    reference_m: float
    """h0, height above the ground at which the wind is the declared one."""
    roughness_m: float = ROUGHNESS_M
    """z0."""

    def factor(self, height_m: float) -> float:
        """Wind at a height above the ground in parts of that at the reference height."""
        heights = (max(height_m, LEAST_HEIGHT_M), max(self.reference_m, LEAST_HEIGHT_M))
        low, high = (math.log(height / self.roughness_m) for height in heights)
        return low / high


@dataclass(frozen=True, slots=True)
class Air:
    """A wind with everything that is in it."""

    wind: Wind
    """The mean."""
    turbulence: TurbulenceField | None = None
    """What drifts with it."""
    gusts: tuple[DiscreteGust, ...] = ()
    """What comes and goes."""
    shear: Shear | None = None
    """How the mean grows with height."""

    def near(self, place: Place) -> Wind:
        """The air about a place, as a wind that only time changes: good for one step of an integration."""
        if self.turbulence is None and not self.gusts and self.shear is None:
            return self.wind
        return LocalWind(self, place)

    def at(self, place: Place, time_s: float) -> tuple[float, float]:
        """(north, east) at a place and simulation time, m/s, toward where the air moves."""
        north, east = self.wind.at(time_s)
        if self.shear is not None:
            factor = self.shear.factor(place.height_m)
            north, east = factor * north, factor * east
        for gust in self.gusts:
            more_north, more_east = gust.at(time_s)
            north, east = north + more_north, east + more_east
        if self.turbulence is not None:
            axes = local_axes(place)
            # A swinging wind has no one direction to drift in: the pattern then stands over the ground.
            drift_m = (0.0, 0.0)
            if isinstance(self.wind, SteadyWind):
                steady_north, steady_east = self.wind.at(time_s)
                drift_m = steady_north * time_s, steady_east * time_s
            moved = drift_m[0] * axes[0] + drift_m[1] * axes[1]
            gust_m_s = self.turbulence.at(earth_centred_m(place) - moved)
            north, east = north + float(axes[0] @ gust_m_s), east + float(axes[1] @ gust_m_s)
        return north, east


def air_of(
    wind: Wind,
    *,
    level: Turbulence,
    height_m: float,
    seed: int,
    gusts: tuple[DiscreteGust, ...] = (),
    roughness_m: float | None = None,
) -> Air:
    """The air of a formation.

    Args:
        wind: the mean, at the height.
        level: of the turbulence.
        height_m: above the ground, for which turbulence and wind are meant.
        seed: of the turbulence.
        gusts: what comes and goes.
        roughness_m: z0 of the ground below a wind that grows with height; None: it does not.
    """
    field = None
    if level != "none":
        field = TurbulenceField(low_altitude_intensity(level, height_m), seed)
    shear = None
    if roughness_m is not None:
        shear = Shear(reference_m=height_m, roughness_m=roughness_m)
    return Air(wind, field, gusts, shear)


@dataclass(frozen=True, slots=True)
class LocalWind:
    """The air about one place."""

    air: Air
    """Of which it is a part."""
    place: Place
    """Where."""

    def at(self, time_s: float) -> tuple[float, float]:
        """(north, east) at simulation time `time_s`, m/s."""
        return self.air.at(self.place, time_s)


def local_axes(place: Place) -> tuple[Vector, Vector]:
    """North and east at a place as unit vectors of the frame that is fixed to the earth's centre."""
    sine, cosine = math.sin(place.latitude_rad), math.cos(place.latitude_rad)
    east_sine, east_cosine = math.sin(place.longitude_rad), math.cos(place.longitude_rad)
    return (
        np.array([-sine * east_cosine, -sine * east_sine, cosine]),
        np.array([-east_sine, east_cosine, 0.0]),
    )


def earth_centred_m(place: Place) -> Vector:
    """The place in the frame that is fixed to the earth's centre: the same for every process."""
    _, transverse_m = radii_m(place.latitude_rad)
    across_m = (transverse_m + place.altitude_m) * math.cos(place.latitude_rad)
    polar_m = transverse_m * (1.0 - ECCENTRICITY_SQUARED) + place.altitude_m
    return np.array(
        [
            across_m * math.cos(place.longitude_rad),
            across_m * math.sin(place.longitude_rad),
            polar_m * math.sin(place.latitude_rad),
        ]
    )
