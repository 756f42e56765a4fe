"""Gains of three laws for a rigid body in gusts, by one rule: the same air, search and number of flights.

    .venv/bin/python -m tests.benchmarks.tune_gusts [LAW ...] [--tries N]

Each law begins with the gains that the mission holds for it. Every try moves all of its gains at random
around the best so far, each by up to a factor that shrinks from 2 to 1.2, and flies `SEEDS` for `DURATION_S`.
Other seeds, and longer flights, make the figures of docs/accuracy.md. Best is what has the least distance
from the slots as meant, plus a metre for each unit by which followers roll more than 1.3 times as fast as
their leader, and for each tenth of their setpoints beyond 5 % that a limit cuts.
"""

import argparse
import math

from numpy.random import Generator, default_rng

import vfguide
from tests.benchmarks.gusts import limited_share, roll_share
from tests.kit.figures import tell
from tests.kit.missions import shipped
from vfguide.mission import Mission
from vfguide.mission.controller import controller_of, with_law

TRIES = 12
SEEDS = (11, 12)
DURATION_S = 120.0
ROLL, LIMITED = 1.3, 0.05
"""Most that is wanted: roll rate in parts of the leader's, and share of the setpoints at a limit."""

FIRST, LAST = 2.0, 1.2
"""Factors within which gains are moved, from the first try to the last."""

GAINS = {
    "slot": ("k_x", "k_y", "integral_s", "kappa"),
    "pid": (
        "lateral_p_rad_m",
        "lateral_i_rad_m_s",
        "lateral_d_rad_s_m",
        "longitudinal_p_1_s",
        "longitudinal_i_1_s2",
        "longitudinal_d",
        "derivative_filter_s",
    ),
    "mpc": ("acceleration_weight_s4", "velocity_weight_s2", "integral_s", "horizon_s"),
}
"""What is searched for each law."""

Gains = dict[str, float]


def cost(intended_m: float, roll: float, limited: float) -> float:
    """What is made least, m."""
    return intended_m + max(roll - ROLL, 0.0) + max(limited - LIMITED, 0.0) / 0.1


def moved(best: Gains, factor: float, random: Generator) -> Gains:
    """Gains around the best, each within a factor."""
    return {
        name: float(value * factor ** random.uniform(-1.0, 1.0)) for name, value in best.items()
    }


def flown(mission: Mission, law: str, gains: Gains) -> tuple[float, str]:
    """(cost in m, what was flown in words), the mean over the seeds."""
    settings = {f"controller.{name}": value for name, value in gains.items()}
    found = []
    for seed in SEEDS:
        flight = vfguide.fly(mission, law=law, seed=seed, duration_s=DURATION_S, settings=settings)
        intended_m = flight.summary.formation.intended_error_m
        found.append((intended_m, roll_share(flight), limited_share(flight)))
    intended, roll, limited = (sum(one) / len(SEEDS) for one in zip(*found, strict=True))
    words = f"{intended:.2f} m as meant, roll {roll:.2f}, limited {limited:.1%}"
    return cost(intended, roll, limited), words


def search(mission: Mission, law: str, tries: int) -> None:
    """Search one law's gains, and print what is better than all before."""
    random = default_rng(1)
    written = mission.controller.model_dump(exclude_unset=True) | {"type": mission.controller.type}
    controller = controller_of(with_law(written, law))
    best = {name: float(getattr(controller, name)) for name in GAINS[law]}
    least = math.inf
    for one in range(tries):
        factor = FIRST * (LAST / FIRST) ** (one / max(tries - 1, 1))
        gains = best if one == 0 else moved(best, factor, random)
        found, words = flown(mission, law, gains)
        better = found < least
        if better:
            best, least = gains, found
        figures = ", ".join(f"{name} {value:.3g}" for name, value in gains.items())
        tell(f"{law} {'*' if better else ' '} {found:.3f}: {words}; {figures}")


def main() -> None:
    """Search and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("laws", nargs="*", metavar="LAW")
    parser.add_argument("--tries", type=int, default=TRIES)
    options = parser.parse_args()
    mission = shipped("aerosonde-gusts")
    for law in options.laws or GAINS:
        search(mission, law, options.tries)


if __name__ == "__main__":
    main()
