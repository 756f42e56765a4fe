"""Gusts as the standards describe them, in one field that all aircraft of a formation fly through.

Dryden's spectra with the lengths and intensities that MIL-F-8785C gives for low altitudes. The standard tells
what one aircraft meets along its way. Here the gusts are a frozen pattern that drifts with the wind: a sum of
plane waves, isotropic and without divergence, whose energy spectrum is the one from which both of Dryden's
spectra follow (Batchelor, The Theory of Homogeneous Turbulence, 1953):

    E(k) = (8 sigma² L / pi) (k L)^4 / (1 + (k L)²)^3
    along the way f(r) = exp(-r / L), across it g(r) = (1 - r / (2 L)) exp(-r / L)

So neighbours share what they share in real air. The waves come from the seed alone: separate processes see
the same field. Sum of waves: Kraichnan, "Diffusion by a random velocity field", Physics of Fluids 13, 1970.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import NDArray

Turbulence = Literal["none", "light", "moderate", "severe"]
"""MIL-F-8785C's levels."""

KNOT_M_S = 0.514444
FOOT_M = 0.3048

WIND_AT_20_FEET_M_S: dict[Turbulence, float] = {
    "none": 0.0,
    "light": 15.0 * KNOT_M_S,
    "moderate": 30.0 * KNOT_M_S,
    "severe": 45.0 * KNOT_M_S,
}
"""W20, the wind 20 feet above the ground, that stands for each level."""

LOWEST_M, HIGHEST_M = 10.0 * FOOT_M, 1000.0 * FOOT_M
"""Heights for which the low-altitude model is meant; below and above, that of the end."""

WAVES = 384
"""Plane waves of a field."""

SHORTEST_WAVE_M = 4.0
"""About twice the span of a small aircraft: shorter waves cancel out over its wings."""

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Intensity:
    """What the standard says about the horizontal gusts at one height."""

    length_m: float
    """L_u = L_v."""
    deviation_m_s: float
    """sigma_u = sigma_v."""


def low_altitude_intensity(level: Turbulence, height_m: float) -> Intensity:
    """MIL-F-8785C: L = h / a^1.2 and sigma = 0.1 W20 / a^0.4 with a = 0.177 + 0.000823 h, h in feet.

    Args:
        level: of the turbulence.
        height_m: above the ground.
    """
    height_ft = max(LOWEST_M, min(HIGHEST_M, height_m)) / FOOT_M
    share = 0.177 + 0.000823 * height_ft
    return Intensity(
        length_m=height_ft / share**1.2 * FOOT_M,
        deviation_m_s=0.1 * WIND_AT_20_FEET_M_S[level] / share**0.4,
    )


class TurbulenceField:
    """A frozen pattern of gusts in the whole of space."""

    def __init__(self, intensity: Intensity, seed: int) -> None:
        """Draw the waves.

        Args:
            intensity: of the gusts.
            seed: of the field; the same one gives the same gusts everywhere.
        """
        random = default_rng((seed, 0x61_69_72))
        numbers = wave_numbers(intensity.length_m, random)
        directions = unit_vectors(random)
        # A gust of a wave is at right angles to its direction: the air does not pile up.
        sideways = np.cross(directions, unit_vectors(random))
        sideways /= np.linalg.norm(sideways, axis=1)[:, None]
        self._waves = numbers[:, None] * directions
        self._phases = random.uniform(0.0, 2.0 * math.pi, WAVES)
        # Three components of variance sigma² in all, each wave with half its amplitude squared.
        amplitude = intensity.deviation_m_s * math.sqrt(6.0 / WAVES)
        self._gusts = amplitude * np.ascontiguousarray(sideways.T)

    def at(self, position_m: Vector) -> Vector:
        """Gusts at positions, m/s: vectors of three, as the positions in any frame that does not turn.

        Args:
            position_m: three coordinates, or (3, N) of them, in a frame that drifts with the wind.
        """
        phases = self._waves @ position_m
        offsets = self._phases if position_m.ndim == 1 else self._phases[:, None]
        gusts: Vector = self._gusts @ np.cos(phases + offsets)
        return gusts


def wave_numbers(length_m: float, random: Generator) -> Vector:
    """Wave numbers (rad/m) that share the energy evenly: one from each part of its distribution.

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
    """Directions spread evenly over the sphere, one for each wave, (N, 3)."""
    vectors = random.standard_normal((WAVES, 3))
    normalised: Vector = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    return normalised
