import math

import pytest

from vfguide.guidance.airspeed_calibration import Calibration, calibrated

PERIOD = 0.05


def flown(
    *,
    scale: float,
    turn_rate: float,
    seconds: float,
    wind_rate: float = 0.0,
    noise: float = 0.0,
    swing: float = 0.0,
) -> Calibration:
    """Reports of 20 m/s from an aircraft that flies `scale` times as fast, wind 4 m/s north, 3 m/s west."""
    known = Calibration()
    for step in range(round(seconds / PERIOD)):
        heading = turn_rate * step * PERIOD
        shake = noise * math.sin(1e4 * step) + swing * math.sin(0.3 * step * PERIOD)
        known = calibrated(
            known,
            reported_airspeed=20.0,
            heading=heading,
            turn_rate=turn_rate,
            velocity_north=scale * 20.0 * math.cos(heading) + 4.0 + shake,
            velocity_east=scale * 20.0 * math.sin(heading) - 3.0 - shake,
            wind_rate=wind_rate,
            period=PERIOD,
        )
    return known


@pytest.mark.parametrize("scale", [0.95, 1.0, 1.05, 1.1])
def test_after_two_circles_scale_and_wind_are_known(scale):
    known = flown(scale=scale, turn_rate=0.13, seconds=96.0, noise=0.2)
    assert known.scale == pytest.approx(scale, abs=0.01)
    assert known.estimate[1:3] == pytest.approx((4.0, -3.0), abs=0.3)
    assert known.deviation < 0.01


def test_on_a_straight_flight_a_wrong_scale_may_be_a_wind():
    known = flown(scale=1.05, turn_rate=0.0, seconds=120.0)
    assert known.scale == pytest.approx(1.0, abs=0.01)
    assert known.deviation > 0.04


def test_while_the_wind_changes_nothing_is_believed():
    known = flown(scale=1.05, turn_rate=0.13, seconds=96.0, wind_rate=1.5)
    assert known.deviation > 0.02


def test_what_cannot_be_is_not_used():
    for scale in (0.1, 3.0):
        known = flown(scale=scale, turn_rate=0.13, seconds=200.0)
        assert 0.85 <= known.scale <= 1.25
        assert not known.is_settled


def test_a_wind_that_swings_by_metres_a_second_is_no_steady_one():
    # 3 m/s at 0.3 rad/s, beside circles at 0.13 rad/s: a steady wind leaves 2 m/s of it unexplained.
    assert flown(scale=1.0, turn_rate=0.13, seconds=96.0).is_settled
    known = flown(scale=1.0, turn_rate=0.13, seconds=96.0, swing=3.0)
    assert not known.is_settled
    assert known.scale == pytest.approx(1.0, abs=0.03)
