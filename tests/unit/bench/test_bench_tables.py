"""What a benchmark's figures look like on paper: tables, JSON, pictures."""

import math
from concurrent import futures
from dataclasses import replace

import pytest

from tests.kit.figures import figures_with
from vfguide.lab.studies.comparison import (
    ABLATIONS,
    FULL,
    LAW_COLUMNS,
    QUICK,
    SWEEPS,
    ablation_cases,
    cases,
    robustness,
    rows,
    short_table,
    sweep_cases,
)
from vfguide.lab.studies.flown import MISSIONS, Case, Figures, Row, Shown, markdown

LAWS = ("slot", "article", "pid", "mpc")


def figures(mean_error_m: float) -> Figures:
    return figures_with(
        mean_error_m=mean_error_m,
        p95_error_m=2.0 * mean_error_m,
        max_error_m=3.0 * mean_error_m,
        settle_10m_s=12.0,
        settle_1m_s=None,
    )


def table_rows() -> list[Row]:
    flown = [
        (Case(mission=mission, controller=law, label="shipped"), figures(0.1 * (number + 1)))
        for mission in MISSIONS
        for number, law in enumerate(LAWS)
    ]
    late = (Case(mission="line-calm", controller="slot", label="bad link"), figures(0.5))
    return list(rows([*flown, late, late]))


COSTS: list[Row] = [(law, {"median_us": 10.0 * (number + 1)}) for number, law in enumerate(LAWS)]


def test_the_short_table_marks_the_best_law_of_each_mission():
    lines = short_table(table_rows(), COSTS).splitlines()
    assert lines[2] == "| line-calm | 0.85 | **0.100** | 0.200 | 0.300 | 0.400 |"
    assert lines[-1] == "| one guidance step |  | 10 µs | 20 µs | 30 µs | 40 µs |"


def test_the_long_table_says_what_never_settled_and_what_a_bad_link_costs():
    first, second, *_ = lines = markdown(LAW_COLUMNS, table_rows()).splitlines()[2:]
    assert len(lines) == len(MISSIONS) * len(LAWS)
    assert first.startswith("| line-calm, slot | 0.100 | 0.200 | 0.300 | 12.0 | - |")
    assert first.endswith("| 0.500 ± 0.000 |")
    assert second.endswith("| - ± - |")


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "-"), (math.nan, "-"), (0.0123, "0.012"), (4.086, "4.09"), (312.0, "312")],
)
def test_figures_have_the_digits_they_deserve(value, text):
    assert f"{Shown.of(value)}" == text


def test_the_comparison_flies_every_mission_by_every_law_on_both_plants():
    for extent in (FULL, QUICK):
        shipped = [case for case in cases(extent, LAWS) if case.label == "shipped"]
        assert len({(one.mission, one.controller, one.plant) for one in shipped}) == 32
    assert len(cases(FULL, LAWS)) == 32 + 32 * 5


def test_every_ablation_is_a_mission_that_can_be_flown():
    flown = ablation_cases("slot", quick=True)
    assert len(flown) == len(ABLATIONS) * len(MISSIONS)
    for case in flown:
        assert case.flown().controller.type == case.controller


def test_only_what_a_law_has_is_switched_off():
    flown = ablation_cases("pid", quick=True)
    labels = {case.label for case in flown}
    assert "no wind rate" in labels
    assert {"no integral", "no slot motion"}.isdisjoint(labels)
    assert all(case.flown().controller.type == "pid" for case in flown)


class Executor(futures.Executor):
    """Flies nothing: a lossy link never lets anybody settle."""

    def map(self, fn, *iterables, **options):  # noqa: ARG002 - as the base class has it
        for case in iterables[0]:
            never = case.label == "link loss: 0.5"
            yield replace(figures(0.6), settle_10m_s=None if never else 14.0)


def test_rows_of_what_gets_worse_show_what_never_settled():
    found = dict(robustness(Executor(), ("slot", "pid"), quick=False))
    assert found["line-wind, link loss: 0.5"] == {
        "slot": 0.6, "slot_s": None, "pid": 0.6, "pid_s": None,
    }  # fmt: skip
    assert found["circle-wind, link loss: 0.4"]["pid_s"] == 14.0
    assert len(found) == 2 * sum(len(values) for _, values in SWEEPS.values())


def test_aircraft_that_respond_otherwise_than_declared_are_flown():
    slow = next(
        one for one in sweep_cases(["slot"], quick=True) if one.label.startswith("true alpha")
    )
    mission = slow.flown()
    assert mission.rehearsal.emulator.alpha_1_s == 0.6
    assert mission.vehicles["f1"].alpha_1_s == 1.2
