"""The gains of the baseline `pid`: a search on the calm missions, on the plant and limits they declare.

Run with `.venv/bin/python tests/benchmarks/tune_pid.py`; some minutes. Thousands of gains fly both missions
at once in the array form: first drawn at random over decades, then three times around the best of them.
What it prints last are the defaults in `vfguide/mission/controller.py`.
"""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.random import Generator, default_rng

from vfguide.bench.array_formation import fly_formations
from vfguide.bench.array_ground import Plane
from vfguide.bench.array_mission import conditions_of, start_of
from vfguide.bench.array_outcome import Watch
from vfguide.bench.tuning import CHATTER_RAD_S, ERROR_M, SETTLING_S, UNSETTLED
from vfguide.elementwise import FloatArray
from vfguide.guidance.settings import AxisGains, PidGains
from vfguide.mission import Mission, load_mission

MISSIONS = Path(__file__).parents[2] / "missions"
CALM = ("line-calm", "circle-calm")
DURATION_S = 120.0
CANDIDATES = 1024
SEED = 5

RANGES = {
    "lateral_p": (0.005, 0.3),
    "lateral_i": (1e-4, 0.05),
    "lateral_d": (1e-3, 0.3),
    "longitudinal_p": (0.05, 3.0),
    "longitudinal_i": (1e-3, 0.5),
    "longitudinal_d": (0.01, 3.0),
}
"""Of the first draw; evenly spread in the logarithm."""

NARROWER = (1.8, 1.35, 1.15)
"""Factors around the best within which the later draws lie."""

Gains = dict[str, FloatArray]


def mission_of(name: str) -> Mission:
    """A calm mission, flown by PID."""
    content = load_mission(MISSIONS / f"{name}.yaml").model_dump(exclude_unset=True)
    content["rehearsal"]["duration_s"] = DURATION_S
    content["controller"] = {"type": "pid"}
    return Mission.model_validate(content)


def drawn(random: Generator, centre: Gains | None, factor: float) -> Gains:
    """Candidates: over the whole ranges, or within a factor of a centre, itself the first of them."""
    gains = {}
    for name, (lowest, highest) in RANGES.items():
        if centre is None:
            gains[name] = np.exp(random.uniform(math.log(lowest), math.log(highest), CANDIDATES))
        else:
            spread = factor ** random.uniform(-1.0, 1.0, CANDIDATES)
            spread[0] = 1.0
            gains[name] = centre[name] * spread
    return gains


def cost(gains: Gains) -> FloatArray:
    """Cost of each candidate over both missions: `vfguide.bench.tuning`, on arrays."""
    total = np.zeros(CANDIDATES)
    for name in CALM:
        mission = mission_of(name)
        conditions = replace(conditions_of(mission, Plane(), rounded=True), calibrates=False)
        chosen = conditions.settings.pid
        assert chosen is not None
        axes = {
            axis: AxisGains(
                proportional=gains[f"{axis}_p"],
                integral=gains[f"{axis}_i"],
                derivative=gains[f"{axis}_d"],
                derivative_filter_s=getattr(chosen, axis).derivative_filter_s,
                greatest=np.full(CANDIDATES, getattr(chosen, axis).greatest),
            )
            for axis in ("lateral", "longitudinal")
        }
        watch = Watch(DURATION_S)
        fly_formations(start_of(mission, CANDIDATES, pid=PidGains(**axes)), conditions, watch)
        outcome = watch.outcome()
        value = outcome.mean_error_m / ERROR_M + outcome.settle_1m_s / SETTLING_S
        value += outcome.chatter_rad_s / CHATTER_RAD_S
        total += np.where(np.isfinite(value), value, UNSETTLED)
    return total


def main() -> None:
    """Search and print."""
    random = default_rng(SEED)
    best: Gains | None = None
    for factor in (math.inf, *NARROWER):
        gains = drawn(random, best, factor)
        costs = cost(gains)
        order = np.argsort(costs)
        sys.stdout.write(f"within a factor of {factor}: {np.mean(costs < UNSETTLED):.0%} settle\n")
        for index in order[:5]:
            figures = "  ".join(f"{name} {gains[name][index]:.3g}" for name in RANGES)
            sys.stdout.write(f"{costs[index]:8.3f}  {figures}\n")
        sys.stdout.flush()
        best = {name: values[order[:1]] for name, values in gains.items()}


if __name__ == "__main__":
    main()
