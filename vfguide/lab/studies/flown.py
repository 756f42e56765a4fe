"""One flight of a benchmark: lockstep through MAVLink bytes, and the figures that it comes down to."""

import math
from dataclasses import dataclass, field

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import GRAVITY
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import in_window
from vfguide.lab.report.geometry import slot_error
from vfguide.lab.report.metrics import summarise
from vfguide.lab.report.summary import FollowerSummary
from vfguide.lab.studies.article import Changes, article_mission
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord

DRAWN_EVERY_S = 0.5
"""Between the points of a drawn track."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """What is flown; can be handed to another process."""

    mission: str
    """Of the article's four."""
    controller: str
    """Name of the law by which followers kept their slots."""
    plant: str = "heading-hold"
    """Of every vehicle."""
    changes: Changes = field(default_factory=dict)
    """Fields of the mission, by section."""
    label: str = ""
    """Which of a series it is."""
    drawn: bool = False
    """Whether its tracks are wanted."""

    def flown(self) -> Mission:
        """The mission that is flown."""
        changes = dict(self.changes)
        changes["controller"] = {**changes.get("controller", {}), "type": self.controller}
        return article_mission(self.mission, changes, plant=self.plant)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tracks:
    """Where everybody was, thinned out for drawing."""

    time_s: FloatArray
    """Sample times."""
    north_m: dict[str, FloatArray]
    """By vehicle, the leader first."""
    east_m: dict[str, FloatArray]
    """By vehicle."""
    error_m: dict[str, FloatArray]
    """Distances from the slots by follower."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What a flight came to; errors over its last half, None: not measured or never settled."""

    mean_error_m: float
    """Distance from the slot, all followers."""
    p95_error_m: float
    """Its 95th percentile."""
    max_error_m: float
    """The greatest."""
    settle_10m_s: float | None
    """Last time anybody was 10 m or more out."""
    settle_1m_s: float | None
    """The same for 1 m."""
    min_separation_m: float
    """Of any two vehicles on the whole flight."""
    effort_m_s2: float
    """Control effort: root mean square of the followers' acceleration through the air."""
    course_variation_rad_s: float
    """Course setpoints' back and forth per second, mean over followers."""
    speed_variation_m_s2: float
    """Speed setpoints' variation per second, mean over followers."""
    limited: float
    """Share of the followers' setpoints that a limit cut."""
    wall_s: float
    """What the flight took; NaN where it is not known."""


def fly(case: Case) -> tuple[Figures, Tracks | None]:
    """Fly a case."""
    record = fly_rehearsal(case.flown()).record
    return figures_of(record), tracks_of(record) if case.drawn else None


def figures_of(record: FlightRecord) -> Figures:
    """The figures of a record."""
    summary = summarise(record)
    formation = summary.formation
    window = in_window(record)
    followers = [one for one in summary.vehicles.values() if isinstance(one, FollowerSummary)]
    span = record.duration_s / 2.0
    efforts, speed_variations = [], []
    for vehicle in record.followers:
        turning = GRAVITY * np.tan(vehicle.bank_rad[window])
        along = np.gradient(vehicle.airspeed_m_s, record.time_s)[window]
        efforts.append(float(np.mean(turning**2 + along**2)))
        speeds = vehicle.airspeed_setpoint_m_s
        if not np.isfinite(speeds[-1]):
            speeds = vehicle.ground_speed_setpoint_m_s
        speed_variations.append(float(np.nansum(np.abs(np.diff(speeds[window])))) / span)
    return Figures(
        mean_error_m=or_nan(formation.mean_error_m),
        p95_error_m=or_nan(formation.p95_error_m),
        max_error_m=or_nan(formation.max_error_m),
        settle_10m_s=formation.settle_10m_s,
        settle_1m_s=formation.settle_1m_s,
        min_separation_m=or_nan(formation.min_separation_m),
        effort_m_s2=math.sqrt(float(np.mean(efforts))),
        course_variation_rad_s=float(
            np.mean([or_nan(one.course_setpoint_excess_variation_rad_s) for one in followers])
        ),
        speed_variation_m_s2=float(np.mean(speed_variations)),
        limited=float(np.mean([or_nan(one.limited_fraction) for one in followers])),
        wall_s=or_nan(record.wall_s),
    )


def or_nan(value: float | None) -> float:
    """A figure, NaN where there is none."""
    return math.nan if value is None else value


def tracks_of(record: FlightRecord) -> Tracks:
    """The tracks of a record."""
    every = max(1, round(DRAWN_EVERY_S * record.rate_hz))
    return Tracks(
        time_s=record.time_s[::every],
        north_m={one.name: one.north_m[::every] for one in record.vehicles},
        east_m={one.name: one.east_m[::every] for one in record.vehicles},
        error_m={
            one.name: slot_error(record.reference, one).distance_m[::every]
            for one in record.followers
        },
    )
