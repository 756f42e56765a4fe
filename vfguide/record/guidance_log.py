"""What a companion did, step by step, as a file of comma-separated values beside its telemetry log.

What was sent is in the telemetry log, too; this adds why: the mode, the limits, the Lyapunov function; and
the formation's clock, by which the recordings of several aircraft fit together. A line is whole once its
line feed is written: what a killed companion leaves is read up to there.
"""

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from pathlib import Path

import msgspec
import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.formation.arrangement import MAIN_PATH
from vfguide.record.log import CompanionLog
from vfguide.record.vehicle import LEAD_SERIES, SLOT_SERIES

SUFFIX = ".guidance.csv"
"""Follows the vehicle's name."""

NO_PATH = "-"
"""In the last column where no path is followed, which is no path's name."""


class GuidanceStep(msgspec.Struct, frozen=True, kw_only=True):
    """One step of guidance, or a change of the supervisor's mode."""

    time_s: float
    """On the companion's own clock, s."""
    mode: str
    """Mode of the supervisor."""
    course_rad: float = math.nan
    """Last course setpoint sent; NaN before the first."""
    speed_m_s: float = math.nan
    """Last setpoint of airspeed or ground speed sent, whichever the vehicle holds; NaN before the first."""
    limited: bool
    """Whether a limit of the vehicle cut it."""
    lyapunov_m2: float = math.nan
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


STEPS = CompanionLog(GuidanceStep, GuidanceStep.__struct_fields__)


def encode_step(step: GuidanceStep) -> bytes:
    """A step as one line of the file."""
    return STEPS.encode(step, path=NO_PATH if step.path is None else step.path)


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
    return track_of(STEPS.read(*paths), zero_s)


def read_newest(*paths: Path, zero_s: float = 0.0) -> GuidanceTrack:
    """What a companion did in the last second or two; arguments as of `read_guidance`."""
    return track_of(STEPS.read_newest(*paths), zero_s)


def track_of(steps: Iterable[GuidanceStep], zero_s: float) -> GuidanceTrack:
    """Steps as they were written, on the time of the flight."""
    found = [
        msgspec.structs.replace(
            step,
            time_s=step.time_s - zero_s,
            lead_time_s=step.lead_time_s - zero_s,
            path=None if step.path == NO_PATH else step.path,
        )
        for step in steps
    ]
    return GuidanceTrack(sorted(found, key=lambda step: step.time_s))


# The slots that a companion flew in and what it led by, at the samples of a flight.

GAP_S = 1.0
"""s without a report, or a step of guidance, after which a vehicle's doings count as unknown."""

ORDERED = ("slot_forward_m", "slot_right_m", "slot_up_m")
"""Fields of a step from which `SLOT_SERIES` are made."""


def sampled(moments: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Values at the moments, by interpolation; NaN where the nearest times are too far apart."""
    if times.size < 2:
        return np.full_like(moments, np.nan)
    found = np.interp(moments, times, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(times, moments), 1, times.size - 1)
    found[times[after] - times[after - 1] > GAP_S] = np.nan
    return found


def slot_series(
    track: GuidanceTrack, moments: FloatArray, mission: tuple[float, float, float]
) -> dict[str, FloatArray]:
    """Where a follower's slot was, for a `VehicleRecord`; nothing where it was the mission's all the time.

    Args:
        track: what the companion did.
        moments: samples, s on the same clock.
        mission: slot forward, right of and above the leader in the mission, m. It counts until the first
            order; what was ordered last counts while nothing is known. Who has left the formation has no
            slot (NaN) until it is given one again.
    """
    steps = [step for step in track.steps if step.left or np.isfinite(step.slot_forward_m)]
    if not steps:
        return {}
    times = np.array([step.time_s for step in steps])
    newest = np.searchsorted(times, moments, side="right") - 1
    left = np.array([step.left for step in steps])
    gone = (newest >= 0) & left[np.maximum(newest, 0)]
    given = [step for step in steps if not step.left]
    found = {}
    for series, name, fixed in zip(SLOT_SERIES, ORDERED, mission, strict=True):
        slots = np.full_like(moments, fixed)
        if given:
            values = [getattr(step, name) for step in given]
            slots = np.interp(moments, [step.time_s for step in given], values, left=fixed)
        found[series] = np.where(gone, np.nan, slots)
    return found


def age_series(track: GuidanceTrack, moments: FloatArray) -> dict[str, FloatArray]:
    """How old the leader's state was that a follower flew by, for a `VehicleRecord`; nothing where not told.

    Args:
        track: what the companion did; of versions before it tells no ages.
        moments: samples, s on the same clock.
    """
    told = [step for step in track.steps if np.isfinite(step.leader_age_s)]
    if not told:
        return {}
    times = np.array([step.time_s for step in told])
    ages = np.array([step.leader_age_s for step in told])
    newest = np.searchsorted(times, moments, side="right") - 1
    since = moments - times[np.maximum(newest, 0)]
    known = (newest >= 0) & (since <= GAP_S)
    return {"leader_age_s": np.where(known, ages[np.maximum(newest, 0)], np.nan)}


def lead_series(
    track: GuidanceTrack, moments: FloatArray, ground_amsl_m: float
) -> dict[str, FloatArray]:
    """By what a vehicle led, for a `VehicleRecord` of a mission with deputies; NaN where it did not.

    Args:
        track: what the companion did.
        moments: samples, s on the same clock.
        ground_amsl_m: altitude of the mission's origin, m.
    """
    # A leader that is carried on is known at the time of the last report; the step is some time later.
    known = [step for step in track.steps if np.isfinite(step.lead_time_s)]
    known.sort(key=lambda step: step.lead_time_s)
    times = np.array([step.lead_time_s for step in known])

    def at(name: str) -> FloatArray:
        return sampled(moments, times, np.array([getattr(step, name) for step in known]))

    course = np.unwrap([step.lead_course_rad for step in known]) if known else times
    term = at("lead_term")
    # Between two terms it led in neither.
    term[np.not_equal(term, np.round(term))] = np.nan
    columns = (
        term,
        at("lead_north_m"),
        at("lead_east_m"),
        sampled(moments, times, np.asarray(course)),
        ground_amsl_m + at("lead_height_m"),
    )
    return dict(zip(LEAD_SERIES, columns, strict=True))
