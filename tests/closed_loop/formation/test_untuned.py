"""Formations of aircraft that nobody has tuned: five of the matrix of `tests/benchmarks/untuned.py`."""

import pytest

from tests.benchmarks.untuned import NEAR_M, SMOOTH, UntunedFlight, judge

DURATION_S = 110.0

SMOOTH_M, ROUGH_M = 1.5, 3.0
"""Greatest mean error of the second half, which here begins 55 s after the start."""


@pytest.mark.parametrize(
    ("aircraft", "air", "declared"),
    [
        ("lively", "rough", "unknown"),
        ("late", "article", "fast"),
        ("quick-to-bank", "still", "slow"),
        ("slow-to-bank", "still", "slow"),
        ("px4-trimmed", "rough", "fast"),
    ],
)
def test_an_aircraft_that_nobody_has_tuned_comes_to_its_slot_and_is_never_thrown(
    aircraft, air, declared
):
    flown = judge(
        UntunedFlight(aircraft=aircraft, air=air, declared=declared, duration_s=DURATION_S)
    )
    assert not flown.lost
    assert not flown.handed_back
    assert flown.min_separation_m > NEAR_M
    assert flown.mean_error_m < (SMOOTH_M if air in SMOOTH else ROUGH_M)
    assert flown.limited <= 0.2
