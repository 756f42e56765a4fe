"""Nobody under guidance comes within 5 m of anybody who is heard, whatever pilots and companions do."""

import math

import pytest

from tests.benchmarks.separation import fly
from tests.benchmarks.strays import LEAST_M, Event, Strays, approaches, mission_in_place

FROM_S = 12.0
"""By then everybody who started in the slot has settled."""

AFTERWARDS_S = 10.0
"""Vehicles that were away are on their way back by then, through the others."""

RATE_HZ = 10.0
"""Half the shipped rate: companions look around half as often, and a flight takes half the time."""

LEVEL_M = 4.0
"""In the plane alone, where they are not a layer apart."""

LAYER_M = 15.0
"""So much height apart two may cross in the plane: avoidance steps by 20 m."""

ONCE_NEAR = (44, 414, 609, 927)
"""Three autopilots that hang in a turn, a leader handed back across another: once 2.8, 4.1, 3.7 and 4.6 m."""

CASES = {
    "the leader goes home, and a follower after it": (
        Event(15.0, "RTL", "leader"),
        Event(25.0, "RTL", "f1"),
    ),
    "a follower goes home": (Event(20.0, "RTL", "f1"),),
    "a follower lies about its place": (
        Event(14.0, "LOITER", "f3"),
        Event(16.0, "lies", "f2", -22.0),
        Event(22.0, "GUIDED", "f3"),
        Event(30.0, "honest", "f2"),
    ),
    "a companion is killed and restarted": (
        Event(15.0, "killed", "f2"),
        Event(20.0, "restarted", "f2"),
    ),
    "a pilot loiters for ten seconds": (Event(15.0, "LOITER", "f1"), Event(25.0, "GUIDED", "f1")),
    "the leader's autopilot hangs": (
        Event(15.0, "frozen", "leader"),
        Event(20.0, "thawed", "leader"),
    ),
}
SLOW = tuple(CASES)[3:]
"""Those that were flown on real autopilots that slip and lag."""


@pytest.mark.parametrize(
    ("mission", "case"),
    [(name, case) for name in ("circle-wind", "line-wind") for case in CASES]
    + [("ardupilot-sitl", case) for case in SLOW],
)
def test_nobody_under_guidance_comes_near(mission, case):
    chosen, events = mission_in_place(mission, rate_hz=RATE_HZ), CASES[case]
    record = Strays(chosen, events).fly(events[-1].time_s + AFTERWARDS_S).record
    found = approaches(chosen, record, events, from_s=FROM_S)
    assert len(found) >= 5
    near = [
        one
        for one in found
        if one.distance_m < LEAST_M
        or (one.level_m < LEVEL_M and one.distance_m < math.hypot(one.level_m, LAYER_M))
    ]
    assert near == []


@pytest.mark.parametrize("number", [*range(0, 40, 4), *ONCE_NEAR])
def test_nobody_comes_near_on_a_flight_of_strays(number):
    usual = {} if number in ONCE_NEAR else {"rate_hz": RATE_HZ}
    nearest = fly(number, AFTERWARDS_S, **usual).nearest
    assert nearest.unavoidable or nearest.distance_m >= LEAST_M
