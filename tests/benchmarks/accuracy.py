"""The article's missions and those of this project, as they are shipped and with one thing changed."""

import os
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from tests.benchmarks.results import Cases
from tests.kit.missions import mission_with
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.metrics import FormationSummary, summarise
from vfguide.lab.studies import comparison
from vfguide.lab.studies.flown import ARTICLE_ERROR_M

OTHERS = {
    "survey-racetrack": "a racetrack",
    "transit-abreast": "line abreast",
    "shapes": "six [orders](docs/orders.md) in one flight",
    "climb-and-turn": "[paths](docs/paths.md) with heights",
    "figure-eight": "an eight",
    "survey-plan": "a plan of QGroundControl",
    "leader-lost": "a [deputy](docs/succession.md) leads on",
}
"""Missions beside the article's, and what each shows."""

BAD_LINK = "slow, lossy link and noise¹"

VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "as shipped": {},
    BAD_LINK: {"rehearsal": comparison.BAD_LINK},
    "`controller.leader_speed_source: observer`": {
        "controller": {"leader_speed_source": "observer"}
    },
    "`--controller article`": {"controller": {"type": "article"}},
    "`--rate 50`": {"rehearsal": {"rate_hz": 50.0}},
}


def fly(task: tuple[str, str]) -> FormationSummary:
    """Fly one mission in one variant."""
    name, variant = task
    return summarise(fly_lockstep(mission_with(name, **VARIANTS[variant])).record).formation


def flown(tasks: list[tuple[str, str]]) -> dict[tuple[str, str], FormationSummary]:
    """Fly on all processors."""
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        return dict(zip(tasks, pool.map(fly, tasks), strict=True))


def missions() -> Cases:
    """Fly every mission as it is shipped, the article's over a bad link too."""
    shipped = [(name, "as shipped") for name in (*ARTICLE_ERROR_M, *OTHERS)]
    found = flown(shipped + [(name, BAD_LINK) for name in ARTICLE_ERROR_M])
    for name, variant in shipped:
        one = found[name, variant]
        figures: dict[str, float | str | None] = {
            "mean_m": one.mean_error_m,
            "p95_m": one.p95_error_m,
            "max_m": one.max_error_m,
            "settle_10m_s": one.settle_10m_s,
            "settle_1m_s": one.settle_1m_s,
            "nearest_m": one.min_separation_m,
        }
        if name in ARTICLE_ERROR_M:
            bad_link = found[name, BAD_LINK].mean_error_m
            figures |= {"article_m": ARTICLE_ERROR_M[name], "bad_link_m": bad_link}
        else:
            figures["what"] = OTHERS[name]
        yield name, figures


def variants() -> Cases:
    """Fly the article's missions with one thing changed."""
    found = flown([(name, variant) for variant in VARIANTS for name in ARTICLE_ERROR_M])
    for variant in VARIANTS:
        yield (
            variant,
            {name.replace("-", "_"): found[name, variant].mean_error_m for name in ARTICLE_ERROR_M},
        )
