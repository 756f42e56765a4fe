"""The example of an autopilot of one's own, as its author uses it: from a directory of theirs."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
ALL = tuple(f"vehicles.{name}.autopilot=brief" for name in ("leader", "f1", "f2", "f3"))

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs vfguide in a directory that holds nothing but the autopilot."""
    shutil.copy(ROOT / "examples" / "own_autopilot.py", tmp_path)

    def start(
        *arguments: str, plugin: str | None = "own_autopilot.py"
    ) -> subprocess.CompletedProcess[str]:
        chosen = () if plugin is None else ("--plugin", plugin)
        return elsewhere("vfguide", *arguments, *chosen)

    return start


def test_a_whole_formation_flies_by_it_as_by_vfguides_own(run: Run) -> None:
    settings = [word for one in ALL for word in ("--set", one)]
    flown = run("fly", "circle-calm", *settings, "--duration", "60", "--json")
    assert flown.returncode in (0, 1), flown.stderr
    own = json.loads(flown.stdout)
    assert own["formation"]["mean_error_m"] < 0.1
    assert own["formation"]["settle_1m_s"] < 40.0


def test_a_name_that_is_not_known_is_one_line_with_those_that_are(run: Run) -> None:
    refused = run("check", "circle-calm", "--set", "vehicles.f1.autopilot=brief", plugin=None)
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        "--set vehicles.f1.autopilot: 'brief' is not known; use one of: auto, ardupilot, px4, mavsdk"
    ]
    near = run("check", "circle-calm", "--set", "vehicles.f1.autopilot=breif")
    assert "did you mean 'brief'?" in near.stderr


def test_an_adapter_that_leaves_something_out_is_one_line(run: Run, tmp_path: Path) -> None:
    text = (tmp_path / "own_autopilot.py").read_text()
    before, after = text.index("    def hand_back"), text.index("    def fly")
    (tmp_path / "partly.py").write_text(text[:before] + text[after:])
    refused = run("fly", "circle-calm", "--set", "vehicles.f1.autopilot=brief", plugin="partly.py")
    assert refused.returncode == 2, refused.stdout
    (line,) = refused.stderr.splitlines()
    assert re.search(r"partly\.py:\d+: the autopilot brief has no hand_back; write it$", line)
