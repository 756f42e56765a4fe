"""What a companion did, step by step, as a file of comma-separated values beside its telemetry log.

What was sent is in the telemetry log, too; this adds why: the mode, the limits, the Lyapunov function.
"""

import csv
import math
from bisect import bisect_right
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

SUFFIX = ".guidance.csv"
"""Follows the vehicle's name."""

COLUMNS = ("time_s", "mode", "course_rad", "speed_m_s", "limited", "lyapunov_m2")


@dataclass(frozen=True, slots=True, kw_only=True)
class GuidanceStep:
    """One step of guidance, or a change of the supervisor's mode."""

    time_s: float
    """On the companion's own clock, s."""
    mode: str
    """Of the supervisor."""
    course_rad: float
    """Last course setpoint sent; NaN before the first."""
    speed_m_s: float
    """Last setpoint of airspeed or ground speed sent, whichever the vehicle holds; NaN before the first."""
    limited: bool
    """Whether a limit of the vehicle cut it."""
    lyapunov_m2: float
    """W, m²; NaN for the leader."""


class GuidanceLog:
    """Collects steps, written all at once: a control loop waits for no disk."""

    def __init__(self) -> None:
        self._steps: list[GuidanceStep] = []

    def add(self, step: GuidanceStep) -> None:
        """Note a step."""
        self._steps.append(step)

    def write(self, path: Path) -> None:
        """Write what was collected."""
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(COLUMNS)
            for step in self._steps:
                numbers = (step.course_rad, step.speed_m_s, int(step.limited), step.lyapunov_m2)
                writer.writerow((f"{step.time_s:.6f}", step.mode, *numbers))


class GuidanceTrack:
    """What a companion had last done, by time."""

    def __init__(self, steps: list[GuidanceStep]) -> None:
        """Take steps in the order of their times."""
        self._steps = steps
        self._times_s = [step.time_s for step in steps]

    def at(self, time_s: float) -> GuidanceStep | None:
        """The newest step that is not later than this; None before the first."""
        count = bisect_right(self._times_s, time_s)
        return self._steps[count - 1] if count else None


def read_guidance(path: Path, *, zero_s: float = 0.0) -> GuidanceTrack:
    """What a companion did.

    Args:
        path: of the file. One that is missing or cut off holds what can be read of it: a companion that is
            killed leaves none.
        zero_s: the companion's clock at time 0 of the flight.
    """
    steps: list[GuidanceStep] = []
    with (
        suppress(OSError, ValueError, TypeError, LookupError, csv.Error),
        path.open(newline="", encoding="utf-8") as file,
    ):
        steps.extend(_step(row, zero_s) for row in csv.DictReader(file))
    return GuidanceTrack(sorted(steps, key=lambda step: step.time_s))


def _step(row: dict[str, str], zero_s: float) -> GuidanceStep:
    time_s = float(row["time_s"]) - zero_s
    if not math.isfinite(time_s):
        raise ValueError("a time is none")
    return GuidanceStep(
        time_s=time_s,
        mode=row["mode"],
        course_rad=float(row["course_rad"]),
        speed_m_s=float(row["speed_m_s"]),
        limited=bool(int(row["limited"])),
        lyapunov_m2=float(row["lyapunov_m2"]),
    )
