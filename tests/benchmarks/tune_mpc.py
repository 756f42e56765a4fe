"""The weights of the baseline `mpc`: a search on the calm missions, on the plant and limits they declare.

Run with `.venv/bin/python tests/benchmarks/tune_mpc.py`; some minutes on two processors. One follower,
that with the longest way, flies for each candidate: first over a grid, then over a finer one around the best
of it. The best of what it prints last is the default in `vfguide/mission/controller.py`.
"""

import os
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import product
from pathlib import Path

from vfguide.bench.tuning import cost_of
from vfguide.mission import Mission, load_mission
from vfguide.rehearsal.lockstep import fly_lockstep
from vfguide.report.metrics import summarise

MISSIONS = Path(__file__).parents[2] / "missions"
CALM = ("line-calm", "circle-calm")
DURATION_S = 60.0
FOLLOWER = "f3"

Weights = tuple[float, float, float, int]
"""Velocity weight, acceleration weight, horizon in s, intervals."""

VELOCITIES = (0.1, 0.5, 2.0, 5.0)
ACCELERATIONS = (0.02, 0.1, 0.5, 2.0)
HORIZONS = ((2.0, 14), (4.0, 27))
"""s, and into how many intervals."""
FINER = (0.6, 1.0, 1.7)


def mission_with(name: str, weights: Weights) -> Mission:
    """A calm mission, flown by the predictive controller with these weights."""
    content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
    content["rehearsal"]["duration_s"] = DURATION_S
    content["followers"] = [one for one in content["followers"] if one["vehicle"] == FOLLOWER]
    leader = content["leader"]["vehicle"]
    for absent in content["vehicles"].keys() - {leader, FOLLOWER}:
        del content["vehicles"][absent], content["rehearsal"]["start"][absent]
    velocity, acceleration, horizon, intervals = weights
    content["controller"] = {
        "type": "mpc",
        "mpc": {
            "velocity_weight_s2": velocity,
            "acceleration_weight_s4": acceleration,
            "horizon_s": horizon,
            "intervals": intervals,
        },
    }
    return Mission.model_validate(content)


def cost(weights: Weights) -> float:
    """Cost of these weights over both calm missions."""
    return sum(
        cost_of(summarise(fly_lockstep(mission_with(name, weights)).record)) for name in CALM
    )


def best_of(candidates: Iterable[Weights], pool: ProcessPoolExecutor) -> Weights:
    """The cheapest, all of them printed."""
    tried = list(candidates)
    costs = list(pool.map(cost, tried))
    for weights, value in sorted(zip(tried, costs, strict=True), key=lambda pair: pair[1]):
        velocity, acceleration, horizon, intervals = weights
        sys.stdout.write(
            f"{value:8.3f}  velocity {velocity:.3g}  acceleration {acceleration:.3g}  "
            f"horizon {horizon:.3g} s  intervals {intervals}\n"
        )
    sys.stdout.write("\n")
    sys.stdout.flush()
    return tried[costs.index(min(costs))]


def main() -> None:
    """Search and print."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        grid = product(VELOCITIES, ACCELERATIONS, HORIZONS)
        best = best_of(((v, a, h, n) for v, a, (h, n) in grid), pool)
        velocity, acceleration, horizon, intervals = best
        finer = product(FINER, FINER)
        best_of(((velocity * v, acceleration * a, horizon, intervals) for v, a in finer), pool)


if __name__ == "__main__":
    main()
