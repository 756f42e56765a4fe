"""Monte Carlo: formations with random gains and aircraft; and sweeps of one condition after the other."""

import math
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import msgspec
import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from pydantic.fields import FieldInfo

from vfguide.elementwise import FloatArray
from vfguide.lab.studies.array_case import ArrayOutcome, ArrayStart, Watch, conditions_of, start_of
from vfguide.lab.studies.array_formation import fly_formations
from vfguide.lab.studies.array_plant import Plane, SwingingWind
from vfguide.lab.studies.flown import Case, article_mission, flown_by, fly
from vfguide.mission.controller import Controller, gains_of
from vfguide.mission.model import Mission
from vfguide.registry import laws

BATCH = 1024
"""Formations at once: more of them do not fit the processor's cache."""

DURATION_S = 120.0

GREATEST_WIND = 0.4
"""Strongest wind, in parts of the leader's airspeed."""

GREATEST_SWING_RATE = 0.1
"""rad/s: the article's."""

START_SPREAD_M = 100.0
"""Displacement of everybody at the start, on each axis."""

SLOT_RANGE_M = (-60.0, 60.0)

LEAST_SPACING_M = 15.0
"""Least distance of any two slots, and from the leader."""

GAIN_FACTOR = 2.0
"""Gains of the law and kappa are up to this many times those of the mission, or that part of them."""

QUICK_S, FULL_S = 60.0, 150.0

AIRSPEED_M_S = 20.0

MISSIONS = ("line-wind", "circle-wind")

WRONG = ("alpha", "beta")
"""Flown in the array form, whose plant need not be what the laws believe."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Formations that share slots and gains; can be handed to another process."""

    law: str
    """Name of the law of the followers."""
    count: int
    """Number of formations."""
    seed: tuple[int, ...]
    """Seed of everything random in it."""
    mission: str = "circle-wind"
    """Whose path is flown."""
    duration_s: float = DURATION_S
    """Length of each flight, s."""
    position_noise_m: float = 0.0
    """Standard deviation of reported positions, m per axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """What a batch came to."""

    batch: Batch
    """Which."""
    outcome: ArrayOutcome
    """One number for each formation."""
    wind_share: FloatArray
    """Mean wind over the leader's airspeed, of each formation."""
    gains: dict[str, float]
    """Those drawn."""
    vehicle_seconds: float
    """How much was flown."""
    processor_s: float
    """What it took of one core."""


def batches(law: str, formations: int, seed: int, *, duration_s: float = DURATION_S) -> list[Batch]:
    """So many formations in batches."""
    sizes = [BATCH] * (formations // BATCH)
    if formations % BATCH:
        sizes.append(formations % BATCH)
    return [
        Batch(law=law, count=size, seed=(seed, number), duration_s=duration_s)
        for number, size in enumerate(sizes)
    ]


def sampled(executor: Executor, tasks: list[Batch]) -> Iterator[BatchResult]:
    """What the batches come to, in their order."""
    return flown_by(executor, fly_batch, tasks)


def fly_batch(batch: Batch) -> BatchResult:
    """Draw, and fly."""
    began = time.process_time()
    random = default_rng(SeedSequence(batch.seed))
    mission, gains = drawn_mission(batch, random)
    # Airspeeds are reported as they are: nothing is learnt about them.
    conditions = replace(conditions_of(mission, Plane(), rounded=False), calibrates=False)
    start = drawn_start(mission, batch.count, random)
    watch = Watch(batch.duration_s)
    # Arithmetic on what has flown out of bounds may overflow: it is counted as not settled.
    with np.errstate(over="ignore", invalid="ignore"):
        fly_formations(start, conditions, watch, random)
    vehicles = start.north.size
    return BatchResult(
        batch=batch,
        outcome=watch.outcome(),
        wind_share=start.wind.mean / mission.leader.airspeed_m_s,
        gains=gains,
        vehicle_seconds=vehicles * batch.duration_s,
        processor_s=time.process_time() - began,
    )


def drawn_mission(batch: Batch, random: Generator) -> tuple[Mission, dict[str, float]]:
    """A mission with random slots and gains, and those gains."""
    # The array form has slots turn with the leader's measured course.
    controller = {"type": batch.law, "slot_frame": "leader"}
    mission = article_mission(batch.mission, {"controller": controller})
    slots = drawn_slots(len(mission.followers), random)
    gains = drawn_gains(mission.controller, random)
    content = mission.model_dump(exclude_unset=True)
    content["controller"] |= gains
    content["rehearsal"] |= {
        "duration_s": batch.duration_s,
        "position_noise_m": batch.position_noise_m,
    }
    for follower, (forward, right) in zip(content["followers"], slots, strict=True):
        follower["slot"] = {"forward_m": forward, "right_m": right, "up_m": 0.0}
    return Mission.model_validate(content), gains


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


def drawn_start(mission: Mission, count: int, random: Generator) -> ArrayStart:
    """Everybody somewhere, in any direction; every formation in a wind of its own."""
    airspeed = mission.leader.airspeed_m_s
    mean = random.uniform(0.0, GREATEST_WIND * airspeed, count)
    wind = SwingingWind(
        mean=mean,
        swell=mean * random.uniform(0.0, 0.6, count),
        centre=random.uniform(-math.pi, math.pi, count),
        swing=random.uniform(0.0, math.pi, count),
        rate=random.uniform(0.0, GREATEST_SWING_RATE, count),
        phase=random.uniform(-math.pi, math.pi, count),
    )
    planned = start_of(mission, count, wind=wind)
    shape = planned.north.shape
    return replace(
        planned,
        north=planned.north + random.uniform(-START_SPREAD_M, START_SPREAD_M, shape),
        east=planned.east + random.uniform(-START_SPREAD_M, START_SPREAD_M, shape),
        course=random.uniform(-math.pi, math.pi, shape),
    )


def summary_of(flown: list[BatchResult]) -> dict[str, Any]:
    """All batches in a few figures."""
    mean = np.concatenate([one.outcome.mean_error_m for one in flown])
    settle = np.concatenate([one.outcome.settle_10m_s for one in flown])
    settle_1m = np.concatenate([one.outcome.settle_1m_s for one in flown])
    limited = np.concatenate([one.outcome.limited for one in flown])
    wind = np.concatenate([one.wind_share for one in flown])
    settled = np.isfinite(settle)
    unlimited = limited == 0.0
    seconds = sum(one.vehicle_seconds for one in flown)
    processor = sum(one.processor_s for one in flown)
    return {
        "formations": int(mean.size),
        "vehicle_seconds": seconds,
        "processor_s": processor,
        "vehicle_seconds_per_processor_second": seconds / processor,
        "within_10m_at_end": float(np.mean(settled)),
        "within_1m_at_end": float(np.mean(np.isfinite(settle_1m))),
        "share_without_limits": float(np.mean(unlimited)),
        "mean_error_m": quantiles(mean),
        "mean_error_without_limits_m": quantiles(mean[unlimited]),
        "settle_10m_s": quantiles(settle[settled]),
        "by_wind": [
            {
                "from": float(low),
                "to": float(low) + 0.1,
                "formations": int(np.sum(here)),
                "within_10m_at_end": float(np.mean(settled[here])) if np.any(here) else None,
                "mean_error_m": quantiles(mean[here]),
            }
            for low in np.arange(0.0, GREATEST_WIND, 0.1)
            if (here := (wind >= low) & (wind < low + 0.1)) is not None
        ],
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


def fly_misled(point: SweepPoint) -> Found:
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
            replace(conditions, plant=msgspec.structs.replace(believed, **really)),
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
