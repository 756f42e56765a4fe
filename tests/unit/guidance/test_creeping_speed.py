"""What a hold is asked for that goes a part of the way to a new airspeed at once, and creeps on."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.guidance.air_data import CreepingHold, CreepingSpeed

HOLD = CreepingHold(share=0.5, time=40.0)
PERIOD_S = 0.1


class Plant:
    """A hold that does just that, at once."""

    def __init__(self, airspeed: float) -> None:
        self.trim = self.airspeed = airspeed

    def fly(self, asked: float) -> None:
        self.airspeed = self.trim + HOLD.share * (asked - self.trim)
        self.trim += (asked - self.trim) * PERIOD_S / HOLD.time


def flown(
    wanted: list[float], *, slowest: float, fastest: float
) -> tuple[list[float], list[float]]:
    """(airspeeds, what was asked for), m/s, a period after another, from 15 m/s on."""
    speed, plant = CreepingSpeed(HOLD), Plant(15.0)
    airspeeds, asked = [], []
    for number, one in enumerate(wanted):
        now = number * PERIOD_S
        asked.append(speed.asked_for(one, plant.airspeed, now, slowest=slowest, fastest=fastest))
        plant.fly(asked[-1])
        airspeeds.append(plant.airspeed)
    return airspeeds, asked


@given(st.lists(st.floats(8.0, 22.0), min_size=1, max_size=60))
def test_nothing_is_asked_for_beyond_the_limits_and_what_they_leave_is_flown(wanted):
    airspeeds, asked = flown(wanted, slowest=11.0, fastest=19.0)
    for one, airspeed, setpoint in zip(wanted, airspeeds, asked, strict=True):
        assert 11.0 <= setpoint <= 19.0
        if 11.0 < setpoint < 19.0:
            assert airspeed == pytest.approx(one)


def test_after_another_has_flown_it_the_airspeed_of_then_counts():
    speed = CreepingSpeed(HOLD)
    limits = {"slowest": 5.0, "fastest": 40.0}
    assert speed.asked_for(16.0, 15.0, 0.0, **limits) == pytest.approx(17.0)
    speed.reset()
    assert speed.asked_for(16.0, 16.0, 50.0, **limits) == pytest.approx(16.0)


def test_a_gap_brings_the_trim_to_what_was_asked_for_and_not_beyond():
    speed = CreepingSpeed(HOLD)
    limits = {"slowest": 5.0, "fastest": 40.0}
    assert speed.asked_for(16.0, 15.0, 0.0, **limits) == pytest.approx(17.0)
    assert speed.asked_for(17.0, 16.0, 1000.0, **limits) == pytest.approx(17.0)
