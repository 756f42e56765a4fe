"""Thousands of formations with random starts, winds, slots and gains, in the array form."""

import math
import time
from collections.abc import Iterator
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from pydantic.fields import FieldInfo

from vfguide.elementwise import FloatArray
from vfguide.lab.studies.array_case import Start
from vfguide.lab.studies.array_formation import fly_formations
from vfguide.lab.studies.array_ground import Plane
from vfguide.lab.studies.array_mission import conditions_of, start_of
from vfguide.lab.studies.array_outcome import Outcome, Watch
from vfguide.lab.studies.array_wind import SwingingWind
from vfguide.lab.studies.article import article_mission
from vfguide.lab.studies.spread import flown_by
from vfguide.mission.controller import Controller, gains_of
from vfguide.mission.model import Mission
from vfguide.registry import laws

BATCH = 1024
"""Formations at once: more of them do not fit the processor's cache."""

DURATION_S = 120.0

GREATEST_WIND = 0.4
"""Of the leader's airspeed."""

GREATEST_SWING_RATE = 0.1
"""rad/s: the article's."""

START_SPREAD_M = 100.0
"""Displacement of everybody at the start, on each axis."""

SLOT_RANGE_M = (-60.0, 60.0)

LEAST_SPACING_M = 15.0
"""Between any two slots and from the leader."""

GAIN_FACTOR = 2.0
"""Gains of the law and kappa are up to this many times those of the mission, or that part of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Formations that share slots and gains; can be handed to another process."""

    law: str
    """Of the followers."""
    count: int
    """Of formations."""
    seed: tuple[int, ...]
    """Of everything random in it."""
    mission: str = "circle-wind"
    """Whose path is flown."""
    duration_s: float = DURATION_S
    """Of the flights."""
    position_noise_m: float = 0.0
    """Of the reports."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatchResult:
    """What a batch came to."""

    batch: Batch
    """Which."""
    outcome: Outcome
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


def drawn_start(mission: Mission, count: int, random: Generator) -> Start:
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
