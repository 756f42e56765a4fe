"""What a companion did, step by step, as a file of comma-separated values beside its telemetry log.

What was sent is in the telemetry log, too; this adds why: the mode, the limits, the Lyapunov function; and
the formation's clock, by which the recordings of several aircraft fit together. A line is whole once its
line feed is written: what a killed companion leaves is read up to there.
"""

import csv
import math
from bisect import bisect_right
from collections.abc import Sequence
from contextlib import suppress
from io import SEEK_END, TextIOWrapper
from pathlib import Path

import msgspec

from vfguide.formation.arrangement import MAIN_PATH
from vfguide.regular_file import open_regular, whole_lines

SUFFIX = ".guidance.csv"
"""Follows the vehicle's name."""

COLUMNS = (
    "time_s",
    "mode",
    "course_rad",
    "speed_m_s",
    "limited",
    "lyapunov_m2",
    "formation_time_s",
    "slot_forward_m",
    "slot_right_m",
    "slot_up_m",
    "lead_term",
    "lead_time_s",
    "lead_north_m",
    "lead_east_m",
    "lead_course_rad",
    "lead_height_m",
    "leader_age_s",
    "left",
    "path",
)

LATER_COLUMNS = COLUMNS[COLUMNS.index("slot_forward_m") : COLUMNS.index("left")]
"""Numbers that are most often unknown, and then empty; files of earlier versions have none of them."""

NO_PATH = "-"
"""In the last column where no path is followed, which is no path's name; empty stands for the main one."""

HEADER = (",".join(COLUMNS) + "\n").encode()
"""First line of the file."""

NEWEST_BYTES = 8192
"""Length of a growing file's end that is read: some 40 steps, 2 s at 20 Hz."""


class GuidanceStep(msgspec.Struct, frozen=True, kw_only=True):
    """One step of guidance, or a change of the supervisor's mode."""

    time_s: float
    """On the companion's own clock, s."""
    mode: str
    """Mode of the supervisor."""
    course_rad: float
    """Last course setpoint sent; NaN before the first."""
    speed_m_s: float
    """Last setpoint of airspeed or ground speed sent, whichever the vehicle holds; NaN before the first."""
    limited: bool
    """Whether a limit of the vehicle cut it."""
    lyapunov_m2: float
    """W, m²; NaN for the leader."""
    formation_time_s: float = math.nan
    """Time of the step on the leader's clock, s; NaN while that is not known."""
    slot_forward_m: float = math.nan
    """Slot ahead of the leader that was ordered; NaN while the mission's counts, and for the leader."""
    slot_right_m: float = math.nan
    """The slot, m to the right of the leader."""
    slot_up_m: float = math.nan
    """The slot, m above the leader."""
    lead_term: float = math.nan
    """Term in which the vehicle leads; NaN where it does not, and in a mission without deputies."""
    lead_time_s: float = math.nan
    """When the leader by which it leads was at the place below, s on the companion's own clock."""
    lead_north_m: float = math.nan
    """Place of the leader by which it leads (itself, or a lost one extrapolated), m north of the origin."""
    lead_east_m: float = math.nan
    """Place of that leader, m east of the mission's origin."""
    lead_course_rad: float = math.nan
    """Course over ground of that leader, rad clockwise from north."""
    lead_height_m: float = math.nan
    """Height of that leader, m above the mission's origin."""
    leader_age_s: float = math.nan
    """Age of the leader's state that it flew by, s; NaN before the first, and where it has no slot."""
    left: bool = False
    """Whether it was ordered out of the formation, or all was called off: then it has no slot."""
    path: str | None = MAIN_PATH
    """Name of the path that the leader follows; None in a hold, and once all was called off."""


def encode_step(step: GuidanceStep) -> bytes:
    """A step as one line of the file."""
    numbers = (step.course_rad, step.speed_m_s, int(step.limited), step.lyapunov_m2)
    later = (getattr(step, name) for name in LATER_COLUMNS)
    fields = (
        *(f"{step.time_s:.6f}", step.mode, *numbers, f"{step.formation_time_s:.6f}"),
        *("" if math.isnan(value) else f"{value:.6f}" for value in later),
        "1" if step.left else "",
        NO_PATH if step.path is None else "" if step.path == MAIN_PATH else step.path,
    )
    return (",".join(str(field) for field in fields) + "\n").encode()


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

    @property
    def steps(self) -> Sequence[GuidanceStep]:
        """All of them."""
        return self._steps


def read_guidance(*paths: Path, zero_s: float = 0.0) -> GuidanceTrack:
    """What a companion did.

    Args:
        paths: files of one companion's starts. One that is missing or cut off holds what can be read of it.
        zero_s: the companion's clock at time 0 of the flight.
    """
    steps: list[GuidanceStep] = []
    for path in paths:
        with (
            suppress(OSError, ValueError, TypeError, LookupError, csv.Error),
            TextIOWrapper(open_regular(path), newline="", encoding="utf-8") as file,
        ):
            steps.extend(_step(row, zero_s) for row in csv.DictReader(whole_lines(file)))
    return GuidanceTrack(sorted(steps, key=lambda step: step.time_s))


def read_newest(*paths: Path, zero_s: float = 0.0) -> GuidanceTrack:
    """What a companion did in the last second or two, of files that grow and may be long.

    Args:
        paths: as of `read_guidance`.
        zero_s: the companion's clock at time 0 of the flight.
    """
    steps: list[GuidanceStep] = []
    for path in paths:
        with suppress(OSError, csv.Error), open_regular(path) as file:
            file.seek(max(file.seek(0, SEEK_END) - NEWEST_BYTES, 0))
            # The first and the last line may not be whole.
            lines = file.read(NEWEST_BYTES).decode("utf-8", "replace").split("\n")[1:-1]
            for row in csv.DictReader(lines, fieldnames=COLUMNS):
                with suppress(ValueError, TypeError, LookupError, csv.Error):
                    steps.append(_step(row, zero_s))
    return GuidanceTrack(sorted(steps, key=lambda step: step.time_s))


def _step(row: dict[str, str], zero_s: float) -> GuidanceStep:
    time_s = float(row["time_s"]) - zero_s
    if not math.isfinite(time_s):
        raise ValueError("a time is none")
    later = {name: float(text) if (text := row.get(name)) else math.nan for name in LATER_COLUMNS}
    if math.isfinite(later["lead_time_s"]):
        later["lead_time_s"] -= zero_s
    return GuidanceStep(
        time_s=time_s,
        mode=row["mode"],
        course_rad=float(row["course_rad"]),
        speed_m_s=float(row["speed_m_s"]),
        limited=bool(int(row["limited"])),
        lyapunov_m2=float(row["lyapunov_m2"]),
        formation_time_s=float(row.get("formation_time_s") or "nan"),
        left=row.get("left") == "1",
        path=None if row.get("path") == NO_PATH else row.get("path") or MAIN_PATH,
        **later,
    )
