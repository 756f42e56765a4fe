"""Followers whose path a lost vehicle crosses climb over it: their leader, and a neighbour 10 m away."""

import numpy as np
import pytest

from tests.benchmarks.strays import LEAST_M
from tests.benchmarks.succession import figures, flown
from tests.kit.flight import fly
from tests.kit.missions import content_of, in_place
from vfguide.mission import Mission

RATE_HZ = 10.0
"""Half the shipped rate, in half the time."""

LEFT_M = 5.0
"""No follower leaves its slot by more, level."""

LED_S = 1.5
"""A deputy leads by then."""

LAYER_M = 20.0
"""So high is climbed over the lost one."""


@pytest.mark.parametrize("turbulence", ["none", "moderate"])
@pytest.mark.parametrize("name", ["circle-wind", "line-wind"])
def test_all_keep_their_slots_when_the_leaders_companion_is_killed(name, turbulence):
    # On the circle downwind, where the leader's aircraft crosses the outer follower's way soonest.
    lost_s = 54.0 if name == "circle-wind" else 24.0
    flight = flown(name, turbulence, lost_s, may_stop=False, rate_hz=RATE_HZ)
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


@pytest.mark.parametrize("lost_s", [46.0, 52.0])
def test_a_neighbour_ten_metres_away_that_is_lost_in_a_turn_is_climbed_over(lost_s):
    # Each to the left behind the next, on a circle to the right: who flies straight on crosses their way.
    content = content_of("circle-wind")
    for number, follower in enumerate(content["followers"], 1):
        follower["slot"] = {"forward_m": -7.0 * number, "right_m": -7.0 * number}
    loss = {"vehicle": "f1", "at_s": lost_s}
    content["rehearsal"] |= {"duration_s": lost_s + 12.0, "start": {}, "losses": [loss]}
    content["rehearsal"]["rate_hz"] = RATE_HZ
    assert fly(Mission.model_validate(content)).nearest(lost_s) >= LEAST_M


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_a_pilot_takes_a_follower_for_a_while_and_gives_it_back(autopilot):
    taken = {"vehicle": "f1", "at_s": 8.0, "for_s": 6.0, "what": "guidance"}
    content = content_of(in_place("line-calm", duration_s=70.0, rate_hz=RATE_HZ, losses=[taken]))
    for vehicle in content["vehicles"].values():
        vehicle["autopilot"] = autopilot
    flown = fly(Mission.model_validate(content))
    # It circles meanwhile, and is in its slot again afterwards.
    assert flown.errors(6.1, 7.9)[0].max() < 2.0
    assert 100.0 < flown.errors()[0].max() < 500.0
    assert flown.errors()[0][-1] < 1.0
