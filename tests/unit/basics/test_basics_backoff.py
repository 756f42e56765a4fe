import pytest

from vfguide.backoff import retry_delay


@pytest.mark.parametrize("failures", [1, 3, 8])
def test_chance_takes_away_up_to_half(failures):
    whole = retry_delay(failures, 1.0)
    assert retry_delay(failures, 0.0) == pytest.approx(0.5 * whole)
    assert retry_delay(failures, 0.5) == pytest.approx(0.75 * whole)


@pytest.mark.parametrize("failures", [-1, 0])
def test_no_failure_waits_as_long_as_one(failures):
    assert retry_delay(failures, 0.3) == retry_delay(1, 0.3)
