"""The example of a path of one's own, as its author uses it: by command line, from a directory of theirs."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.kit.missions import ROOT

EIGHT = ("--set", "path={type: lissajous}", "--set", "rehearsal.start={}")

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs vfguide in a directory that holds nothing but the path."""
    shutil.copy(ROOT / "examples" / "own_path.py", tmp_path)

    def start(
        *arguments: str, plugin: str | None = "own_path.py"
    ) -> subprocess.CompletedProcess[str]:
        chosen = () if plugin is None else ("--plugin", plugin)
        return elsewhere("vfguide", *arguments, *chosen)

    return start


def test_a_formation_flies_both_loops_of_the_eight_and_crosses_it_in_its_slots(run):
    flown = run("fly", "circle-calm", *EIGHT, "--duration", "200", "--json")
    assert flown.returncode == 0, flown.stderr
    summary = json.loads(flown.stdout)
    assert summary["formation"]["mean_error_m"] < 0.05
    assert summary["vehicles"]["leader"]["cross_track_error_m"]["max"] < 0.05


def test_a_formation_flies_over_itself_where_the_eight_has_a_bridge(run):
    bridge = ("--set", "path={type: lissajous, bridge_m: 40}", "--set", "rehearsal.start={}")
    flown = run("fly", "circle-calm", *bridge, "--duration", "200", "--json")
    assert flown.returncode == 0, flown.stderr
    summary = json.loads(flown.stdout)
    assert summary["formation"]["mean_error_m"] < 0.05
    assert summary["formation"]["mean_error_3d_m"] < 0.1
    # Ten times as high on the same way is ten times as steep.
    checked = run("check", "circle-calm", "--set", "path={type: lissajous, bridge_m: 400}")
    assert checked.returncode == 2
    assert "the path climbs at up to" in checked.stdout


def test_a_mission_file_may_name_it(run, tmp_path):
    mission = yaml.safe_load((ROOT / "missions" / "circle-calm.yaml").read_text())
    mission["path"] = {"type": "lissajous", "half_length_m": 600}
    mission["rehearsal"].pop("start", None)
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(mission))
    checked = run("check", "own.yaml")
    assert checked.returncode == 0, checked.stderr
    unknown = run("check", "own.yaml", plugin=None)
    assert unknown.returncode == 2
    assert (
        "'lissajous' is not known; use one of: line, circle, helix, racetrack, figure-eight, waypoints, plan"
        in unknown.stderr
    )


def test_turns_that_are_too_tight_for_the_vehicles_are_found(run):
    # its tightest turns have a radius of 23.9 m, beside where it is widest: atan(20²/23.9/9.81) = 60 degrees
    refused = run("check", "circle-calm", "--set", "path={type: lissajous, half_length_m: 200}")
    assert refused.returncode == 2
    assert "'leader' has to bank 60°" in refused.stdout
    assert "widen the path's turns" in refused.stdout


RAISES = """
from vfguide.paths import Path, PathPlace, PathShape, path

@path("raising")
class Raising(Path):
    Shape = PathShape
    length = 1000.0

    @classmethod
    def of(cls, shape):
        return cls()

    def nearest(self, north, east, course=None):
        return 1.0 / 0.0

    def at(self, progress):
        return PathPlace(progress, progress, 0.0 * progress, 0.0 * progress)
"""


def test_a_path_that_raises_is_one_line_with_the_place_in_its_file(run, tmp_path):
    (tmp_path / "raising.py").write_text(RAISES)
    refused = run("check", "line-calm", "--set", "path={type: raising}", plugin="raising.py")
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line.endswith("raising.py:14: ZeroDivisionError: float division by zero; mend the file")


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ("{type: lissajous, half_length_m: -3}", "-3 is too small; choose above 0"),
        ("{type: lissajous, half_lenght_m: 3}", "did you mean 'half_length_m'?"),
        ("{type: lissajous, centre: {north: 3}}", "did you mean 'north_m'?"),
        ("{type: lissajoux}", "did you mean 'lissajous'?"),
        (
            "{half_length_m: 3}",
            "add one of: line, circle, helix, racetrack, figure-eight, waypoints, plan, lissajous",
        ),
    ],
)
def test_what_is_wrong_is_one_line(run, fields, said):
    refused = run("check", "circle-calm", "--set", f"path={fields}")
    assert refused.returncode == 2
    assert said in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
