"""What an identification flight has seen and said, and the stretches that are fitted."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import held_direction, held_speed
from vfguide.identification.fit import Response, fit_response
from vfguide.identification.models import (
    SETTLED_S,
    Samples,
    course_response,
    mean_told,
    speed_response,
)
from vfguide.identification.steps import Phase, Segment
from vfguide.state import Airframe, VehicleState

LEAST_REPORTS = 100
"""Fewer of them say nothing."""

WIND_S = 20.0
"""The wind that a stretch is flown in is the mean over this long: more than a response takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What a flight tells."""

    course: Response | None
    """None where there are too few reports."""
    course_samples: Samples | None
    """What it was found from."""
    speed: Response | None
    """The same of the speed."""
    speed_samples: Samples | None
    """What it was found from."""


@dataclass(slots=True)
class Recording:
    """A flight as it happens."""

    airframe: Airframe
    """Limits, and what is held."""
    reports: list[tuple[VehicleState[float], Phase]] = field(default_factory=list)
    """Every navigated state, and what was being flown then."""
    told: list[tuple[float, float, float]] = field(default_factory=list)
    """Time (s), course (rad) and speed (m/s) of every setpoint."""

    def note(self, state: VehicleState[float], segment: Segment) -> None:
        """A navigated report."""
        self.reports.append((state, segment.phase))

    def note_setpoint(self, time_s: float, course: float, speed: float) -> None:
        """A setpoint that went out, if it is another one than before."""
        if not self.told or self.told[-1][1:] != (course, speed):
            self.told.append((time_s, course, speed))

    def findings(self) -> Findings:
        """Fit what was seen so far."""
        airframe = self.airframe
        course, speed = self._samples(Phase.COURSE), self._samples(Phase.SPEED)
        return Findings(
            course=None
            if course is None
            else fit_response(
                lambda values: course_response(course, values, airframe), course.direction
            ),
            course_samples=course,
            speed=None
            if speed is None
            else fit_response(lambda values: speed_response(speed, values, airframe), speed.speed),
            speed_samples=speed,
        )

    def _samples(self, phase: Phase) -> Samples | None:
        """The stretch of one kind of steps, with the settled moment before it."""
        times = [state.time_s for state, flown in self.reports if flown is phase]
        if len(times) < LEAST_REPORTS:
            return None
        first, last = times[0] - SETTLED_S, times[-1]
        stretch = [state for state, _ in self.reports if first <= state.time_s <= last]
        airframe = self.airframe
        time_s = np.array([state.time_s for state in stretch])
        speed = np.array([held_speed(state, airframe) for state in stretch])
        north, east = self._wind(stretch, time_s)
        is_course = phase is Phase.COURSE
        told = np.array([(at, course, pace) for at, course, pace in self.told if at <= last])
        samples = Samples(
            time_s=time_s,
            direction=np.unwrap(np.array([held_direction(state, airframe) for state in stretch])),
            speed=speed,
            wind_north=north,
            wind_east=east,
            told_s=told[:, 0],
            told=np.unwrap(told[:, 1]) if is_course else told[:, 2],
        )
        return samples if is_course else as_seen(samples)

    def _wind(
        self, stretch: list[VehicleState[float]], time_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Wind at each report, without what one report alone adds to it; none where course is held."""
        if self.airframe.hold == "course-hold":
            return np.zeros_like(time_s), np.zeros_like(time_s)
        north = np.array([state.wind_north for state in stretch])
        east = np.array([state.wind_east for state in stretch])
        return smoothed(time_s, north), smoothed(time_s, east)


def as_seen(samples: Samples) -> Samples:
    """The same, with setpoints on the scale of what was seen: they are indicated airspeeds, states true ones.

    The steps go either way and back: however late a response is, its mean is that of its setpoints.
    """
    offset = float(np.mean(samples.speed[1:] - mean_told(samples, 0.0)))
    return replace(samples, told=samples.told + offset)


def smoothed(time_s: FloatArray, values: FloatArray, width_s: float = WIND_S) -> FloatArray:
    """Running mean over some seconds, as wide to either side as there is room."""
    total = np.concatenate(([0.0], np.cumsum(values)))
    half = 0.5 * width_s
    low = np.searchsorted(time_s, time_s - half, side="left")
    high = np.searchsorted(time_s, time_s + half, side="right")
    mean: FloatArray = (total[high] - total[low]) / (high - low)
    return mean


def is_good(response: Response) -> bool:
    """Whether a response is known well enough to be flown by: its bandwidth within a fifth."""
    bandwidth = response.bandwidth
    return math.isfinite(bandwidth.value) and bandwidth.half_width < 0.2 * bandwidth.value
