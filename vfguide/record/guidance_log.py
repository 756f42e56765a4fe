"""Log of a companion's guidance steps as comma-separated values, beside its telemetry log.

The telemetry log holds the setpoints sent. This log adds the reasons (mode, limits, Lyapunov function) and
the formation's clock, which aligns the recordings of several aircraft. A line is complete once its line feed
is written; a file of a killed companion is read up to there.
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
"""Suffix after the vehicle's name."""

NO_PATH = "-"
"""Entry of the last column if no path is followed; not a valid path name."""


class GuidanceStep(msgspec.Struct, frozen=True, kw_only=True):
    """One step of guidance, or a mode change of the supervisor."""

    time_s: float
    """Time on the companion's own clock, s."""
    mode: str
    course_rad: float = math.nan
    """Last course setpoint sent, rad; NaN before the first."""
    speed_m_s: float = math.nan
    """Last airspeed or ground speed setpoint sent, whichever the vehicle holds, m/s; NaN before the first."""
    limited: bool
    """Whether a limit of the vehicle cut the setpoint."""
    lyapunov_m2: float = math.nan
    """Lyapunov function W, m²; NaN for the leader."""
    formation_time_s: float = math.nan
    """Time of the step on the leader's clock, s; NaN if unknown."""
    slot_forward_m: float = math.nan
    """Ordered slot ahead of the leader, m; NaN while the mission's applies, and for the leader."""
    slot_right_m: float = math.nan
    """Ordered slot right of the leader, m."""
    slot_up_m: float = math.nan
    """Ordered slot above the leader, m."""
    lead_term: float = math.nan
    """Term in which the vehicle leads; NaN if it does not lead, or without deputies in the mission."""
    lead_time_s: float = math.nan
    """Time of the leader state by which the vehicle leads, s on the companion's own clock."""
    lead_north_m: float = math.nan
    """North of the mission's origin, m, of the leader by which the vehicle leads: itself, or a lost one
    extrapolated."""
    lead_east_m: float = math.nan
    """East of the mission's origin, m, of the leader by which the vehicle leads."""
    lead_course_rad: float = math.nan
    """Course over ground of the leader by which the vehicle leads, rad clockwise from north."""
    lead_height_m: float = math.nan
    """Height of the leader by which the vehicle leads, m above the mission's origin."""
    leader_age_s: float = math.nan
    """Age of the leader state used in the step, s; NaN before the first, and without a slot."""
    left: bool = False
    """Whether the vehicle has no slot since it was ordered to leave, or after an abort."""
    path: str | None = MAIN_PATH
    """Name of the path that the leader follows; None in a hold and after an abort."""


STEPS = CompanionLog(GuidanceStep, GuidanceStep.__struct_fields__)


def encode_step(step: GuidanceStep) -> bytes:
    """Encode a step as one line of the file."""
    return STEPS.encode(step, path=NO_PATH if step.path is None else step.path)


class GuidanceTrack:
    """Guidance steps of a companion by time."""

    def __init__(self, steps: list[GuidanceStep]) -> None:
        """Take steps in order of time."""
        self._steps = steps
        self._times_s = [step.time_s for step in steps]

    def at(self, time_s: float) -> GuidanceStep | None:
        """Return the newest step up to this time; None before the first."""
        count = bisect_right(self._times_s, time_s)
        return self._steps[count - 1] if count else None

    @property
    def steps(self) -> Sequence[GuidanceStep]:
        """All steps."""
        return self._steps


def read_guidance(*paths: Path, zero_s: float = 0.0) -> GuidanceTrack:
    """Return the guidance steps of a companion, from the files of its starts.

    Files may be missing or truncated. `zero_s` is the companion's clock at time 0 of the flight, s.
    """
    return track_of(STEPS.read(*paths), zero_s)


def read_newest(*paths: Path, zero_s: float = 0.0) -> GuidanceTrack:
    """Return the steps of the last second or two; arguments as for `read_guidance`."""
    return track_of(STEPS.read_newest(*paths), zero_s)


def track_of(steps: Iterable[GuidanceStep], zero_s: float) -> GuidanceTrack:
    """Convert steps from the companion's clock to the time of the flight."""
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


# Slots and leading positions of a companion, at the samples of a flight.

GAP_S = 1.0
"""Maximum time without a report or a step, s; a vehicle's state counts as unknown beyond it."""

ORDERED = ("slot_forward_m", "slot_right_m", "slot_up_m")
"""Fields of a step from which `SLOT_SERIES` are made."""


def sampled(moments: FloatArray, times: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate values at the moments; NaN where the nearest times are too far apart."""
    if times.size < 2:
        return np.full_like(moments, np.nan)
    found = np.interp(moments, times, values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(times, moments), 1, times.size - 1)
    found[times[after] - times[after - 1] > GAP_S] = np.nan
    return found


def slot_series(
    track: GuidanceTrack, moments: FloatArray, mission: tuple[float, float, float]
) -> dict[str, FloatArray]:
    """Return a follower's slot over time for a `VehicleRecord`; empty if it never left the mission's.

    Args:
        track: steps of the companion.
        moments: sample times, s on the same clock.
        mission: the mission's slot forward, right of and above the leader, m. It applies until the first
            order. Ordered slots are interpolated, and the last one is held. A vehicle that left has no slot
            (NaN) until it gets one again.
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
    """Return the age of the leader state used at each moment (s), for a `VehicleRecord`.

    It is empty if no ages are logged, as by earlier versions.
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
    """Return the leader states by which a vehicle led, for a `VehicleRecord`; NaN while it did not lead.

    The mission has deputies, and its origin is `ground_amsl_m` above mean sea level.
    """
    # An extrapolated leader is known at the time of its last report, some time before the step.
    known = [step for step in track.steps if np.isfinite(step.lead_time_s)]
    known.sort(key=lambda step: step.lead_time_s)
    times = np.array([step.lead_time_s for step in known])

    def at(name: str) -> FloatArray:
        return sampled(moments, times, np.array([getattr(step, name) for step in known]))

    course = np.unwrap([step.lead_course_rad for step in known]) if known else times
    term = at("lead_term")
    # Between two terms the vehicle led in neither.
    term[np.not_equal(term, np.round(term))] = np.nan
    columns = (
        term,
        at("lead_north_m"),
        at("lead_east_m"),
        sampled(moments, times, np.asarray(course)),
        ground_amsl_m + at("lead_height_m"),
    )
    return dict(zip(LEAD_SERIES, columns, strict=True))
