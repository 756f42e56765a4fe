"""Errors and settling against one thing that gets worse: nothing is cropped where it becomes unstable."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import default_rng

from vfguide.lab.studies.array_formation import fly_formations
from vfguide.lab.studies.array_mission import conditions_of, start_of
from vfguide.lab.studies.array_outcome import Watch
from vfguide.lab.studies.flown import Case, fly

QUICK_S, FULL_S = 60.0, 150.0
AIRSPEED_M_S = 20.0

MISSIONS = ("line-wind", "circle-wind")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One thing that gets worse."""

    title: str
    """With its unit."""
    values: tuple[float, ...]
    """From good to bad."""


SWEEPS = {
    "delay": Sweep(title="link delay, s", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "loss": Sweep(title="link loss", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5)),
    "noise": Sweep(title="position noise, m", values=(0.0, 0.1, 0.3, 0.6, 1.0)),
    "alpha": Sweep(title="true alpha / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "beta": Sweep(title="true beta / declared", values=(0.5, 0.7, 0.85, 1.0, 1.2, 1.5, 2.0)),
    "wind": Sweep(title="steady wind / airspeed", values=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6)),
    "rate": Sweep(title="loop rate, Hz", values=(5.0, 8.0, 10.0, 20.0, 50.0)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One flight of a map; can be handed to another process."""

    sweep: str
    """Which of the sweeps."""
    value: float
    """How bad."""
    mission: str
    """What is flown."""
    law: str
    """By which law."""
    duration_s: float
    """How long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a flight came to."""

    point: Point
    """Which."""
    mean_error_m: float
    """Over the last half."""
    max_error_m: float
    """In the last half."""
    settle_10m_s: float | None
    """None: somebody was 10 m or more out at the end."""
    chatter_rad_s: float
    """Back and forth of the course setpoints."""


def points(laws: Sequence[str], *, quick: bool) -> list[Point]:
    """Every flight of every map, by each of these laws."""
    return [
        Point(
            sweep=name,
            value=value,
            mission=mission,
            law=law,
            duration_s=QUICK_S if quick else FULL_S,
        )
        for name, sweep in SWEEPS.items()
        for mission in (MISSIONS[1:] if quick else MISSIONS)
        for law in laws
        for value in sweep.values
    ]


WRONG = ("alpha", "beta")
"""Flown in the array form, whose plant need not be what the laws believe."""


def fly_point(point: Point) -> Found:
    """Fly one."""
    if point.sweep in WRONG:
        return fly_misled(point)
    rehearsal: dict[str, Any] = {"duration_s": point.duration_s}
    changes: dict[str, dict[str, Any]] = {"rehearsal": rehearsal}
    match point.sweep:
        case "delay":
            rehearsal["link_delay_s"] = point.value
        case "loss":
            rehearsal["link_loss"] = point.value
        case "noise":
            rehearsal["position_noise_m"] = point.value
        case "wind":
            # Along the line's course on one side, across it on the other half of the circle.
            speed = point.value * AIRSPEED_M_S
            changes["wind"] = {"type": "steady", "speed_m_s": speed, "toward_deg": 90.0}
        case "rate":
            rehearsal["rate_hz"] = point.value
    figures, _ = fly(Case(mission=point.mission, controller=point.law, changes=changes))
    return Found(
        point=point,
        mean_error_m=figures.mean_error_m,
        max_error_m=figures.max_error_m,
        settle_10m_s=figures.settle_10m_s,
        chatter_rad_s=figures.course_variation_rad_s,
    )


def fly_misled(point: Point) -> Found:
    """Fly one whose vehicles respond faster or slower than the laws believe."""
    # The array form has slots turn with the leader's measured course.
    changes: dict[str, dict[str, Any]] = {
        "rehearsal": {"duration_s": point.duration_s},
        "controller": {"slot_frame": "leader"},
    }
    mission = Case(mission=point.mission, controller=point.law, changes=changes).flown()
    conditions = conditions_of(mission)
    believed = conditions.airframe
    really = {point.sweep: getattr(believed, point.sweep) * point.value}
    watch = Watch(point.duration_s)
    with np.errstate(over="ignore", invalid="ignore"):
        fly_formations(
            start_of(mission),
            replace(conditions, plant=replace(believed, **really)),
            watch,
            default_rng(1),
        )
    outcome = watch.outcome()
    settle = float(outcome.settle_10m_s[0])
    return Found(
        point=point,
        mean_error_m=float(outcome.mean_error_m[0]),
        max_error_m=float(outcome.max_error_m[0]),
        settle_10m_s=settle if np.isfinite(settle) else None,
        chatter_rad_s=float(outcome.chatter_rad_s[0]),
    )
