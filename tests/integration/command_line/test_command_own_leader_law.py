"""The example of a leader's law of one's own, as its author uses it: from a directory of theirs."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kit.missions import ROOT

CARROT = ("--plugin", "own_leader_law.py", "--set", "leader.law=carrot")

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs vfguide in a directory that holds nothing but the law."""
    shutil.copy(ROOT / "examples" / "own_leader_law.py", tmp_path)
    return elsewhere


def test_the_leader_flies_by_it_and_its_gain_counts(run):
    # Started 30 m beside its line, a leader that aims 40 m ahead decays to it with about 40 m: 20 s at
    # 20 m/s are ten of them. One that aims 400 m ahead is still on its way: after 40 s 30 m e^(-2) are 4 m.
    errors = []
    for ahead in (40, 400):
        flown = run(
            *("vfguide", "fly", "line-calm", *CARROT, "--set", f"leader.gains.lookahead_m={ahead}"),
            *("--duration", "40", "--json"),
        )
        assert flown.returncode in (0, 1), flown.stderr
        leader = json.loads(flown.stdout)["vehicles"]["leader"]
        errors.append(leader["cross_track_error_m"]["mean"])
    near, far = errors
    assert near < 0.05
    assert far > 4.0


def test_studies_of_many_formations_fly_it_too(run):
    study = ("bench", "monte-carlo", "--formations", "1", "--processes", "1")
    flown = run("vfguide", *study, "--plugin", "own_leader_law.py")
    assert flown.returncode == 0, flown.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ("--set", "leader.law=carrot"),
            "--set leader.law: 'carrot' is not known; use one of: field",
        ),
        (
            (*CARROT, "--set", "leader.gains.lookahad_m=3"),
            "carrot does not take these gains (lookahad_m: Extra inputs are not permitted); it has look",
        ),
        (
            (*CARROT, "--set", "leader.gains.lookahead_m=-3"),
            "lookahead_m: Input should be greater than 0",
        ),
    ],
)
def test_what_is_wrong_is_one_line(run, arguments, said):
    refused = run("vfguide", "check", "line-calm", *arguments)
    assert refused.returncode == 2, refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert said in refused.stderr
