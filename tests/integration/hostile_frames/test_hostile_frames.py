import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parents[2] / "benchmarks" / "hostile_frames.py"


@pytest.mark.parametrize("target", ["ardupilot", "px4", "companion"])
def test_ten_thousand_hostile_frames_raise_nothing_and_leave_nothing(target):
    finished = subprocess.run(
        [sys.executable, str(PROGRAM), "--frames", "10000", "--targets", target],
        capture_output=True,
        text=True,
        check=False,
    )
    assert finished.returncode == 0, finished.stdout + finished.stderr
