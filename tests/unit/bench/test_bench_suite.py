import math

import pytest

from tests.kit.figures import figures_with
from vfguide import suite
from vfguide.commands.bench import study_directory, study_file
from vfguide.errors import InputError
from vfguide.lab.studies.flown import markdown
from vfguide.lab.studies.suite import (
    SUITE_COLUMNS,
    SuiteFlight,
    fly_scenario,
    in_figures,
    means,
    shortcomings,
)
from vfguide.mission import parse_mission
from vfguide.suite.draw import drawn


def flight(scenario: str = "suite-001", law: str = "slot", failed: str = "", **changes):
    return SuiteFlight(scenario=scenario, law=law, failed=failed, figures=figures_with(**changes))


@pytest.mark.parametrize(
    ("changes", "points"),
    [
        # Half of 25, 25, 20, 10 and 10, and all of 10.
        ({}, 55.0),
        # 25 / (1 + 3) instead of 12.5.
        ({"mean_error_m": 3.0}, 48.75),
        # Never joined: nothing of 20.
        ({"settle_10m_s": None}, 45.0),
        ({"limited": 0.4}, 51.0),
        ({"failed": "two aircraft came within 3.0 m"}, 0.0),
    ],
)
def test_half_of_each_part_is_had_at_its_half_worth(changes, points):
    assert flight(**changes).score == pytest.approx(points)


def test_means_leave_out_failed_flights_but_the_score_counts_them():
    flights = [flight(), flight(limited=0.6, min_separation_m=9.0), flight(failed="lost")]
    ((law, found),) = means(flights)
    assert law == "slot"
    assert found["score"] == pytest.approx((55.0 + 49.0 + 0.0) / 3.0)
    # Student's t of 2 degrees of freedom is 4.303; the standard deviation of 55, 49, 0 is 30.17.
    assert found["score_half"] == pytest.approx(4.3027 * 30.1717 / math.sqrt(3.0), rel=1e-4)
    assert found["flown_m"] == 1.0
    assert found["limited_percent"] == pytest.approx(30.0)
    assert found["nearest_m"] == 9.0
    assert (found["failed"], found["flights"]) == (1, 3)
    assert "| 1 of 3 |" in markdown(SUITE_COLUMNS, means(flights))


def test_where_a_law_fails_or_is_beaten_is_told():
    flights = [
        flight(limited=0.5),
        flight(law="pid"),
        flight("suite-002", failed="two aircraft came within 3.0 m"),
        flight("suite-003", limited=0.05),
        flight("suite-003", law="pid"),
    ]
    assert shortcomings(flights, "slot") == [
        "suite-001: slot 50 points, pid 55",
        "suite-002: slot failed: two aircraft came within 3.0 m",
    ]


def test_a_flight_that_broke_is_kept_with_its_reason():
    broken = SuiteFlight(scenario="suite-004", law="slot", failed="a process died", figures=None)
    assert in_figures(broken) == {
        "scenario": "suite-004", "law": "slot", "failed": "a process died", "score": 0.0,
    }  # fmt: skip
    assert in_figures(flight())["min_separation_m"] == 12.0


@pytest.mark.parametrize("number", [1, 37, 100])
def test_the_rule_draws_the_scenarios_as_they_are_kept(number):
    mission = parse_mission(drawn(number).encode(), file="drawn").mission
    assert suite.with_law(number, "slot") == mission


def test_further_draws_repeat_by_their_seed_and_are_none_of_the_fixed():
    first, again, other = (
        [suite.with_law(number, "pid") for number in suite.further(2, seed)] for seed in (7, 7, 8)
    )
    assert first == again
    assert first[0] != first[1] != other[0]
    assert first[0].name == "suite-7000001"
    assert {one.controller.type for one in first} == {"pid"}


def test_every_scenario_is_as_it_was_drawn_and_names_its_law():
    assert len(suite.numbers()) == suite.COUNT
    assert len(suite.numbers(quick=True)) == 10
    for number in suite.numbers():
        mission = suite.with_law(number, "pid")
        assert mission.controller.type == "pid"
        assert mission.rehearsal.seed == number


def test_a_changed_scenario_is_refused(monkeypatch, tmp_path):
    for name in (suite.SUMS, "001.yaml"):
        (tmp_path / name).write_bytes((suite.files("vfguide.suite") / name).read_bytes())
    monkeypatch.setattr(suite, "files", lambda _: tmp_path)
    assert suite.with_law(1, "slot").name == "suite-001"
    with (tmp_path / "001.yaml").open("a") as file:
        file.write("# easier\n")
    with pytest.raises(InputError, match="is not the scenario as it was drawn"):
        suite.with_law(1, "slot")


@pytest.mark.flies
def test_a_scenario_is_flown_and_judged():
    # One follower, nothing happens.
    flown = fly_scenario((91, "slot"))
    assert flown.failed == ""
    assert 0.0 < flown.score < 100.0
    assert flown.figures is not None
    assert flown.figures.min_separation_m > 5.0


def test_results_that_could_not_be_kept_are_refused_before_anything_is_flown(tmp_path):
    assert study_directory(str(tmp_path)) == tmp_path
    file = tmp_path / "file"
    file.touch()
    assert study_file(str(file)) == file
    with pytest.raises(InputError, match="is a file; give another directory with --out"):
        study_directory(str(file))
    with pytest.raises(InputError, match="is a directory; name a file with --json"):
        study_file(str(tmp_path))
