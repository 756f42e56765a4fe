import pytest

from vfguide.mavlink.backoff import reconnect_delay


def test_delays_double_from_a_fifth_of_a_second_to_five() -> None:
    # With the largest share, the whole of each delay.
    delays = [reconnect_delay(failures, 1.0) for failures in range(1, 9)]
    assert delays == pytest.approx([0.2, 0.4, 0.8, 1.6, 3.2, 5.0, 5.0, 5.0])


@pytest.mark.parametrize("failures", [1, 3, 8])
def test_chance_takes_away_up_to_half(failures: int) -> None:
    whole = reconnect_delay(failures, 1.0)
    assert reconnect_delay(failures, 0.0) == pytest.approx(0.5 * whole)
    assert reconnect_delay(failures, 0.5) == pytest.approx(0.75 * whole)


@pytest.mark.parametrize("failures", [-1, 0])
def test_no_failure_waits_as_long_as_one(failures: int) -> None:
    assert reconnect_delay(failures, 0.3) == reconnect_delay(1, 0.3)


def test_years_of_failures_wait_no_longer() -> None:
    assert reconnect_delay(10**9, 1.0) == 5.0
