"""The example of a law of one's own, as its author uses it: by command line, from a directory of theirs."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kit.missions import MISSIONS, ROOT

MISSION = MISSIONS / "line-calm.yaml"

Run = Callable[..., subprocess.CompletedProcess[str]]


STUDIES = """
import json
from dataclasses import replace
from pathlib import Path
from vfguide.lab.studies.comparison import Extent, ablation_cases, cases, row_json, rows
from vfguide.lab.studies.flown import fly
from vfguide.lab.studies.monte_carlo import fly_point, points
from vfguide.registry import use_plugins

use_plugins([Path("own_law.py")])
short = Extent(duration_s=6.0, seeds=1, bad_link_plants=())
compared, switched, swept = {}, {}, {}
for law in ("pursuit", "slot"):
    (case, *_) = cases(short, [law])
    ((row,)) = rows([(case, fly(case)[0])])
    compared[law] = row_json(row)["mean"]["mean_error_m"]
    parts = ablation_cases(law, quick=True)
    case = next(one for one in parts if one.label == "no wind filter")
    figures, _ = fly(replace(case, changes=case.changes | {"rehearsal": {"duration_s": 6.0}}))
    switched[law] = figures.mean_error_m
    swept[law] = {}
    for sweep in ("delay", "alpha"):
        point = next(one for one in points([law], quick=True) if one.sweep == sweep)
        swept[law][sweep] = fly_point(replace(point, duration_s=6.0)).mean_error_m
print(json.dumps({"compared": compared, "switched": switched, "swept": swept}))
"""
"""A flight of each study of `bench` by the own law and by the field, for six seconds instead of minutes."""


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs vfguide in a directory that holds nothing but the law."""
    shutil.copy(ROOT / "examples" / "own_law.py", tmp_path)

    def start(
        *arguments: str | Path, plugin: str | None = "own_law.py"
    ) -> subprocess.CompletedProcess[str]:
        chosen = () if plugin is None else ("--plugin", plugin)
        return elsewhere("vfguide", *arguments, *chosen)

    return start


PURSUIT = ("--controller", "pursuit", "--set", "controller.lookahead_m=25")


def test_it_is_flown_and_reported_under_its_name(run, tmp_path):
    flown = run("fly", MISSION, *PURSUIT, "--duration", "40", "--out", "flight")
    assert flown.returncode == 0, flown.stderr
    summary = json.loads((tmp_path / "flight" / "summary.json").read_text())
    assert summary["controller"] == "pursuit"
    assert summary["formation"]["mean_error_m"] < 0.5
    assert "pursuit" in (tmp_path / "flight" / "report.html").read_text()


def test_a_mission_file_may_name_it(run, tmp_path):
    own = "controller: {type: pursuit, lookahead_m: 25}"
    text = re.sub(r"controller: \{[^}]*\}", own, MISSION.read_text())
    assert own in text
    (tmp_path / "own.yaml").write_text(text)
    checked = run("check", "own.yaml")
    assert checked.returncode == 0, checked.stderr
    (metres,) = re.findall(r"expect (\d+\.\d\d) m of mean formation error", checked.stdout)
    assert float(metres) < 0.5
    # By the name in the mission alone nothing is loaded.
    unknown = run("check", "own.yaml", plugin=None)
    assert unknown.returncode == 2
    assert "'pursuit' is not known; use one of: slot, article, pid, mpc" in unknown.stderr


def test_studies_fly_it_and_no_other_in_its_place(run):
    study = ("bench", "monte-carlo", "--formations", "1", "--processes", "1", "--seed", "3")
    pursuit, field = run(*study, "--law", "pursuit"), run(*study)
    assert pursuit.returncode == 0, pursuit.stderr
    assert pursuit.stdout.startswith("pursuit: 1 formations")
    assert pursuit.stdout.splitlines()[2] != field.stdout.splitlines()[2]


def test_each_study_flies_it_and_no_other_in_its_place(tmp_path, elsewhere):
    shutil.copy(ROOT / "examples" / "own_law.py", tmp_path)
    (tmp_path / "studies.py").write_text(STUDIES)
    flown = elsewhere("studies")
    assert flown.returncode == 0, flown.stderr
    found = json.loads(flown.stdout)
    for study in (found["compared"], found["switched"]):
        assert study["pursuit"] != study["slot"]
        assert 0.0 < study["pursuit"] < 100.0
    assert found["swept"]["pursuit"].keys() == found["swept"]["slot"].keys()
    for sweep, error_m in found["swept"]["pursuit"].items():
        assert error_m != found["swept"]["slot"][sweep]


@pytest.mark.parametrize(
    ("arguments", "plugin", "said"),
    [
        (["--set", "controller.lookahead_m=-3"], "own_law.py", "-3 is too small; choose above 0"),
        (["--set", "controller.lokahead_m=3"], "own_law.py", "did you mean 'lookahead_m'?"),
        ([], None, "pursuit: there is no such law; known are slot, article, pid, mpc"),
        ([], "absent.py", "absent.py: there is no such file of Python"),
        ([], "broken.py", "broken.py:2: NameError"),
    ],
)
def test_what_is_wrong_is_one_line(run, tmp_path, arguments, plugin, said):
    (tmp_path / "broken.py").write_text("import math\nmath.pi + tau\n")
    refused = run("check", MISSION, "--controller", "pursuit", *arguments, plugin=plugin)
    assert refused.returncode == 2
    assert said in refused.stderr
    assert len(refused.stderr.splitlines()) == 1
