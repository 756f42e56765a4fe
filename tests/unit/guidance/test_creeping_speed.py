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


@given(st.lists(st.floats(8.0, 22.0), min_size=1, max_size=60))
def test_nothing_is_asked_for_beyond_the_limits_and_what_they_leave_is_flown(wanted):
    speed, plant, limits = CreepingSpeed(HOLD), Plant(15.0), {"slowest": 11.0, "fastest": 19.0}
    for number, one in enumerate(wanted):
        asked = speed.asked_for(one, plant.airspeed, number * PERIOD_S, **limits)
        plant.fly(asked)
        assert 11.0 <= asked <= 19.0
        if 11.0 < asked < 19.0:
            assert plant.airspeed == pytest.approx(one)


@pytest.mark.parametrize(
    ("reset", "then", "asked"),
    [
        pytest.param(True, (16.0, 16.0, 50.0), 16.0, id="another has flown it"),
        # The trim comes to what was asked for, and not beyond.
        pytest.param(False, (17.0, 16.0, 1000.0), 17.0, id="a gap"),
    ],
)
def test_after_another_or_a_gap_the_airspeed_of_then_counts(reset, then, asked):
    speed, limits = CreepingSpeed(HOLD), {"slowest": 5.0, "fastest": 40.0}
    assert speed.asked_for(16.0, 15.0, 0.0, **limits) == pytest.approx(17.0)
    if reset:
        speed.reset()
    assert speed.asked_for(*then, **limits) == pytest.approx(asked)
