"""The gains of the field: a search on the calm missions, by the rule of `vfguide.lab.studies.tuning`.

Run with `.venv/bin/python tests/benchmarks/tune_field.py`; some minutes on two processors. Gains are drawn
around the best so far, ever nearer, none whose field or integral `vfguide check` would find too fast in the
article's wind. What it finds, rounded, is what the article's missions have, and
`vfguide/lab/studies/flown.py`.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from random import Random

import numpy as np

from vfguide.lab.studies.flown import article_mission
from vfguide.lab.studies.tuning import CALM, Trials, fly_trials, ranked, trial_line
from vfguide.laws.field_findings import fields_beyond_the_loop, integral_too_fast
from vfguide.mission.conditions import conditions_of

CANDIDATES = 32
SEED = 3
WINDY = ("line-wind", "circle-wind")

FIRST = {"k_x": 0.25, "k_y": 0.25, "integral_s": 1.2, "boundary_layer_factor": 3.5}
"""A field that was tuned by hand."""

NARROWER = (2.0, 1.6, 1.4, 1.3, 1.2, 1.1)
"""Factors around the best within which candidates are drawn."""

Gains = dict[str, float]


def unsound(gains: Gains) -> bool:
    """Whether the loops around the slot would be too fast for each other somewhere in the wind."""
    for name in WINDY:
        mission = article_mission(name, {"controller": gains})
        conditions = conditions_of(mission.path, mission.wind)
        findings = [
            *fields_beyond_the_loop(mission, conditions),
            *integral_too_fast(mission, conditions),
        ]
        if findings:
            return True
    return False


def drawn(random: Random, centre: Gains, factor: float) -> list[Gains]:
    """The centre, and sound candidates around it."""
    candidates = [centre]
    while len(candidates) < CANDIDATES:
        gains = {
            name: value * factor ** random.uniform(-1.0, 1.0) for name, value in centre.items()
        }
        if not unsound(gains):
            candidates.append(gains)
    return candidates


def flown(task: tuple[str, Gains]) -> Trials:
    """One mission by one candidate."""
    name, gains = task
    return fly_trials(name, "slot", controller=gains)


def joined(trials: list[Trials]) -> Trials:
    """The trials of some candidates on one mission as one."""
    return Trials(
        **{
            name: np.concatenate([getattr(one, name) for one in trials])
            for name in Trials.__dataclass_fields__
        }
    )


def main() -> None:
    """Search and print."""
    random, best = Random(SEED), FIRST
    with ProcessPoolExecutor(2) as pool:
        for factor in NARROWER:
            candidates = drawn(random, best, factor)
            trials = [
                joined(list(pool.map(flown, [(name, gains) for gains in candidates])))
                for name in CALM
            ]
            order = ranked(trials)
            sys.stdout.write(f"within a factor of {factor}: {len(order)} admitted\n")
            for index in order[:3]:
                figures = "  ".join(
                    f"{name} {value:.3g}" for name, value in candidates[index].items()
                )
                sys.stdout.write(f"{figures}\n  {trial_line(trials, index)}\n")
            sys.stdout.flush()
            if order:
                best = candidates[order[0]]


if __name__ == "__main__":
    main()
