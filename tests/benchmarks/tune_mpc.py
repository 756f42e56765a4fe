"""The weights of the baseline `mpc`: a search on the calm missions, by the rule of `studies.tuning`.

Run with `.venv/bin/python tests/benchmarks/tune_mpc.py`; ten minutes on two processors. First over a grid,
then up and down from the best, each weight and the integral's time alone. How far it looks makes no
difference to who is in place, the programme's end being weighed by the regulator's cost; it is chosen last,
by the settling time. The first of what it prints last is the default in `vfguide/laws/mpc.py`.
"""

import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np

from vfguide.lab.studies.tuning import CALM, Trials, fly_trials, ranked, trial_line
from vfguide.laws.mpc import MpcGains

INTERVAL_S = 1.0 / 7.0
"""Of constant acceleration."""

VELOCITIES = (0.03, 0.3)
ACCELERATIONS = (0.0005, 0.002, 0.008)
INTEGRALS = (0.0, 0.5, 1.0)
"""s; 0: none."""
HORIZON_S = 2.0
HORIZONS_S = (1.0, 2.0, 3.0, 4.0)
"""Tried with the weights that were found with the one before."""

NARROWER = (2.0, 1.5, 1.5, 1.25)
"""Factors by which weights and times are varied around the best."""


def weights_of(velocity: float, acceleration: float, integral_s: float) -> MpcGains:
    """One candidate of the grid."""
    return looking(
        MpcGains(
            horizon_s=HORIZON_S,
            velocity_weight_s2=velocity,
            acceleration_weight_s4=acceleration,
            integral_s=integral_s,
        ),
        HORIZON_S,
    )


def looking(weights: MpcGains, horizon_s: float) -> MpcGains:
    """The same, looking this far ahead."""
    intervals = round(horizon_s / INTERVAL_S)
    return weights.model_copy(update={"horizon_s": intervals * INTERVAL_S, "intervals": intervals})


def around(best: MpcGains, factor: float) -> list[MpcGains]:
    """The best, and up and down from it."""
    candidates = [best]
    for one in (factor, 1.0 / factor):
        for name in ("velocity_weight_s2", "acceleration_weight_s4", "integral_s"):
            value = getattr(best, name)
            if value > 0.0:
                candidates.append(best.model_copy(update={name: value * one}))
    return candidates


def flown(task: tuple[str, Sequence[MpcGains]]) -> Trials:
    """One mission by some candidates."""
    name, weights = task
    gains = {
        field: np.array([getattr(one, field) for one in weights]) for field in MpcGains.model_fields
    }
    return fly_trials(name, "mpc", len(weights), gains=gains)


def best_of(
    candidates: list[MpcGains],
    pool: ProcessPoolExecutor,
    *,
    by_settling: bool = False,
) -> MpcGains:
    """The best of them by the rule, or the soonest in place; those admitted printed."""
    trials = list(pool.map(flown, [(name, candidates) for name in CALM]))
    order = ranked(trials)
    if by_settling:
        order.sort(key=lambda index: sum(float(one.settle_1m_s[index]) for one in trials))
    sys.stdout.write(f"{len(candidates)} candidates, {len(order)} admitted\n")
    for index in order:
        one = candidates[index]
        sys.stdout.write(
            f"velocity {one.velocity_weight_s2:.3g}  acceleration {one.acceleration_weight_s4:.3g}  horizon "
            f"{one.horizon_s:.3g} s, {one.intervals}  integral {one.integral_s:.3g} s\n"
            f"  {trial_line(trials, index)}\n"
        )
    sys.stdout.flush()
    return candidates[order[0]]


def main() -> None:
    """Search and print."""
    with ProcessPoolExecutor(len(CALM)) as pool:
        grid = product(VELOCITIES, ACCELERATIONS, INTEGRALS)
        best = best_of([weights_of(*one) for one in grid], pool)
        for factor in NARROWER:
            best = best_of(around(best, factor), pool)
        horizons = [looking(best, horizon_s) for horizon_s in HORIZONS_S]
        best_of(horizons, pool, by_settling=True)


if __name__ == "__main__":
    main()
