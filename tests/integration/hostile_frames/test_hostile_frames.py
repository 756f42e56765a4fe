import subprocess
import sys

import pytest

from tests.kit.missions import ROOT

PROGRAM = "tests.benchmarks.hostile_frames"


@pytest.mark.parametrize("target", ["ardupilot", "px4", "companion", "follower", "member"])
def test_ten_thousand_hostile_frames_raise_nothing_and_leave_nothing(target):
    finished = subprocess.run(
        [sys.executable, "-m", PROGRAM, "--frames", "10000", "--targets", target],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
