"""Flights of a study: the article's missions, flown in parallel, and their figures.

Studies of orders and predictions also check whether a flight stayed within its fence.
"""

import math
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from multiprocessing import get_context
from typing import Any, Literal, TypeVar

import numpy as np

from vfguide.elementwise import BoolArray
from vfguide.errors import VfguideError, import_extra
from vfguide.guidance.airframe import GRAVITY
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.report.figures import in_window
from vfguide.lab.report.metrics import FollowerSummary, summarise
from vfguide.mission.controller import with_law
from vfguide.mission.finding import Finding
from vfguide.mission.flight_limits import Track, tracks_beyond_the_fence
from vfguide.mission.load import load_mission, shipped_missions
from vfguide.mission.model import Mission
from vfguide.record.flight import FlightRecord

MissionName = Literal["line-calm", "line-wind", "circle-calm", "circle-wind"]

MISSIONS: tuple[MissionName, ...] = ("line-calm", "line-wind", "circle-calm", "circle-wind")

ARTICLE_ERROR_M: Mapping[MissionName, float] = {
    "line-calm": 0.85,
    "line-wind": 2.31,
    "circle-calm": 1.12,
    "circle-wind": 2.97,
}
"""Mean errors that the article claims for its field."""

Changes = Mapping[str, Mapping[str, Any]]
"""Mission fields to replace, by section."""

THREADS = "OPENBLAS_NUM_THREADS"
"""Limit of one thread per worker: otherwise the numerical libraries of all workers compete for processors."""

CONNECT_S = 10
"""Time that a scheduler gets to answer."""


@cache
def shipped(name: str) -> Mission:
    """Return one of the article's missions as shipped."""
    return load_mission(shipped_missions()[name])


def article_mission(
    name: str, changes: Changes | None = None, *, plant: str = "heading-hold"
) -> Mission:
    """Return one of the article's missions with changed fields, and without acceptance limits."""
    content = shipped(name).model_dump(mode="json", exclude_unset=True, exclude={"acceptance"})
    for vehicle in content["vehicles"].values():
        vehicle["plant"] = plant
    for section, fields in (changes or {}).items():
        before = content.get(section, {})
        if section == "controller" and "type" in fields:
            before = with_law(before, fields["type"])
        content[section] = {**before, **fields}
    return Mission.model_validate(content)


Row = tuple[str, Mapping[str, float | str | None]]
"""Case of a study, and its figures by name."""


class Shown(float):
    """Figure as formatted in tables."""

    __slots__ = ()

    @classmethod
    def of(cls, value: float | str | None) -> "Shown":
        """Convert a figure of a row."""
        return cls(math.nan if value is None else value)

    def __format__(self, form: str) -> str:
        """Format as asked for, or with suitable digits; a dash if unknown."""
        if not math.isfinite(self):
            return "-"
        return format(
            float(self), form or (".3f" if self < 1.0 else ".2f" if self < 10.0 else ".0f")
        )


class Said(str):
    """Text in place of a figure, whatever the figure's format."""

    __slots__ = ()

    def __format__(self, _: str) -> str:
        return str(self)


def markdown(columns: Mapping[str, str], rows: Iterable[Row]) -> str:
    """Return a Markdown table; figures that a row lacks are shown as unknown.

    `columns` holds each column's format by its heading, with the fields `case` and names of figures.
    """
    lines = [[*columns], ["---"] * len(columns)]
    for case, figures in rows:
        known: dict[str, Any] = defaultdict(lambda: Shown(math.nan), case=case)
        for name, value in figures.items():
            known[name] = Said(value) if isinstance(value, str) else Shown.of(value)
        lines.append([form.format_map(known) for form in columns.values()])
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


Task = TypeVar("Task")
Result = TypeVar("Result")


@contextmanager
def executor_on(scheduler: str | None = None, processes: int | None = None) -> Iterator[Executor]:
    """Yield an executor on this computer's processes or on a Dask cluster.

    Args:
        scheduler: address of a Dask scheduler, such as tcp://host:8786; None for this computer.
        processes: number of processes; one per processor if absent.

    Raises:
        VfguideError: a scheduler is named and Dask is not installed, or nothing answers there.
    """
    if scheduler is not None:
        with dask_executor(scheduler) as cluster:
            yield cluster
        return
    os.environ.setdefault(THREADS, "1")
    # Not forked: a worker could inherit a lock that some thread holds, and that nobody ever releases.
    with ProcessPoolExecutor(processes or os.cpu_count(), get_context("spawn")) as pool:
        yield pool


@contextmanager
def dask_executor(scheduler: str) -> Iterator[Executor]:
    """Yield an executor on a Dask cluster, whose workers need vfguide installed."""
    # Imported by name, because the package has no types.
    connect: Callable[..., Any] = import_extra("distributed").Client
    try:
        client = connect(scheduler, timeout=CONNECT_S)
    except OSError as error:
        raise VfguideError(f"{scheduler}: no Dask scheduler answers ({error})") from error
    with client, client.get_executor() as cluster:
        yield cluster


def flown_by(
    executor: Executor, fly: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[Result]:
    """Yield results in the order of the tasks, each as soon as it is there."""
    yield from executor.map(fly, tasks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Flight of a study, which can be sent to another process."""

    mission: str
    controller: str
    """Name of the followers' law."""
    plant: str = "heading-hold"
    changes: Changes = field(default_factory=dict)
    label: str = ""

    def flown(self) -> Mission:
        """Return the mission to fly."""
        changes = dict(self.changes)
        changes["controller"] = {**changes.get("controller", {}), "type": self.controller}
        return article_mission(self.mission, changes, plant=self.plant)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Figures of a flight; errors over its last half, and None where not measured or never settled."""

    mean_error_m: float
    """Mean distance from the slot over all followers."""
    intended_error_m: float
    """Mean distance from the slot in the frame of the path's course at the leader."""
    p95_error_m: float
    max_error_m: float
    settle_10m_s: float | None
    """Last time a follower was 10 m or more from its slot; None: still out at the end."""
    settle_1m_s: float | None
    """Last time a follower was 1 m or more from its slot; None: still out at the end."""
    min_separation_m: float
    """Smallest distance between any two vehicles during the whole flight."""
    effort_m_s2: float
    """Control effort: root mean square of the followers' acceleration through the air."""
    roll_deg_s: float
    """Roll rate, root mean square of a follower, mean over followers."""
    course_variation_rad_s: float
    """Course setpoints' total variation less net turning, per second, mean over followers."""
    speed_variation_m_s2: float
    """Speed setpoints' total variation per second, mean over followers."""
    limited: float
    """Share of the followers' setpoints cut by a limit."""


def fly(case: Case) -> Figures:
    """Fly a case."""
    return figures_of(fly_rehearsal(case.flown()).record)


def figures_of(record: FlightRecord) -> Figures:
    """Return the figures of a record."""
    summary = summarise(record)
    formation = summary.formation
    window = in_window(record)
    followers = [one for one in summary.vehicles.values() if isinstance(one, FollowerSummary)]
    rolls = [one.roll_rate_rad_s for one in followers if one.roll_rate_rad_s is not None]
    efforts = []
    for vehicle in record.followers:
        turning = GRAVITY * np.tan(vehicle.bank_rad[window])
        along = np.gradient(vehicle.airspeed_m_s, record.time_s)[window]
        efforts.append(float(np.mean(turning**2 + along**2)))
    return Figures(
        mean_error_m=or_nan(formation.mean_error_m),
        intended_error_m=or_nan(formation.intended_error_m),
        p95_error_m=or_nan(formation.p95_error_m),
        max_error_m=or_nan(formation.max_error_m),
        settle_10m_s=formation.settle_10m_s,
        settle_1m_s=formation.settle_1m_s,
        min_separation_m=or_nan(formation.min_separation_m),
        effort_m_s2=math.sqrt(float(np.mean(efforts))),
        roll_deg_s=math.degrees(float(np.mean(rolls))) if rolls else math.nan,
        course_variation_rad_s=float(
            np.mean([or_nan(one.course_setpoint_excess_variation_rad_s) for one in followers])
        ),
        speed_variation_m_s2=float(
            np.mean([or_nan(one.speed_setpoint_variation_m_s2) for one in followers])
        ),
        limited=float(np.mean([or_nan(one.limited_fraction) for one in followers])),
    )


def or_nan(value: float | None) -> float:
    """Return a figure, or NaN for None."""
    return math.nan if value is None else value


def beyond_when_flown(
    mission: Mission, record: FlightRecord, during: BoolArray
) -> Iterator[Finding]:
    """Find vehicles that leave the fence of a mission and its path; each finding is at ("vehicles", name).

    `during` selects the samples that count, at which the mission's path is flown.
    """
    if not during.any():
        return

    def flown(_: Mission) -> Iterator[Track]:
        for one in (record.leader, *record.followers):
            height = one.altitude_amsl_m - mission.origin.altitude_amsl_m
            place = ("vehicles", one.name)
            yield Track(one.name, place, one.north_m[during], one.east_m[during], height[during])

    for finding in tracks_beyond_the_fence(mission, flown):
        if finding.severity == "error":
            yield finding
