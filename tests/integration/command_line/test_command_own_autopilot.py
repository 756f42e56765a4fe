"""The example of an autopilot of one's own, as its author uses it: from a directory of theirs."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kit.missions import ROOT

ALL = tuple(f"vehicles.{name}.autopilot=brief" for name in ("leader", "f1", "f2", "f3"))

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs vfguide in a directory that holds nothing but the autopilot."""
    for name in ("own_autopilot.py", "own_emulated_autopilot.py"):
        shutil.copy(ROOT / "examples" / name, tmp_path)

    def start(
        *arguments: str, plugin: str | None = "own_autopilot.py"
    ) -> subprocess.CompletedProcess[str]:
        chosen = () if plugin is None else ("--plugin", plugin)
        return elsewhere("vfguide", *arguments, *chosen)

    return start


def test_a_whole_formation_flies_by_it_as_by_vfguides_own(run):
    settings = [word for one in ALL for word in ("--set", one)]
    flown = run("fly", "circle-calm", *settings, "--duration", "60", "--json")
    assert flown.returncode in (0, 1), flown.stderr
    own = json.loads(flown.stdout)
    assert own["formation"]["mean_error_m"] < 0.1
    assert own["formation"]["settle_1m_s"] < 40.0


def test_a_name_that_is_not_known_is_one_line_with_those_that_are(run):
    refused = run("check", "circle-calm", "--set", "vehicles.f1.autopilot=brief", plugin=None)
    assert refused.returncode == 2
    assert refused.stderr.splitlines() == [
        "--set vehicles.f1.autopilot: 'brief' is not known; use one of: auto, ardupilot, px4, mavsdk"
    ]
    near = run("check", "circle-calm", "--set", "vehicles.f1.autopilot=breif")
    assert "did you mean 'brief'?" in near.stderr


def test_an_adapter_that_leaves_something_out_is_one_line(run, tmp_path):
    text = (tmp_path / "own_autopilot.py").read_text()
    before, after = text.index("    def hand_back"), text.index("    def fly")
    (tmp_path / "partly.py").write_text(text[:before] + text[after:])
    refused = run("fly", "circle-calm", "--set", "vehicles.f1.autopilot=brief", plugin="partly.py")
    assert refused.returncode == 2, refused.stdout
    (line,) = refused.stderr.splitlines()
    assert re.search(r"partly\.py:\d+: the autopilot brief has no hand_back; write it$", line)


def test_a_formation_flies_against_an_emulated_autopilot_of_the_user_s(run):
    chosen = ("--set", "rehearsal.emulator.autopilot=brief", "--duration", "60", "--json")
    flown = run("fly", "circle-calm", *chosen, plugin="own_emulated_autopilot.py")
    assert flown.returncode in (0, 1), flown.stderr
    # its aircraft is the mission's, of first order
    assert json.loads(flown.stdout)["formation"]["mean_error_m"] < 0.1
    refused = run("fly", "circle-calm", *chosen, plugin=None)
    assert refused.returncode == 2
    assert "'brief' is not known; use one of: ardupilot, px4" in refused.stderr


def test_the_emulator_is_started_with_it_by_its_name(elsewhere, run):
    del run  # it has put the file there
    options = ("--system-id", "1", "--mavlink", "udpin://127.0.0.1:0", "--autopilot", "brief")
    ended = elsewhere(
        *("sitl_stub", *options, "--plugin", "own_emulated_autopilot.py", "--airborne"),
        *("--duration", "1", "--speedup", "100"),
    )
    assert ended.returncode == 0, ended.stderr
    refused = elsewhere("sitl_stub", *options)
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert line == "sitl-stub: --autopilot: brief is not one of ardupilot, px4"
