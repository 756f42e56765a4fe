"""Studies of `vfguide bench` as rows of docs/results."""

from itertools import product
from pathlib import Path
from typing import Any

from tests.benchmarks.results import Cases
from vfguide.lab.studies.comparison import FULL as COMPARED
from vfguide.lab.studies.comparison import ablation_cases, compare, parts_of, sweep_cases
from vfguide.lab.studies.flown import MISSIONS, executor_on, flown_by, fly
from vfguide.lab.studies.latency import run_latency
from vfguide.lab.studies.scale import RATES_HZ, SIZES, RadioCase, fly_radio, measure_all, step_costs
from vfguide.lab.studies.suite import fly_scenario, means
from vfguide.registry import use_plugins
from vfguide.suite import numbers

NO_RADIO = "no radio, 0.1 s late"

LAWS = ("slot", "pid", "mpc")

OWN_LAW = Path(__file__).parents[2] / "examples" / "own_law.py"
"""Holds the law `pursuit`."""

SUITE_LAWS = ("slot", "pid", "article", "pursuit", "mpc")

ARTICLE_M = {"line-calm": 0.85, "line-wind": 2.31, "circle-calm": 1.12, "circle-wind": 2.97}
"""Errors that the article claims, m."""


def laws() -> Cases:
    """Fly the article's comparison: a case for each mission and law."""
    with executor_on() as executor:
        rows = compare(executor, COMPARED, LAWS)
    found = {(one.mission, one.law, one.plant, one.condition): one.mean for one in rows}
    for mission in MISSIONS:
        for law in LAWS:
            shipped = found[mission, law, "heading-hold", "shipped"]
            yield (
                f"{mission}, {law}",
                {
                    "mean_m": shipped.mean_error_m,
                    "p95_m": shipped.p95_error_m,
                    "max_m": shipped.max_error_m,
                    "settle_10m_s": shipped.settle_10m_s,
                    "settle_1m_s": shipped.settle_1m_s,
                    "effort_m_s2": shipped.effort_m_s2,
                    "chatter_rad_s": shipped.course_variation_rad_s,
                    "nearest_m": shipped.min_separation_m,
                    "course_hold_m": found[mission, law, "course-hold", "shipped"].mean_error_m,
                    "bad_link_m": found[mission, law, "heading-hold", "bad link"].mean_error_m,
                },
            )


def law_cost() -> Cases:
    """Time a guidance step of each law."""
    for law, cost in step_costs(LAWS).items():
        yield law, {"median_us": cost["median_us"], "p99_us": cost["p99_us"]}


def latency() -> Cases:
    """Measure from telemetry in to setpoint out, and what the programs take."""
    found = run_latency(seconds=15.0, rate_hz=50.0)["response"]
    for name, one in found["clients"].items():
        kept = ("p50_ms", "p99_ms", "cpu_percent", "memory_mb")
        yield name, {key: one.get(key) for key in kept}


def scale() -> Cases:
    """Fly formations of growing size."""
    for one in measure_all(quick=True)["sizes"]:
        yield (
            f"{one['vehicles']}",
            {
                "real_time_factor": one["real_time_factor"],
                "step_us": one["processor_us_per_vehicle_step"],
                "memory_mb": one["memory_mb"],
                "guidance_us": one["guidance_step_us"],
            },
        )


def ablations() -> Cases:
    """Switch off each part of the field alone."""
    flown = ablation_cases("slot", quick=True)
    with executor_on() as executor:
        results = list(flown_by(executor, fly, flown))
    found = {(one.label, one.mission): each for one, each in zip(flown, results, strict=True)}
    for part in parts_of("slot"):
        figures: dict[str, Any] = {
            "chatter_rad_s": max(found[part, one].course_variation_rad_s for one in MISSIONS)
        }
        for mission in MISSIONS:
            key = mission.replace("-", "_")
            figures[key] = found[part, mission].mean_error_m
            figures[f"{key}_max"] = found[part, mission].max_error_m
        yield part, figures


def robustness() -> Cases:
    """Fly circle-wind with one thing after another going wrong."""
    with executor_on() as executor:
        swept = sweep_cases(LAWS, quick=True)
        found = list(flown_by(executor, fly, swept))
    cases: dict[str, dict[str, Any]] = {}
    for case, one in zip(swept, found, strict=True):
        cases.setdefault(case.label, {})[case.controller] = one.mean_error_m
    yield from cases.items()


FOLLOWERS_HZ = 2.5
"""Of their states, where the leader's come no slower."""


def radio() -> Cases:
    """Fly over a radio that all share, without and with losses."""
    with executor_on() as executor:
        for leader_hz, lossy in ((None, False), *product(RATES_HZ, (False, True))):
            flown = [
                RadioCase(
                    size=size,
                    leader_hz=leader_hz,
                    followers_hz=min(FOLLOWERS_HZ, leader_hz or FOLLOWERS_HZ),
                    loss=0.1 if lossy else 0.0,
                    bursts=0.05 if lossy else 0.0,
                    seconds=120.0,
                )
                for size in SIZES
            ]
            figures = dict[str, float]()
            for size, one in zip(SIZES, flown_by(executor, fly_radio, flown), strict=True):
                figures |= {f"mean_{size}_m": one.mean_error_m, f"max_{size}_m": one.max_error_m}
            name = f"{leader_hz:g} Hz{', lossy' if lossy else ''}" if leader_hz else NO_RADIO
            yield name, figures


def suite() -> Cases:
    """Fly the hundred scenarios of the suite by each law, one law after the other."""
    use_plugins([OWN_LAW])
    for law in SUITE_LAWS:
        with executor_on() as executor:
            flights = list(flown_by(executor, fly_scenario, [(one, law) for one in numbers()]))
        yield law, suite_figures(means(flights)[law])


def suite_figures(found: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of a law as rows have them."""
    keys = {
        "score": "score",
        "mean_error_m": "flown_m",
        "intended_error_m": "meant_m",
        "settle_10m_s": "joined_s",
        "effort_m_s2": "effort_m_s2",
        "roll_deg_s": "roll_deg_s",
    }
    figures: dict[str, Any] = {key: found[key] for key in ("nearest_m", "flights", "failed")}
    for name, key in keys.items():
        figures |= {key: found[name]["mean"], f"{key}_half": found[name]["half_width"]}
    return figures | {"limited_percent": 100.0 * found["limited"]["mean"]}
