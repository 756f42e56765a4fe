import math

import pytest

from vfguide import suite
from vfguide.commands.bench import study_directory, study_file
from vfguide.errors import InputError
from vfguide.lab.studies.suite import (
    SuiteFlight,
    fly_scenario,
    means,
    score,
    shortcomings,
    suite_table,
)
from vfguide.mission import parse_mission
from vfguide.suite.draw import drawn


def flight(**changes: object) -> SuiteFlight:
    fields: dict[str, object] = {
        "scenario": "suite-001",
        "law": "slot",
        "failed": "",
        "score": 50.0,
        "mean_error_m": 1.0,
        "intended_error_m": 1.0,
        "settle_10m_s": 30.0,
        "effort_m_s2": 2.0,
        "roll_deg_s": 10.0,
        "limited": 0.0,
        "nearest_m": 12.0,
    }
    return SuiteFlight(**{**fields, **changes})


@pytest.mark.parametrize(
    ("changes", "points"),
    [
        # Half of 25, 25, 20, 10 and 10, and all of 10.
        ({}, 55.0),
        # 25 / (1 + 3) instead of 12.5.
        ({"mean_error_m": 3.0}, 48.75),
        # Never joined: nothing of 20.
        ({"settle_10m_s": math.nan}, 45.0),
        ({"limited": 0.4}, 51.0),
        ({"failed": "two aircraft came within 3.0 m"}, 0.0),
    ],
)
def test_half_of_each_part_is_had_at_its_half_worth(changes, points):
    assert score(flight(**changes)) == pytest.approx(points)


def test_means_leave_out_failed_flights_but_the_score_counts_them():
    flights = [flight(score=60.0), flight(score=40.0), flight(score=0.0, failed="lost")]
    found = means(flights)["slot"]
    assert found["score"]["mean"] == pytest.approx(100.0 / 3.0)
    # Student's t of 2 degrees of freedom is 4.303; the standard deviation of 60, 40, 0 is 30.55.
    assert found["score"]["half_width"] == pytest.approx(
        4.3027 * 30.5505 / math.sqrt(3.0), rel=1e-4
    )
    assert found["mean_error_m"]["mean"] == 1.0
    assert (found["failed"], found["flights"]) == (1, 3)
    assert "| 1 of 3 |" in suite_table(flights)


def test_where_a_law_fails_or_is_beaten_is_told():
    flights = [
        flight(score=50.0),
        flight(law="pid", score=70.0),
        flight(scenario="suite-002", score=0.0, failed="two aircraft came within 3.0 m"),
        flight(scenario="suite-003", score=50.0),
        flight(scenario="suite-003", law="pid", score=50.5),
    ]
    assert shortcomings(flights, "slot") == [
        "suite-001: slot 50 points, pid 70",
        "suite-002: slot failed: two aircraft came within 3.0 m",
    ]


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
    assert flown.nearest_m > 5.0


def test_results_that_could_not_be_kept_are_refused_before_anything_is_flown(tmp_path):
    assert study_directory(str(tmp_path)) == tmp_path
    file = tmp_path / "file"
    file.touch()
    assert study_file(str(file)) == file
    with pytest.raises(InputError, match="is a file; give another directory with --out"):
        study_directory(str(file))
    with pytest.raises(InputError, match="is a directory; name a file with --json"):
        study_file(str(tmp_path))
