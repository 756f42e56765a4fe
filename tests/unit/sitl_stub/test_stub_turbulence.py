"""The turbulence against the formulas of the standard it is made from."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from sitl_stub.air import (
    SHORTEST_WAVE_M,
    Intensity,
    TurbulenceField,
    low_altitude_intensity,
    wave_numbers,
)

FIELDS = 300
"""Over so many seeds an average is good to some percent."""

INTENSITY = Intensity(length_m=200.0, deviation_m_s=2.0)


@pytest.fixture(scope="module")
def fields() -> list[TurbulenceField]:
    """Fields of many seeds."""
    return [TurbulenceField(INTENSITY, seed) for seed in range(FIELDS)]


def covariances(
    fields: list[TurbulenceField], distances_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Covariance of (along, across, across) at the first of some points on the x axis with all of them."""
    points = np.zeros((3, distances_m.size))
    points[0] = distances_m
    total = np.zeros((3, distances_m.size))
    # Every field at eight places far from each other, as good as eight fields.
    for field in fields:
        for place in range(8):
            gusts = field.at(points + 4000.0 * place)
            total += gusts * gusts[:, :1]
    return total / (8 * len(fields))


@pytest.mark.parametrize(
    ("level", "height_m", "length_ft", "deviation_kn", "within"),
    [
        # h = 328.08 ft, a = 0.44701: L = 328.08 / 0.38050 = 862.2 ft, sigma = 3.0 kn / 0.72466.
        ("moderate", 100.0, 862.2, 4.140, 1e-3),
        # Above the model its upper end holds: at 1000 ft a is 1, L = 1000 ft and sigma = 0.1 W20.
        ("severe", 2000.0, 1000.0, 4.5, 1e-6),
    ],
)
def test_turbulence_is_that_of_the_standard(level, height_m, length_ft, deviation_kn, within):
    intensity = low_altitude_intensity(level, height_m)
    assert intensity.length_m == pytest.approx(length_ft * 0.3048, rel=within)
    assert intensity.deviation_m_s == pytest.approx(deviation_kn * 0.514444, rel=within)


def test_light_and_severe_are_half_and_one_and_a_half_of_moderate():
    light, moderate, severe = (
        low_altitude_intensity(level, 60.0).deviation_m_s
        for level in ("light", "moderate", "severe")
    )
    assert (light, severe) == pytest.approx((0.5 * moderate, 1.5 * moderate))


def test_each_component_has_the_variance_of_the_standard(fields):
    variance = covariances(fields, np.zeros(1))[:, 0]
    assert variance == pytest.approx([4.0, 4.0, 4.0], rel=0.06)


@pytest.mark.parametrize("distance_m", [20.0, 60.0, 200.0, 400.0])
def test_gusts_along_and_across_the_way_correlate_as_drydens_do(fields, distance_m):
    share = math.exp(-distance_m / 200.0)
    across = (1.0 - distance_m / 400.0) * share
    along_m, right_m, up_m = covariances(fields, np.array([0.0, distance_m]))[:, 1]
    assert along_m / 4.0 == pytest.approx(share, abs=0.06)
    assert right_m / 4.0 == pytest.approx(across, abs=0.06)
    assert up_m / 4.0 == pytest.approx(across, abs=0.06)


def test_along_the_way_the_spectrum_is_drydens(fields):
    # Averaged over an octave about each wave number; 2 sigma² L / pi / (1 + (L k)²), one-sided.
    step_m, count = 10.0, 2048
    points = np.zeros((3, count))
    points[0] = step_m * np.arange(count)
    power = np.zeros(count // 2 + 1)
    window = np.hanning(count)
    for field in fields[:120]:
        power += np.abs(np.fft.rfft(window * field.at(points)[0])) ** 2
    scale = step_m / (math.pi * np.sum(window**2)) / 120
    numbers = 2.0 * math.pi * np.fft.rfftfreq(count, step_m)
    for low in (0.003, 0.01, 0.03):
        band = (numbers >= low) & (numbers < 2.0 * low)
        wanted = np.mean(2.0 * 4.0 * 200.0 / math.pi / (1.0 + (200.0 * numbers[band]) ** 2))
        assert np.mean(power[band]) * scale == pytest.approx(wanted, rel=0.2)


def test_air_does_not_pile_up():
    field, step_m = TurbulenceField(INTENSITY, 3), 0.01
    rng = np.random.default_rng(1)
    for centre in rng.uniform(-1e4, 1e4, (20, 3)):
        slopes = [
            (field.at(centre + offset)[axis] - field.at(centre - offset)[axis]) / (2 * step_m)
            for axis, offset in enumerate(step_m * np.eye(3))
        ]
        assert abs(sum(slopes)) < 1e-6
        assert max(map(abs, slopes)) > 1e-3


@given(seed=st.integers(0, 2**32 - 1), length_m=st.floats(20.0, 400.0))
def test_no_wave_is_shorter_than_an_aircraft_feels(seed, length_m):
    numbers = wave_numbers(length_m, np.random.default_rng(seed))
    assert np.all(np.diff(numbers) >= 0.0)
    assert numbers[0] > 0.0
    assert numbers[-1] <= 2.0 * math.pi / SHORTEST_WAVE_M * (1.0 + 1e-9)
