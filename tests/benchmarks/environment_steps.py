"""How many steps an environment flies in a second of one core.

Processor time is counted:
what else runs on the machine changes little.
"""

import time

import numpy as np

import vfguide
from tests.benchmarks.results import Cases
from tests.kit.missions import MISSIONS

NAME = "circle-wind"
FLIGHT = {"duration_s": 40.0, "rate_hz": 10.0, "actions": "setpoints"}
RUNS = 3


def steps_a_second(follower: str | None) -> tuple[float, float]:
    """(steps a second, s to reset) in processor time; the best of the runs."""
    mission = vfguide.load_mission(MISSIONS / f"{NAME}.yaml")
    flown = vfguide.environment(mission, follower=follower, **FLIGHT)
    formation = flown if follower is None else flown.formation
    rates, resets = [], []
    for _ in range(RUNS):
        began = time.process_time()
        formation.reset(seed=1)
        resets.append(time.process_time() - began)
        began, steps = time.process_time(), 0
        while formation.agents:
            # As the slot flies: everybody stays near everybody.
            formation.step(dict.fromkeys(formation.agents, np.zeros(2)))
            steps += 1
        rates.append(steps / (time.process_time() - began))
    return max(rates), min(resets)


def cases() -> Cases:
    """Measure the environment of a formation, and that of one follower."""
    for name, follower in (("three", None), ("one", "f2")):
        rate, reset_s = steps_a_second(follower)
        yield name, {"steps_a_second": rate, "reset_s": reset_s}
