"""What an aircraft's computer has: vfguide without any of its extras."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from vfguide.errors import extras_by_module

EXAMPLES = Path(__file__).parents[3] / "examples"

HIDING = """\
import sys
from importlib.machinery import PathFinder

HIDDEN = {hidden!r}


class Others(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in HIDDEN else super().find_spec(name, path, target)


sys.meta_path[sys.meta_path.index(PathFinder)] = Others
"""
"""Loaded by Python at its start."""

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(tmp_path: Path, elsewhere: Run, monkeypatch: pytest.MonkeyPatch) -> Run:
    """Runs a program where no library is found that only an extra brings."""
    hidden = sorted(extras_by_module())
    assert {"matplotlib", "scipy", "osqp", "PIL", "psutil", "pandas", "mavsdk"} <= {*hidden}
    place = tmp_path / "start"
    place.mkdir()
    (place / "sitecustomize.py").write_text(HIDING.format(hidden=hidden))
    monkeypatch.setenv("PYTHONPATH", str(place))
    return elsewhere


def test_the_companion_starts_and_missions_are_checked_and_flown(run, pair_with):
    daemon = run("vfguide.companion.daemon")
    assert daemon.returncode == 0, daemon.stderr
    assert run("vfguide", "companion", "--help").returncode == 0
    # a curve of the user's own
    circle = "{type: circle, centre: {north_m: 150, east_m: 0}, radius_m: 150, gain: 0.015}"
    mission = pair_with((circle, "{type: lissajous}"))
    plugin = ("--plugin", str(EXAMPLES / "own_path.py"), "--set", "rehearsal.rate_hz=10")
    eight = run("vfguide", "check", mission, *plugin)
    assert eight.returncode == 0, eight.stderr
    flown = run("vfguide", "fly", "line-calm", "--duration", "5")
    assert flown.returncode == 1, flown.stderr
    assert "Not accepted" in flown.stdout


FROM_PYTHON = """
import vfguide
mission = vfguide.load_mission("line-calm")
flight = vfguide.fly(mission, duration_s=5, settings={"rehearsal.start": {}})
print(round(flight.time_s[-1]), len(vfguide.compare(mission, laws=["pid"], duration_s=5)))
for needs in (
    lambda: vfguide.fly(mission, law="mpc", duration_s=5),
    lambda: vfguide.fly(mission, live=True),
    lambda: flight.report("flight"),
    flight.to_dataframe,
):
    try:
        needs()
    except ImportError as error:
        print(error)
"""


def test_python_flies_and_says_what_to_install_for_the_rest(run, tmp_path):
    (tmp_path / "program.py").write_text(FROM_PYTHON)
    said = run("program")
    assert said.stderr == ""
    needed = (("osqp", "lab"), ("psutil", "lab"), ("matplotlib", "lab"), ("pandas", "files"))
    assert said.stdout.splitlines() == [
        "5 1",
        *(
            f"this needs {library}, which is not installed: pip install 'vfguide[{extra}]'"
            for library, extra in needed
        ),
    ]


@pytest.mark.parametrize(
    ("arguments", "library", "extra"),
    [
        (("fly", "line-calm", "--duration", "5", "--out", "flight"), "matplotlib", "lab"),
        (("fly", "line-calm", "--duration", "5", "--controller", "mpc"), "osqp", "lab"),
        (("fly", "line-calm", "--duration", "5", "--live"), "psutil", "lab"),
        (("status", "line-calm", "--insecure", "--link", "zenoh://"), "zenoh", "zenoh"),
        (("bench", "--quick"), "osqp", "lab"),
        (("bench", "robustness", "--quick"), "osqp", "lab"),
    ],
)
def test_what_needs_more_says_what_to_install_before_it_begins(
    run, tmp_path, arguments, library, extra
):
    refused = run("vfguide", *arguments)
    assert refused.returncode == 3, refused.stderr
    said = f"this needs {library}, which is not installed: pip install 'vfguide[{extra}]'"
    assert refused.stderr.splitlines()[-1] == said
    assert "flying" not in refused.stderr
    assert not (tmp_path / "flight").exists()
