"""Flying from Python, as the documentation shows it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import vfguide
from vfguide.errors import InputError
from vfguide.laws import Law

ROOT = Path(__file__).parents[3]
MISSION = ROOT / "missions" / "line-calm.yaml"


def test_a_flight_has_its_figures_and_its_data_by_vehicle(tmp_path: Path) -> None:
    mission = vfguide.load_mission(str(MISSION))
    flight = vfguide.fly(mission, duration_s=20.0, seed=2, settings={"controller.k_x": 0.3})
    assert list(flight.tracks) == ["leader", "f1", "f2", "f3"]
    assert flight.time_s.shape == flight.tracks["f2"].north_m.shape == (401,)
    assert flight.tracks["f2"].north_m.dtype == np.float64
    window = flight.time_s >= 10.0
    mean = np.mean([error.distance_m[window] for error in flight.errors.values()])
    assert flight.summary.formation.mean_error_m == pytest.approx(mean)
    assert (flight.summary.seed, flight.summary.duration_s) == (2, 20.0)
    flight.report(tmp_path / "out")
    assert (tmp_path / "out" / "report.html").exists()
    # What is flown is what the mission says, but for what is given.
    usual = vfguide.fly(mission, duration_s=20.0, seed=2)
    assert not np.array_equal(usual.tracks["f1"].north_m, flight.tracks["f1"].north_m)


def test_laws_are_compared_over_the_same_seeds() -> None:
    mission = vfguide.load_mission(MISSION)
    found = vfguide.compare(mission, laws=["slot", "pid"], seeds=[1, 2], duration_s=3.0)
    assert [(one.law, one.seed) for one in found] == [
        ("slot", 1),
        ("slot", 2),
        ("pid", 1),
        ("pid", 2),
    ]
    assert [one.summary.controller for one in found] == ["slot", "slot", "pid", "pid"]


def test_what_cannot_be_flown_is_said() -> None:
    mission = vfguide.load_mission(MISSION)
    with pytest.raises(InputError, match="solt: there is no such law; known are slot, article"):
        vfguide.fly(mission, law="solt")
    with pytest.raises(InputError, match=r"controller\.k_z: unknown field"):
        vfguide.fly(mission, settings={"controller.k_z": 1.0})
    with pytest.raises(InputError, match="boundary_layer_factor"):
        vfguide.fly(mission, settings={"controller.boundary_layer_factor": 0.1})
    with pytest.raises(InputError, match="Nameless: the law has no name"):
        vfguide.fly(mission, law=type("Nameless", (Law,), {}))


def test_the_public_names_are_those_that_are_documented() -> None:
    assert dir(vfguide) == sorted(vfguide.__all__)
    with pytest.raises(AttributeError, match="no attribute 'flee'"):
        vfguide.flee  # noqa: B018


def test_the_example_runs_where_it_is_copied_to(tmp_path: Path) -> None:
    for name in ("fly_in_python.py", "own_law.py"):
        shutil.copy(ROOT / "examples" / name, tmp_path)
    ran = subprocess.run(
        [sys.executable, "fly_in_python.py", MISSION],
        cwd=tmp_path,
        env={**os.environ, "VFGUIDE_PLUGINS": ""},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.startswith("mean error over the last half: 0.0")
    assert "pursuit, seed 1: " in ran.stdout
