"""The article's missions live, held against what they ask for in virtual time.

Real sockets, a process for each program; 5 times as fast as real time, one flight after
another, then in real time, all four at once. Takes ten minutes.
"""

import json
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from tests.benchmarks.results import Cases
from tests.kit.missions import MISSIONS, shipped
from vfguide.lab.studies.flown import ARTICLE_ERROR_M

ALLOWANCE_M = 0.1
"""By which the mean error may be greater than the mission asks for in virtual time."""

AT_ONCE = {5.0: ("fast_m", 1), 1.0: ("real_m", len(ARTICLE_ERROR_M))}
"""Figure, and flights at the same time, by speed-up."""


def fly(name: str, speedup: float) -> dict[str, Any]:
    """Summary of one mission, as the command prints it."""
    command = [sys.executable, "-m", "vfguide", "fly", str(MISSIONS / f"{name}.yaml")]
    command += ["--live", "--json", f"--speedup={speedup:g}"]
    # Status 1 is a flight that was not accepted, which the summary tells, too.
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in {0, 1}:
        raise SystemExit(f"{name}: {done.stderr}")
    summary: dict[str, Any] = json.loads(done.stdout)
    return summary


def allowed_m(name: str) -> float:
    """Mean error that a live flight of a mission may have, m."""
    asked_m = shipped(name).acceptance.mean_error_m
    assert asked_m is not None
    return asked_m + ALLOWANCE_M


def cases() -> Cases:
    """Fly everything, 5 times as fast as real time and then in real time."""
    found: dict[str, dict[str, float | None]] = {
        name: {"allowed_m": allowed_m(name)} for name in ARTICLE_ERROR_M
    }
    for speedup, (key, at_once) in AT_ONCE.items():
        with ThreadPoolExecutor(at_once) as pool:
            flights = pool.map(lambda name, times=speedup: fly(name, times), ARTICLE_ERROR_M)
            for name, summary in zip(ARTICLE_ERROR_M, flights, strict=True):
                found[name][key] = summary["formation"]["mean_error_m"]
    yield from found.items()
