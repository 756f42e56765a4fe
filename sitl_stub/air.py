"""Wind, gusts, turbulence, air density, and the airspeed that a pitot tube shows.

A wind is the velocity vector of the air as a function of simulation time. A discrete gust has the
standard's "one minus cosine" shape and meets all aircraft at the same time. Wind shear follows
MIL-F-8785C's logarithmic profile.

Turbulence has Dryden's spectra with MIL-F-8785C's lengths and intensities for low altitudes. The standard
describes the gusts along one aircraft's path. Here they are a frozen pattern that drifts with the wind, so
neighbours meet correlated gusts as in real air. The pattern is a sum of plane waves, isotropic and
divergence-free. Its energy spectrum E(k) yields both of Dryden's correlations, f along the path and g across
it (Batchelor, The Theory of Homogeneous Turbulence, 1953):

    E(k) = (8 sigma² L / pi) (k L)^4 / (1 + (k L)²)^3
    f(r) = exp(-r / L), g(r) = (1 - r / (2 L)) exp(-r / L)

The waves depend on the seed alone, so separate processes see the same field. Sum of waves: Kraichnan,
"Diffusion by a random velocity field", Physics of Fluids 13, 1970.
"""

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import msgspec
import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import NDArray

from sitl_stub.geometry import ECCENTRICITY_SQUARED, radii_m

SEA_LEVEL_TEMPERATURE_K = 288.15
LAPSE_K_M = 0.0065
DENSITY_EXPONENT = 4.2559
"""Exponent of the standard atmosphere's density: g M / (R L) - 1."""

WIND_ESTIMATE_TIME_CONSTANT_S = 20.0
"""Time constant of an autopilot's own wind estimate."""

KNOT_M_S = 0.514444

FOOT_M = 0.3048

LOWEST_M, HIGHEST_M = 10.0 * FOOT_M, 1000.0 * FOOT_M
"""Range of heights of the low-altitude model; heights outside are clamped to it."""

WAVES = 384

SHORTEST_WAVE_M = 4.0
"""Shortest wavelength, about twice a small aircraft's span: shorter waves cancel out over its wings."""

ROUGHNESS_M = 0.15 * FOOT_M
"""Roughness length z0: MIL-F-8785C's for landing, over open ground; it gives 2 feet elsewhere."""

LEAST_HEIGHT_M = 1.0
"""Height at which the shear profile ends; the wind is constant below."""


def density_ratio(altitude_amsl_m: float) -> float:
    """Return the air density relative to sea level: (1 - L h / T_0)^4.2559, ICAO standard atmosphere."""
    share = 1.0 - LAPSE_K_M * altitude_amsl_m / SEA_LEVEL_TEMPERATURE_K
    # Keeps the power defined; no aircraft here gets near this altitude.
    return math.pow(max(share, 0.1), DENSITY_EXPONENT)


class AirData(msgspec.Struct, frozen=True):
    """Conversion from true airspeed to the airspeed that the autopilot shows, limits and is commanded."""

    indicated: bool = False
    """Whether indicated airspeed is shown: true airspeed times the root of the density ratio."""

    calibration: float = 1.0
    """Ratio of shown to correct airspeed; an uncalibrated sensor is some percent off."""

    def shown_per_true(self, altitude_amsl_m: float) -> float:
        """Return the ratio of shown to true airspeed at an altitude."""
        density = math.sqrt(density_ratio(altitude_amsl_m)) if self.indicated else 1.0
        return self.calibration * density


class Wind(Protocol):
    """A wind that is the same everywhere and may change with time."""

    def at(self, time_s: float) -> tuple[float, float]:
        """Return the wind (north, east) in m/s at simulation time `time_s`: the air's velocity."""
        ...


class CalmWind(msgspec.Struct, frozen=True):
    """No wind."""

    def at(self, time_s: float) -> tuple[float, float]:
        """Return (0, 0)."""
        del time_s
        return 0.0, 0.0


class SteadyWind:
    """A constant wind: `speed_m_s` toward `toward_rad` (clockwise from north)."""

    __slots__ = ("_wind_m_s",)

    def __init__(self, speed_m_s: float, toward_rad: float) -> None:
        self._wind_m_s = (speed_m_s * math.cos(toward_rad), speed_m_s * math.sin(toward_rad))

    def at(self, time_s: float) -> tuple[float, float]:
        """Return the wind (north, east) in m/s."""
        del time_s
        return self._wind_m_s


class ArticleWind(msgspec.Struct, frozen=True):
    """The wind of the article's simulations.

    W(t) = 5 + 3 cos(0.1 t) m/s toward psi_w(t) = 135 deg + pi sin(0.1 t) rad: it turns by up to
    0.31 rad/s and swings through the whole circle every 63 s.
    """

    def at(self, time_s: float) -> tuple[float, float]:
        """Return the wind (north, east) in m/s at simulation time `time_s`."""
        speed_m_s = 5.0 + 3.0 * math.cos(0.1 * time_s)
        toward_rad = 0.75 * math.pi + math.pi * math.sin(0.1 * time_s)
        return speed_m_s * math.cos(toward_rad), speed_m_s * math.sin(toward_rad)


def followed_wind_m_s(
    known_m_s: tuple[float, float], wind_m_s: tuple[float, float], span_s: float
) -> tuple[float, float]:
    """Return an autopilot's wind estimate (north, east) after `span_s` in a wind: a first-order lag."""
    share = -math.expm1(-span_s / WIND_ESTIMATE_TIME_CONSTANT_S)
    (known_north, known_east), (north, east) = known_m_s, wind_m_s
    return known_north + share * (north - known_north), known_east + share * (east - known_east)


Turbulence = Literal["none", "light", "moderate", "severe"]
"""MIL-F-8785C's levels of turbulence."""


WIND_AT_20_FEET_M_S: dict[Turbulence, float] = {
    "none": 0.0,
    "light": 15.0 * KNOT_M_S,
    "moderate": 30.0 * KNOT_M_S,
    "severe": 45.0 * KNOT_M_S,
}
"""W20, the wind 20 feet above the ground, of each level."""


Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Intensity:
    """MIL-F-8785C's horizontal turbulence at one height: L_u = L_v, sigma_u = sigma_v."""

    length_m: float
    deviation_m_s: float


def low_altitude_intensity(level: Turbulence, height_m: float) -> Intensity:
    """Return MIL-F-8785C's length scale and standard deviation at a height above the ground.

    L = h / a^1.2 and sigma = 0.1 W20 / a^0.4 with a = 0.177 + 0.000823 h, h in feet.
    """
    height_ft = max(LOWEST_M, min(HIGHEST_M, height_m)) / FOOT_M
    share = 0.177 + 0.000823 * height_ft
    return Intensity(
        length_m=height_ft / share**1.2 * FOOT_M,
        deviation_m_s=0.1 * WIND_AT_20_FEET_M_S[level] / share**0.4,
    )


class TurbulenceField:
    """A frozen pattern of gusts that fills all space."""

    def __init__(self, intensity: Intensity, seed: int) -> None:
        """Draw the waves; the same seed gives the same gusts in every process."""
        random = default_rng((seed, 0x61_69_72))
        numbers = wave_numbers(intensity.length_m, random)
        directions = unit_vectors(random)
        # Gusts are perpendicular to their wave's direction: the field is divergence-free.
        sideways = np.cross(directions, unit_vectors(random))
        sideways /= np.linalg.norm(sideways, axis=1)[:, None]
        self._waves = numbers[:, None] * directions
        self._phases = random.uniform(0.0, 2.0 * math.pi, WAVES)
        # Three components have variance 3 sigma² in all; each wave contributes half its amplitude squared.
        amplitude = intensity.deviation_m_s * math.sqrt(6.0 / WAVES)
        self._gusts = amplitude * np.ascontiguousarray(sideways.T)

    def at(self, position_m: Vector) -> Vector:
        """Return the gusts at positions, m/s: (3,) or (3, N), in a frame that drifts and does not rotate."""
        phases = self._waves @ position_m
        offsets = self._phases if position_m.ndim == 1 else self._phases[:, None]
        gusts: Vector = self._gusts @ np.cos(phases + offsets)
        return gusts


def wave_numbers(length_m: float, random: Generator) -> Vector:
    """Draw wave numbers (rad/m) that share the energy evenly: one from each part of its distribution.

    With x = k L the share of the energy below x is (2/pi) (atan x - x (5 x² + 3) / (3 (1 + x²)²)).
    """
    longest = 2.0 * math.pi / SHORTEST_WAVE_M * length_m
    grid = np.concatenate([[0.0], np.geomspace(1e-3, longest, 4000)])
    squared = grid * grid
    below = (2.0 / math.pi) * (
        np.arctan(grid) - grid * (5.0 * squared + 3.0) / (3.0 * (1.0 + squared) ** 2)
    )
    share = (np.arange(WAVES) + random.uniform(0.0, 1.0, WAVES)) / WAVES
    numbers: Vector = np.interp(share * below[-1], below, grid) / length_m
    return numbers


def unit_vectors(random: Generator) -> Vector:
    """Draw a direction for each wave, evenly over the sphere, (N, 3)."""
    vectors = random.standard_normal((WAVES, 3))
    normalised: Vector = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return normalised


class AirPlace(msgspec.Struct, frozen=True):
    """A geodetic position."""

    latitude_rad: float
    longitude_rad: float
    altitude_m: float
    """Above mean sea level; used as the height above the ellipsoid."""
    height_m: float
    """Above the ground at home."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DiscreteGust:
    """A gust of shape (1 - cos) / 2: from zero to its peak (toward north, east) and back."""

    start_s: float
    length_s: float
    north_m_s: float
    east_m_s: float

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a number is out of its range.
        """
        whole = (self.start_s, self.length_s, self.north_m_s, self.east_m_s)
        if not all(map(math.isfinite, whole)) or self.start_s < 0.0 or self.length_s <= 0.0:
            raise ValueError(f"{self} is no gust")

    def at(self, time_s: float) -> tuple[float, float]:
        """Return the gust (north, east) at a simulation time, m/s."""
        share = (time_s - self.start_s) / self.length_s
        if not 0.0 < share < 1.0:
            return 0.0, 0.0
        shape = 0.5 * (1.0 - math.cos(2.0 * math.pi * share))
        return shape * self.north_m_s, shape * self.east_m_s


@dataclass(frozen=True, slots=True, kw_only=True)
class Shear:
    """Growth of the wind with height: W(h) = W(h0) ln(h / z0) / ln(h0 / z0)."""

    reference_m: float
    """h0, height above the ground at which the declared wind blows."""
    roughness_m: float = ROUGHNESS_M

    def factor(self, height_m: float) -> float:
        """Return the ratio of the wind at a height above the ground to the wind at the reference height."""
        heights = (max(height_m, LEAST_HEIGHT_M), max(self.reference_m, LEAST_HEIGHT_M))
        low, high = (math.log(height / self.roughness_m) for height in heights)
        return low / high


class Air(msgspec.Struct, frozen=True):
    """Mean wind with turbulence, discrete gusts and shear."""

    wind: Wind
    turbulence: TurbulenceField | None = None
    gusts: tuple[DiscreteGust, ...] = ()
    shear: Shear | None = None

    def near(self, place: AirPlace) -> Wind:
        """Return the wind at a place as a function of time alone, for one step of an integration."""
        if self.turbulence is None and not self.gusts and self.shear is None:
            return self.wind
        return LocalWind(self, place)

    def at(self, place: AirPlace, time_s: float) -> tuple[float, float]:
        """Return the wind (north, east) at a place and simulation time, m/s: the air's velocity."""
        north, east = self.wind.at(time_s)
        if self.shear is not None:
            factor = self.shear.factor(place.height_m)
            north, east = factor * north, factor * east
        for gust in self.gusts:
            more_north, more_east = gust.at(time_s)
            north, east = north + more_north, east + more_east
        if self.turbulence is not None:
            axes = local_axes(place)
            # A wind that turns has no one drift direction: its pattern stands still over the ground.
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
    """Return the air that a formation shares.

    Args:
        wind: mean wind at `height_m`.
        level: of the turbulence.
        height_m: height above the ground to which wind and turbulence refer.
        seed: of the turbulence.
        gusts: all of them, in any order.
        roughness_m: roughness length z0 of the wind shear, or None for none.
    """
    field = None
    if level != "none":
        field = TurbulenceField(low_altitude_intensity(level, height_m), seed)
    shear = None
    if roughness_m is not None:
        shear = Shear(reference_m=height_m, roughness_m=roughness_m)
    return Air(wind, field, gusts, shear)


class LocalWind(msgspec.Struct, frozen=True):
    """The air at one place, as a wind."""

    air: Air
    place: AirPlace

    def at(self, time_s: float) -> tuple[float, float]:
        """Return the wind (north, east) at simulation time `time_s`, m/s."""
        return self.air.at(self.place, time_s)


def local_axes(place: AirPlace) -> tuple[Vector, Vector]:
    """Return the north and east unit vectors at a place in the earth-centred, earth-fixed frame."""
    sine, cosine = math.sin(place.latitude_rad), math.cos(place.latitude_rad)
    east_sine, east_cosine = math.sin(place.longitude_rad), math.cos(place.longitude_rad)
    return (
        np.array([-sine * east_cosine, -sine * east_sine, cosine]),
        np.array([-east_sine, east_cosine, 0.0]),
    )


def earth_centred_m(place: AirPlace) -> Vector:
    """Return the place in the earth-centred, earth-fixed frame, which all processes share."""
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
