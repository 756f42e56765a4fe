"""The tables of docs/accuracy.md, flown anew: run with `make accuracy`."""

import os
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from tests.kit.figures import cell, tell
from tests.kit.missions import mission_with
from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.summary import Summary

ARTICLE = ("line-calm", "line-wind", "circle-calm", "circle-wind")
CREW = ("survey-racetrack", "transit-abreast")

VARIANTS: dict[str, dict[str, dict[str, Any]]] = {
    "as shipped": {},
    "slow, lossy link and noise": {
        "rehearsal": {
            "link_delay_s": 0.2,
            "link_jitter_s": 0.05,
            "link_loss": 0.2,
            "position_noise_m": 0.3,
        }
    },
    "leader without ground speed": {"controller": {"leader_speed_source": "observer"}},
    "article's field": {"controller": {"type": "article"}},
    "50 Hz": {"rehearsal": {"rate_hz": 50.0}},
}

COLUMNS = {
    "mean": "mean_error_m",
    "95 %": "p95_error_m",
    "max": "max_error_m",
    "10 m": "settle_10m_s",
    "1 m": "settle_1m_s",
    "nearest": "min_separation_m",
}


def fly(task: tuple[str, str]) -> Summary:
    """Summary of one mission in one variant."""
    name, variant = task
    return summarise(fly_lockstep(mission_with(name, **VARIANTS[variant])).record)


def main() -> None:
    """Fly everything on all processors and print the tables."""
    shipped = [(name, "as shipped") for name in (*ARTICLE, *CREW)]
    others = [(name, variant) for variant in VARIANTS for name in ARTICLE]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        summaries = dict(zip(shipped + others, pool.map(fly, shipped + others), strict=True))
    tell(f"{'metres, seconds':28}" + "".join(f"{column:>8}" for column in COLUMNS))
    for task in shipped:
        figures = summaries[task].formation
        tell(f"{task[0]:28}" + "".join(cell(getattr(figures, one)) for one in COLUMNS.values()))
    tell(f"\n{'mean error, metres':28}" + "".join(f"{name:>14}" for name in ARTICLE))
    for variant in VARIANTS:
        means = (summaries[name, variant].formation.mean_error_m for name in ARTICLE)
        tell(f"{variant:28}" + "".join(f"{cell(value):>14}" for value in means))
    tell(f"\n{'course setpoint, rad/s':28}variation, and what of it is not net turning")
    for name in ARTICLE:
        for vehicle, figures in summaries[name, "as shipped"].vehicles.items():
            variation = figures.course_setpoint_variation_rad_s
            excess = figures.course_setpoint_excess_variation_rad_s
            tell(f"{name + ' ' + vehicle:28}{cell(variation)}{cell(excess)}")


if __name__ == "__main__":
    main()
