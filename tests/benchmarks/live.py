"""The article's missions live, held against what they ask for in virtual time: run with `make live`.

Real sockets, a process for each program; 5 times as fast as real time, one flight after
another, then in real time, all four at once. Takes ten minutes. Exit status 1 if a flight is not good enough.
"""

import json
import subprocess
import sys
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from tests.kit.figures import cell, tell
from tests.kit.missions import MISSIONS, shipped

ARTICLE = ("line-calm", "line-wind", "circle-calm", "circle-wind")

ALLOWANCE_M = 0.1
"""By which the mean error may be greater than the mission asks for in virtual time."""

AT_ONCE = {5.0: 1, 1.0: len(ARTICLE)}
"""Flights at the same time, by speed-up."""

HEADINGS = ("mean", "allowed", "95 %", "max", "10 m", "1 m", "nearest", "resp. ms", "age ms")


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


def main() -> int:
    """Fly everything, print the table and return the exit status."""
    tell(f"{'metres, seconds':28}" + "".join(f"{heading:>9}" for heading in HEADINGS))
    good = True
    for speedup, at_once in AT_ONCE.items():
        with ThreadPoolExecutor(at_once) as pool:
            flights = pool.map(lambda name, times=speedup: fly(name, times), ARTICLE)
            for name, summary in zip(ARTICLE, flights, strict=True):
                mean_m = summary["formation"]["mean_error_m"]
                good = good and mean_m is not None and mean_m <= allowed_m(name)
                values = row(name, summary)
                tell(f"{f'{name}, {speedup:g} x':28}" + "".join(cell(value, 9) for value in values))
    return 0 if good else 1


def row(name: str, summary: dict[str, Any]) -> Iterable[float | None]:
    """The figures of one flight."""
    formation, latency = summary["formation"], summary["latency"]
    yield formation["mean_error_m"]
    yield allowed_m(name)
    for key in ("p95_error_m", "max_error_m", "settle_10m_s", "settle_1m_s", "min_separation_m"):
        yield formation[key]
    for key in ("response_ms", "leader_age_ms"):
        yield latency[key]["p99"] if latency[key] else None


if __name__ == "__main__":
    sys.exit(main())
