"""Studies of `vfguide bench` as rows of docs/results."""

from collections import defaultdict
from pathlib import Path

from tests.benchmarks.results import Cases
from vfguide.lab.studies import comparison, scale
from vfguide.lab.studies.flown import executor_on, flown_by, fly
from vfguide.lab.studies.latency import rows_of, run_latency
from vfguide.lab.studies.suite import fly_scenario, means
from vfguide.registry import use_plugins
from vfguide.suite import numbers

LAWS = ("slot", "pid", "mpc")

OWN_LAW = Path(__file__).parents[2] / "examples" / "own_law.py"
"""Holds the law `pursuit`."""

SUITE_LAWS = ("slot", "pid", "article", "pursuit", "mpc")


def laws() -> Cases:
    """Fly the article's comparison: a case for each mission and law."""
    with executor_on() as executor:
        yield from comparison.compare(executor, comparison.FULL, LAWS)


def law_cost() -> Cases:
    """Time a guidance step of each law."""
    yield from scale.step_costs(LAWS)


def latency() -> Cases:
    """Measure from telemetry in to setpoint out, and what the programs take."""
    yield from rows_of(run_latency(seconds=15.0, rate_hz=50.0))


def sizes() -> Cases:
    """Fly formations of growing size."""
    yield from scale.sizes(quick=True)


def ablations() -> Cases:
    """Switch off each part of the field alone."""
    with executor_on() as executor:
        yield from comparison.ablations(executor, "slot", quick=True)


def robustness() -> Cases:
    """Fly circle-wind by each law, with one thing after the other as wrong as the sweeps have it."""
    ends = {
        f"{title}: {value:g}"
        for title, values in comparison.SWEEPS.values()
        for value in {values[0], values[-1]} - {0.0}
    }
    swept = [one for one in comparison.sweep_cases(LAWS, quick=True) if one.label in ends]
    found = defaultdict[str, dict[str, float | None]](dict)
    with executor_on() as executor:
        for case, one in zip(swept, flown_by(executor, fly, swept), strict=True):
            found[case.label][case.controller] = one.mean_error_m
    yield from found.items()


def radio() -> Cases:
    """Fly over a radio that all share, without and with losses."""
    with executor_on() as executor:
        yield from scale.radio(executor)
        for case, figures in scale.radio(executor, loss=0.1, bursts=0.05):
            if case.endswith("Hz"):
                yield f"{case}, lossy", figures


def suite() -> Cases:
    """Fly the hundred scenarios of the suite by each law, one law after the other."""
    use_plugins([OWN_LAW])
    for law in SUITE_LAWS:
        with executor_on() as executor:
            tasks = [(one, law) for one in numbers()]
            yield from means(list(flown_by(executor, fly_scenario, tasks)))
