"""The example of a plant of one's own, as its author uses it: by command line, from a directory of theirs."""

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.kit.missions import ROOT

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run) -> Run:
    """Runs a program in a directory that holds nothing but the plant."""
    shutil.copy(ROOT / "examples" / "own_plant.py", tmp_path)
    return elsewhere


def test_a_mission_is_flown_by_it_and_its_numbers_count(run):
    figures = []
    for damping in (0.8, 0.2):
        option = f"rehearsal.emulator.plant_options.course_damping={damping}"
        own = ("--plugin", "own_plant.py", "--plant", "measured", "--set", option)
        flown = run("vfguide", "fly", "circle-calm", *own, "--duration", "60", "--json")
        assert flown.returncode in (0, 1), flown.stderr
        summary = json.loads(flown.stdout)
        assert summary["plant"] == "measured"
        figures.append(summary["formation"]["mean_error_m"])
    usual, swinging = figures
    assert usual < 5.0
    assert swinging > 2.0 * usual


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--plant", "measured"), "--plant: 'measured' is not known; use one of: course-hold, "),
        (
            ("--plugin", "own_plant.py", "--set", "rehearsal.emulator.plant=mesured"),
            "did you mean 'measured'?",
        ),
        (
            (
                *("--plugin", "own_plant.py", "--plant", "measured", "--set"),
                "rehearsal.emulator.plant_options.curse=1",
            ),
            "rehearsal.emulator: measured has no option curse; it has course_damping, ",
        ),
    ],
)
def test_what_is_wrong_in_a_mission_is_one_line(run, arguments, said):
    refused = run("vfguide", "fly", "circle-calm", *arguments)
    assert refused.returncode == 2, refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert said in refused.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--plant", "measured"), "--plant: measured is not one of heading-hold, course-hold"),
        (("--plugin", "absent.py"), "--plugin absent.py: there is no such file of Python"),
        (
            ("--plugin", "own_plant.py", "--plant", "measured", "--plant-option", "curse=1"),
            "measured has no option curse",
        ),
        (
            ("--plugin", "own_plant.py", "--plant", "measured", "--plant-option", "curse"),
            "--plant-option: curse is not NAME=VALUE",
        ),
    ],
)
def test_what_is_wrong_for_the_emulator_alone_is_one_line(run, arguments, said):
    link = ("--system-id", "1", "--mavlink", "udpout://127.0.0.1:9")
    refused = run("sitl_stub", *link, "--airborne", *arguments)
    assert refused.returncode == 2, refused.stderr
    assert len(refused.stderr.splitlines()) == 1
    assert said in refused.stderr
