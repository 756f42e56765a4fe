"""Followers keep their slots while their leader is lost: one whose path it crosses climbs over it."""

import numpy as np
import pytest

from tests.benchmarks.strays import LEAST_M
from tests.benchmarks.succession import figures, flown

LEFT_M = 5.0
"""No follower leaves its slot by more, level."""

LED_S = 1.5
"""A deputy leads by then."""

LAYER_M = 20.0
"""So high is climbed over the lost one."""


@pytest.mark.parametrize("turbulence", ["none", "moderate"])
@pytest.mark.parametrize("name", ["circle-wind", "line-wind"])
def test_all_keep_their_slots_when_the_leaders_companion_is_killed(
    name: str, turbulence: str
) -> None:
    # Downwind, where the leader's aircraft crosses the outer follower's way soonest.
    lost_s = 54.0
    flight = flown(name, turbulence, lost_s, may_stop=False)
    led_s, _, _, left_m, nearest_m = figures(flight, lost_s)
    assert led_s <= LED_S
    assert left_m < LEFT_M
    assert nearest_m >= LEAST_M
    f1 = flight.record.followers[0]
    climbed_m = float(np.ptp(f1.altitude_amsl_m))
    # On a line the leader's aircraft flies on in its own lane, unless gusts carry it out of that.
    if name == "circle-wind":
        assert climbed_m == pytest.approx(LAYER_M, abs=1.0)
    elif turbulence == "none":
        assert climbed_m == pytest.approx(0.0, abs=1.0)
