"""Monte Carlo: formations with random gains and starts; and sweeps of one condition after the other."""

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from pydantic.fields import FieldInfo

from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.radio_flight import fly_rehearsal
from vfguide.lab.studies.flown import (
    AIRCRAFT,
    FOLLOWER_STARTS,
    LEADER_STARTS,
    Case,
    Figures,
    article_mission,
    figures_of,
    flown_by,
    fly,
    or_nan,
)
from vfguide.mission.controller import Controller, gains_of
from vfguide.mission.model import Mission
from vfguide.registry import laws

DURATION_S = 120.0

GREATEST_WIND = 0.4
"""Strongest wind, in parts of the leader's airspeed."""

START_SPREAD_M = 100.0
"""Displacement of everybody at the start, on each axis."""

SLOT_RANGE_M = (-60.0, 60.0)

LEAST_SPACING_M = 15.0
"""Least distance of any two slots, and from the leader."""

GAIN_FACTOR = 2.0
"""Gains of the law and kappa are up to this many times those of the mission, or that part of them."""

QUICK_S, FULL_S = 60.0, 120.0

AIRSPEED_M_S = 20.0

MISSIONS = ("line-wind", "circle-wind")


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFormation:
    """One formation to be drawn and flown; can be handed to another process."""

    law: str
    """Name of the law of the followers."""
    seed: tuple[int, ...]
    """Seed of everything random in it."""
    duration_s: float = DURATION_S
    """Length of the flight, s."""


def formations_of(
    law: str, count: int, seed: int, *, duration_s: float = DURATION_S
) -> list[DrawnFormation]:
    """So many formations of one law."""
    return [
        DrawnFormation(law=law, seed=(seed, number), duration_s=duration_s)
        for number in range(count)
    ]


def sampled(executor: Executor, formations: list[DrawnFormation]) -> Iterator[Figures]:
    """What the formations come to, in their order."""
    return flown_by(executor, fly_formation, formations)


def fly_formation(formation: DrawnFormation) -> Figures:
    """Draw a formation, and fly it."""
    random = default_rng(SeedSequence(formation.seed))
    return figures_of(fly_rehearsal(drawn_mission(formation, random)).record)


def drawn_mission(formation: DrawnFormation, random: Generator) -> Mission:
    """Circle with random slots, gains, starts and a random steady wind."""
    mission = article_mission(
        "circle-wind",
        {
            "controller": {"type": formation.law},
            "rehearsal": {"duration_s": formation.duration_s, "start": drawn_starts(random)},
        },
    )
    content = mission.model_dump(exclude_unset=True)
    content["wind"] = {
        "type": "steady",
        "speed_m_s": float(random.uniform(0.0, GREATEST_WIND * AIRSPEED_M_S)),
        "toward_deg": float(random.uniform(0.0, 360.0)),
    }
    content["controller"] |= drawn_gains(mission.controller, random)
    slots = drawn_slots(len(mission.followers), random)
    for follower, (forward, right) in zip(content["followers"], slots, strict=True):
        follower["slot"] = {"forward_m": forward, "right_m": right, "up_m": 0.0}
    return Mission.model_validate(content)


def drawn_starts(random: Generator) -> dict[str, Any]:
    """Everybody somewhere around its place, on any course."""
    leader = LEADER_STARTS["circle"]
    places: dict[str, tuple[float, float]] = {
        "leader": (leader["north_m"], leader["east_m"]),
        **FOLLOWER_STARTS,
    }
    starts = {}
    for name, (first, second) in places.items():
        ahead, aside = (
            float(one) for one in random.uniform(-START_SPREAD_M, START_SPREAD_M, size=2)
        )
        axes = ("north_m", "east_m") if name == "leader" else ("forward_m", "right_m")
        starts[name] = {
            axes[0]: first + ahead,
            axes[1]: second + aside,
            "course_deg": float(random.uniform(0.0, 360.0)),
        }
    return starts


def drawn_gains(controller: Controller, random: Generator) -> dict[str, float]:
    """Gains of the controller's law, and kappa, each by a factor; within their bounds."""
    law = laws.find(controller.type)
    names = law.drawn
    if names is None:
        gains = gains_of(controller)
        names = [name for name in type(gains).model_fields if type(getattr(gains, name)) is float]
    model = type(controller).model_fields
    factors = GAIN_FACTOR ** random.uniform(-1.0, 1.0, len(names) + 1)
    return {
        name: within_bounds(getattr(controller, name) * float(factor), model[name])
        for name, factor in zip((*names, "kappa"), factors, strict=True)
    }


def within_bounds(value: float, field: FieldInfo) -> float:
    """A value, brought to the nearest bound of its field if it is beyond one."""
    for bound in field.metadata:
        value = max(value, getattr(bound, "ge", value))
        value = min(value, getattr(bound, "le", value))
    return value


def drawn_slots(count: int, random: Generator) -> list[tuple[float, float]]:
    """Offsets, none too close to another or to the leader."""
    taken = [(0.0, 0.0)]
    while len(taken) <= count:
        forward, right = (float(one) for one in random.uniform(*SLOT_RANGE_M, 2))
        if all(math.hypot(forward - a, right - b) >= LEAST_SPACING_M for a, b in taken):
            taken.append((forward, right))
    return taken[1:]


def summary_of(flown: Sequence[Figures]) -> dict[str, Any]:
    """All formations in a few figures."""
    mean = np.array([one.mean_error_m for one in flown])
    settle = np.array([or_nan(one.settle_10m_s) for one in flown])
    settle_1m = np.array([or_nan(one.settle_1m_s) for one in flown])
    unlimited = np.array([one.limited == 0.0 for one in flown])
    return {
        "formations": len(flown),
        "within_10m_at_end": float(np.mean(np.isfinite(settle))),
        "within_1m_at_end": float(np.mean(np.isfinite(settle_1m))),
        "share_without_limits": float(np.mean(unlimited)),
        "mean_error_m": quantiles(mean),
        "mean_error_without_limits_m": quantiles(mean[unlimited]),
        "settle_10m_s": quantiles(settle),
    }


def quantiles(values: FloatArray) -> dict[str, float] | None:
    """Median, 95 % and greatest; None without a value."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return None
    median, high = np.quantile(finite, (0.5, 0.95))
    return {"median": float(median), "p95": float(high), "max": float(finite.max())}


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
class SweepPoint:
    """One flight of a map; can be handed to another process."""

    sweep: str
    """Which of the sweeps."""
    value: float
    """How bad."""
    mission: str
    """What is flown."""
    law: str
    """Name of the law."""
    duration_s: float
    """How long."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a flight came to."""

    point: SweepPoint
    """Which."""
    mean_error_m: float
    """Over the last half."""
    max_error_m: float
    """In the last half."""
    settle_10m_s: float | None
    """Last time a follower was 10 m or more out, s; None: at the end still."""
    chatter_rad_s: float
    """Back and forth of the course setpoints."""


def points(laws: Sequence[str], *, quick: bool) -> list[SweepPoint]:
    """Every flight of every map, by each of these laws."""
    return [
        SweepPoint(
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


def fly_point(point: SweepPoint) -> Found:
    """Fly one."""
    rehearsal: dict[str, Any] = {"duration_s": point.duration_s}
    changes: dict[str, dict[str, Any]] = {"rehearsal": rehearsal}
    match point.sweep:
        case "delay":
            rehearsal["link_delay_s"] = point.value
        case "loss":
            rehearsal["link_loss"] = point.value
        case "noise":
            rehearsal["position_noise_m"] = point.value
        case "alpha" | "beta":
            # Vehicles respond faster or slower than their mission says; companions learn it.
            declared = f"{point.sweep}_1_s"
            rehearsal["emulator"] = {declared: AIRCRAFT[declared] * point.value}
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
