"""True positions of several simulators on one time base, and how far each simulator's clock fell behind.

Each report is placed by its simulator's clock, so that what delayed the report on its way does not count. The
clock is set by the reports that took the least time, anew all the time, since a simulator that gets too
little of the processor loses time and never makes up for it. One that runs at a steady pace of its own, as
PX4's at 0.99, loses none by that.
"""

from collections import deque
from dataclasses import dataclass

import numpy as np
import pymap3d

from tests.autopilots.ground_station import GroundStation
from vfguide.elementwise import FloatArray
from vfguide.frames import LocalFrame

AHEAD_S = 5.0
"""A clock that is late and catches up does so within this."""

DRIFT_S = 10.0
"""Over which the pace of a clock is taken."""

PHASE_REPORTS = 51
"""Over which the time from the report of the clock to that of the state is averaged, by the median."""

STEP_S = 0.04
"""Of the common time base: the simulators' states come every 20 ms or every 40 ms."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrueTrack:
    """Where one aircraft truly was, at N times of the common base."""

    north_m: FloatArray
    east_m: FloatArray
    altitude_amsl_m: FloatArray
    north_m_s: FloatArray
    east_m_s: FloatArray
    bank_rad: FloatArray
    pace: float
    """Of the simulator's clock, in parts of the flight's: steady, and known to companions."""
    lost_s: float
    """By how much the simulator's clock fell behind beside that, s."""
    late_s: float
    """How late 95 % of the reports at most were, s."""


def true_track(
    station: GroundStation, frame: LocalFrame, time_s: FloatArray, *, has_own_pace: bool = False
) -> TrueTrack:
    """A vehicle's track at times (N) of the flight's clock; its own may run at a steady pace of its own."""
    fixes = station.track()
    clock_s = fixes["clock_s"] + steady_phase(fixes["arrival_s"] - fixes["clock_arrival_s"])
    behind_s = fixes["arrival_s"] - clock_s
    least_s = least_ahead(clock_s, behind_s)
    happened_s = np.maximum.accumulate(clock_s + least_s)
    north_m, east_m = local_positions(frame, fixes["latitude_deg"], fixes["longitude_deg"])

    def at(values: FloatArray) -> FloatArray:
        return np.interp(time_s, happened_s, values)

    flown = (happened_s >= time_s[0]) & (happened_s <= time_s[-1])
    drift = steady_drift(clock_s[flown], least_s[flown]) if has_own_pace else 0.0
    return TrueTrack(
        north_m=at(north_m),
        east_m=at(east_m),
        altitude_amsl_m=at(fixes["altitude_amsl_m"]),
        north_m_s=at(fixes["north_m_s"]),
        east_m_s=at(fixes["east_m_s"]),
        bank_rad=at(fixes["bank_rad"]),
        pace=1.0 / (1.0 + drift),
        lost_s=float(np.ptp(least_s[flown] - drift * clock_s[flown])),
        late_s=float(np.percentile((behind_s - least_s)[flown], 95.0)),
    )


def local_positions(
    frame: LocalFrame, latitude_deg: FloatArray, longitude_deg: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(north, east) in metres of positions in degrees, as `LocalFrame.to_local`, of all at once."""
    origin = frame.to_geodetic(0.0, 0.0)
    height_m = frame.altitude_m
    east_m, north_m, _ = pymap3d.geodetic2enu(
        latitude_deg, longitude_deg, height_m, *origin, height_m
    )
    return north_m, east_m


def steady_phase(phase_s: FloatArray) -> FloatArray:
    """The time between two reports that a simulator sends one after the other, without what delayed one."""
    half = PHASE_REPORTS // 2
    padded = np.pad(phase_s, half, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, PHASE_REPORTS)
    median: FloatArray = np.median(windows, axis=1)
    return median


def steady_drift(clock_s: FloatArray, behind_s: FloatArray) -> float:
    """By how much a clock falls behind in each of its seconds, most of the time: the median of `DRIFT_S`."""
    marks_s = np.arange(clock_s[0], clock_s[-1], DRIFT_S)
    if marks_s.size < 2:
        return 0.0
    return float(np.median(np.diff(np.interp(marks_s, clock_s, behind_s)))) / DRIFT_S


def least_ahead(clock_s: FloatArray, behind_s: FloatArray) -> FloatArray:
    """The least of each value and those of the `AHEAD_S` after it.

    A simulator's clock can only lose time. Whatever is less a moment later was a delay.
    """
    ends = np.searchsorted(clock_s, clock_s + AHEAD_S, side="right")
    least, first = np.empty_like(behind_s), len(behind_s)
    # The indices of what may still be the least of a window, least last: a monotone queue, from the end.
    queue: deque[int] = deque()
    while first > 0:
        first -= 1
        while queue and behind_s[queue[0]] >= behind_s[first]:
            queue.popleft()
        queue.appendleft(first)
        while queue[-1] >= ends[first]:
            queue.pop()
        least[first] = behind_s[queue[-1]]
    return least
