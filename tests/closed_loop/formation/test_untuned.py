"""Formations of aircraft that nobody has tuned: five of the matrix of `tests/benchmarks/untuned.py`."""

import pytest

from tests.benchmarks.untuned import NEAR_M, SMOOTH, UntunedFlight, judge

SMOOTH_M, ROUGH_M = 1.5, 3.0
"""Greatest mean error of the second half."""


@pytest.mark.parametrize(
    ("aircraft", "air", "declared", "duration_s"),
    [
        ("lively", "rough", "unknown", 80.0),
        ("late", "article", "fast", 80.0),
        ("quick-to-bank", "still", "slow", 80.0),
        # Found out later than the others.
        ("slow-to-bank", "still", "slow", 110.0),
        ("px4-trimmed", "rough", "fast", 110.0),
    ],
)
def test_an_aircraft_that_nobody_has_tuned_comes_to_its_slot_and_is_never_thrown(
    aircraft, air, declared, duration_s
):
    flown = judge(
        UntunedFlight(aircraft=aircraft, air=air, declared=declared, duration_s=duration_s)
    )
    assert not flown.lost
    assert not flown.handed_back
    assert flown.min_separation_m > NEAR_M
    assert flown.mean_error_m < (SMOOTH_M if air in SMOOTH else ROUGH_M)
    assert flown.limited <= 0.2
