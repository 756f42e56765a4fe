"""What one guidance step of each law costs: as called in a flight, nothing left out."""

import statistics
from collections.abc import Sequence
from typing import Any

from vfguide.bench.article import article_mission
from vfguide.bench.timing import calls_timed
from vfguide.laws.keeper import SlotKeeper
from vfguide.rehearsal.lockstep import fly_lockstep

DURATION_S = 15.0

STEADY_FROM = 0.2
"""Share of the calls that is left out: imports and the first solutions."""


def step_costs(laws: Sequence[str], mission: str = "circle-wind") -> dict[str, dict[str, Any]]:
    """Median and 99th percentile of a follower's step by law, microseconds."""
    return {law: cost_of(law, mission) for law in laws}


def cost_of(law: str, mission: str) -> dict[str, Any]:
    """Median, 99th percentile and greatest of one law, microseconds."""
    flown = article_mission(
        mission, {"controller": {"type": law}, "rehearsal": {"duration_s": DURATION_S}}
    )
    with calls_timed(SlotKeeper, "step") as durations:
        fly_lockstep(flown)
    steady = sorted(durations[round(STEADY_FROM * len(durations)) :])
    return {
        "calls": len(steady),
        "median_us": statistics.median(steady) * 1e6,
        "p99_us": steady[round(0.99 * (len(steady) - 1))] * 1e6,
        "max_us": steady[-1] * 1e6,
    }
