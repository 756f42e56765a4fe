"""The stages of `make test`, and how they are summed up."""

import sys
from collections import Counter

import pytest

from tests.stages import (
    SHOWN_LINES,
    Ended,
    Stage,
    counted,
    environment,
    failures,
    longest,
    main,
    stage_line,
    total_line,
)

RESULTS = """<?xml version="1.0" encoding="utf-8"?>
<testsuites><testsuite name="pytest" errors="1" failures="2" skipped="3" tests="10">
<testcase classname="tests.x" name="a" time="2.5"/><testcase classname="tests.x" name="a" time="1.5"/>
<testcase name="b"><skipped type="pytest.skip" message="set PX4 to the program"/></testcase>
<testcase name="c"><skipped type="pytest.skip" message="set PX4 to the program"/></testcase>
<testcase name="d"><skipped type="pytest.skip" message="no mosquitto"/></testcase>
</testsuite></testsuites>"""

COUNTS = Counter(passed=4, failed=2, errors=1, skipped=3)
REASONS = Counter({"set PX4 to the program": 2, "no mosquitto": 1})


def python(name: str, program: str) -> Stage:
    """A stage that is a program of Python."""
    return Stage(name, (sys.executable, "-c", program))


def test_results_are_counted_with_the_reasons_of_skipped_tests_without_their_places():
    assert counted(RESULTS)[:2] == (COUNTS, REASONS)
    told = RESULTS.replace("no mosquitto", "/x/tests/conftest.py:30: Skipped: no mosquitto")
    assert counted(told)[1] == REASONS


def test_the_longest_tests_are_listed_with_their_repetitions():
    live = Ended("live", 60.0, 0, *counted(RESULTS))
    many = {f"tests.y::test_{number}": 3.0 - 0.01 * number for number in range(100)}
    lines = longest([live, Ended("lockstep", 600.0, 0, lasted_s=many)]).splitlines()
    assert lines[0] == "    4.0 s  live        tests.x::a"
    assert lines[1] == "    3.0 s  lockstep    tests.y::test_0"
    assert len(lines) == 40


@pytest.mark.parametrize(
    ("one", "line"),
    [
        (Ended("lint", 41.4, 0), "lint            41 s  ok"),
        (Ended("lint", 5.0, 2), "lint             5 s  FAILED"),
        (
            Ended("sockets", 100.0, 1, COUNTS, REASONS),
            "sockets        100 s  4 passed, 2 failed, 1 errors, 3 skipped",
        ),
        (Ended("live", 3.0, 1, Counter(passed=2)), "live             3 s  FAILED, 2 passed"),
    ],
)
def test_a_stage_is_one_line(one, line):
    log = f"  see test-logs/{one.name}.log" if one.status else ""
    assert stage_line(one) == f"{line}{log}"


def test_all_stages_are_one_line_with_grouped_reasons():
    lockstep = Ended("lockstep", 600.0, 0, Counter(passed=10, skipped=1), Counter({"no engine": 1}))
    live = Ended("live", 60.0, 0, Counter(passed=1, skipped=3), REASONS)
    assert total_line([Ended("lint", 41.0, 0), lockstep, live], 660.0) == (
        "all            660 s  11 passed, 4 skipped"
        " (2: set PX4 to the program; 1: no engine; 1: no mosquitto)"
    )


def test_of_a_log_the_failures_are_shown_and_no_more_than_fits():
    log = "collected\nF.\n===== FAILURES =====\n___ test_x ___\n\nE  assert 0\n== 1 failed =="
    assert failures(log).startswith("===== FAILURES =====\n___ test_x ___")
    assert failures("error: no rule\n") == "error: no rule"
    long = "\n".join(str(number) for number in range(1000))
    assert failures(long).splitlines() == [str(n) for n in range(1000 - SHOWN_LINES, 1000)]


def test_of_make_s_flags_a_stage_gets_the_variables_alone(tmp_path):
    report = tmp_path / "live.xml"
    passed = {"MAKEFLAGS": "-- VENV=.other", "PYTEST_ADDOPTS": "-x", "HOME": "/root"}
    flags = {"MAKEFLAGS": "kw -j4 --jobserver-auth=3,4 -- VENV=.other", "MFLAGS": "-kw"}
    own = passed | flags | {"MAKELEVEL": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    options = {"PYTEST_ADDOPTS": f"-x --junit-xml={report}"}
    assert environment(own, report) == passed | options
    assert "MAKEFLAGS" not in environment({"MAKEFLAGS": "w"}, report)


def test_a_failed_stage_shows_its_failures_and_fails_the_whole(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    broken = python("broken", "print('=== ERRORS ==='); print('why'); raise SystemExit(3)")
    beside = [[broken], [python("beside", "pass")]]
    assert main([[python("good", "print('quiet')")], [beside, python("last", "pass")]]) == 1
    said = capsys.readouterr().out.splitlines()
    stages = [line.split()[0] for line in said if line[:1].isalpha() and " s  " in line]
    assert max(stages.index("broken"), stages.index("beside")) < stages.index("last")
    assert sorted(stages[:-1]) == ["beside", "broken", "good", "last"]
    assert stages[-1] == "all"
    assert "=== ERRORS ===" in said
    assert "why" in said
    assert "quiet" not in said
    assert (tmp_path / "test-logs" / "good.log").read_text() == "quiet\n"


def test_all_is_well_where_every_stage_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTEST_ADDOPTS", raising=False)
    results = "import os, re, pathlib; pathlib.Path(re.search('xml=(.*)', os.environ['PYTEST_ADDOPTS'])[1])"
    program = f'{results}.write_text("""{RESULTS}""")'
    assert main([[python("good", program)]]) == 0
    stage, whole = capsys.readouterr().out.splitlines()
    assert stage.endswith("4 passed, 2 failed, 1 errors, 3 skipped")
    assert whole.endswith("(2: set PX4 to the program; 1: no mosquitto)")
