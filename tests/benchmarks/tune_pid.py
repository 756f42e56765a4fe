"""The gains of the baseline `pid`: a search on the calm missions, by the rule of `studies.tuning`.

Run with `.venv/bin/python tests/benchmarks/tune_pid.py`; some minutes. Thousands of gains fly both missions
at once in the array form: first drawn at random over decades, then again and again around the best of them.
The first of what it prints last are the defaults in `vfguide/laws/pid.py`.
"""

import math
import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from numpy.random import Generator, default_rng

from vfguide.elementwise import FloatArray
from vfguide.lab.studies.tuning import CALM, Trials, fly_trials, ranked, trial_line

CANDIDATES = 1024
SEED = 5

RANGES = {
    "lateral_p_rad_m": (0.005, 0.3),
    "lateral_i_rad_m_s": (1e-4, 0.3),
    "lateral_d_rad_s_m": (1e-3, 0.3),
    "longitudinal_p_1_s": (0.05, 5.0),
    "longitudinal_i_1_s2": (1e-3, 3.0),
    "longitudinal_d": (0.01, 5.0),
}
"""Of the first draw; evenly spread in the logarithm."""

NARROWER = (2.5, 2.0, 1.6, 1.6, 1.4, 1.4, 1.2, 1.1)
"""Factors around the best within which the later draws lie."""

Gains = dict[str, FloatArray]


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


def flown(task: tuple[str, Gains]) -> Trials:
    """One mission by all candidates."""
    name, gains = task
    return fly_trials(name, "pid", CANDIDATES, gains=gains)


def main() -> None:
    """Search and print."""
    random = default_rng(SEED)
    best: Gains | None = None
    with ProcessPoolExecutor(len(CALM)) as pool:
        for factor in (math.inf, *NARROWER):
            gains = drawn(random, best, factor)
            trials = list(pool.map(flown, [(name, gains) for name in CALM]))
            order = ranked(trials)
            settled = np.mean(np.all([np.isfinite(one.settle_1m_s) for one in trials], axis=0))
            sys.stdout.write(
                f"within a factor of {factor}: {settled:.0%} settle, {len(order)} admitted\n"
            )
            for index in order[:3]:
                figures = "  ".join(f"{name} {gains[name][index]:.3g}" for name in RANGES)
                sys.stdout.write(f"{figures}\n  {trial_line(trials, index)}\n")
            sys.stdout.flush()
            if order:
                best = {name: values[order[:1]] for name, values in gains.items()}


if __name__ == "__main__":
    main()
