"""A law that is learned: a policy of six numbers, found by the cross-entropy method.

    pip install 'vfguide[rl]'
    python examples/learned_law.py missions/circle-wind.yaml # two minutes on a CPU; writes learned.npz
    vfguide fly circle-wind --controller learned --plugin examples/learned_law.py

In each training flight every follower flies a candidate of its own. Candidates are drawn around a mean; the
best quarter of them makes the next mean and spread (Rubinstein and Kroese, "The Cross-Entropy Method", 2004).
In flight the law needs numpy alone: it sees what the agent saw, and answers as the agent did.
"""

import math
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import vfguide
from vfguide.errors import InputError
from vfguide.guidance.sliding_laws import GuidanceSettings
from vfguide.laws import OBSERVATION, DesiredMotion, Law, Section, View, law, motion_of, observed
from vfguide.state import Airframe

if TYPE_CHECKING:
    from vfguide.lab.environment import FlownStep

Weights = NDArray[np.float64]

WEIGHTS = Path("learned.npz")
"""Written where it is learned, and looked for where it is flown."""

SEEN = (
    (("cross_track", 20.0), ("cross_track", 2.0), ("cross_track_rate", 5.0)),
    (("along_track", 20.0), ("along_track", 2.0), ("along_track_rate", 5.0)),
)
"""What of an observation decides on the course and on the speed, and what counts as much of it."""

NAMES = [entry.name for entry in OBSERVATION]
PLACES = [[NAMES.index(name) for name, _ in one] for one in SEEN]
SCALES = np.array([[scale for _, scale in one] for one in SEEN])

FIRST_SPREAD = 0.3
"""Of the weights that are tried in the first round."""

SPREAD_M = 20.0
"""Followers begin so far from their slots, at random."""

CANDIDATES, BEST, ROUNDS = 18, 5, 10


def action_of(weights: Weights, observation: NDArray[np.float32]) -> Weights:
    """Course and speed, from -1 to 1: each by three weights of tanh of what it sees."""
    action: Weights = np.clip((weights * np.tanh(observation[PLACES] / SCALES)).sum(axis=1), -1, 1)
    return action


class LearnedGains(Section):
    """Fields of the mission's `controller:` for `type: learned`."""

    weights: str = str(WEIGHTS)
    """File with the policy's weights."""


@cache
def loaded(file: Path) -> Weights:
    """Weights of a file."""
    try:
        weights: Weights = np.load(file)["weights"]
    except OSError as error:
        raise InputError(
            f"{file}: there are no weights; `python examples/learned_law.py` writes them here"
        ) from error
    return weights


@law("learned")
class Learned(Law):
    """The policy."""

    Gains = LearnedGains

    def __init__(self, gains: LearnedGains, settings: GuidanceSettings, airframe: Airframe) -> None:
        """Read the weights: without any nothing flies."""
        super().__init__(gains, settings, airframe)
        self.weights = loaded(Path(gains.weights))

    def step(self, view: View, memory: None) -> tuple[DesiredMotion, None]:
        """As the agent would."""
        return motion_of(view, action_of(self.weights, observed(view)), "setpoints"), memory


def reward(step: "FlownStep") -> float:
    """The logarithm of the distance: the last metre counts as much as the first ten."""
    return -math.log(0.1 + step.distance_m)


def scores(mission: str, candidates: list[Weights], seed: int) -> list[float]:
    """Mean rewards of candidates in one flight, a follower each; others fly by the mission's law."""
    flown = vfguide.environment(
        vfguide.load_mission(mission),
        actions="setpoints",
        reward=reward,
        duration_s=15.0,
        rate_hz=10.0,
    )
    policies = dict(zip(flown.possible_agents, candidates, strict=False))
    away = np.random.default_rng(seed).uniform(-SPREAD_M, SPREAD_M, 2).tolist()
    start = dict(zip(("forward_m", "right_m"), away, strict=True))
    starts = {f"rehearsal.start.{name}": start for name in flown.possible_agents}
    observations, _ = flown.reset(seed=seed, options={"settings": starts})
    last, flight = dict.fromkeys(policies, 0.0), []
    while flown.agents:
        flying = [name for name in flown.agents if name in policies]
        actions = {name: action_of(policies[name], observations[name]) for name in flying}
        observations, rewards, *_ = flown.step(actions)
        # Who is lost goes on to get what it got last.
        last |= {name: rewards[name] for name in flying}
        flight.append([*last.values()])
    return [float(mean) for mean in np.mean(flight, axis=0)]


def learn(mission: str, *, rounds: int = ROUNDS) -> Weights:
    """The mean of the last round's best."""
    random = np.random.default_rng(1)
    size = len(vfguide.load_mission(mission).followers)
    mean, spread = np.zeros(SCALES.shape), np.full(SCALES.shape, FIRST_SPREAD)
    with ProcessPoolExecutor(os.cpu_count()) as executor:
        for number in range(1, rounds + 1):
            drawn = mean + spread * random.standard_normal((CANDIDATES, *mean.shape))
            flights = [[*drawn[first : first + size]] for first in range(0, CANDIDATES, size)]
            # The same for all candidates of a round.
            seeds = [number] * len(flights)
            worth = [*chain(*executor.map(scores, [mission] * len(flights), flights, seeds))]
            best = drawn[np.argsort(worth)[-BEST:]]
            mean, spread = best.mean(axis=0), best.std(axis=0) + 0.02
            print(f"round {number}: {math.exp(-max(worth)):.1f} m from the slot, the best of them")
    return mean


if __name__ == "__main__":
    found = learn(sys.argv[1] if sys.argv[1:] else "missions/circle-wind.yaml")
    np.savez(WEIGHTS, weights=found)
    print(f"wrote {WEIGHTS}:", np.array2string(found, precision=2), sep="\n")
