"""The slots that a companion flew in and what it led by, at the samples of a flight."""

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.record.guidance_log import GuidanceTrack
from vfguide.record.vehicle import LEAD_SERIES, SLOT_SERIES

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
