"""What the searches for the baselines' gains look for: as stiff as the field's own setpoints allow.

Every candidate flies the calm missions, and nothing else. It is admitted if it has settled when errors begin
to count, and if its setpoints of course and of speed vary no more than the field's own do there. Of those
admitted, the least error in calm air counts; of those within a millimetre of it, the least error after a
push: in the second half the followers' holds hold something beside what they are told, and nobody measures
it. Answering such a load is what a controller is there for (Astrom and Hagglund, Advanced PID Control, 2006,
chapter 4). Without the push calm air would choose the softest, and without the bound the push the stiffest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vfguide.bench.array_case import Push
from vfguide.bench.array_formation import fly_formations
from vfguide.bench.array_ground import Plane
from vfguide.bench.array_mission import conditions_of, start_of
from vfguide.bench.array_outcome import Outcome, Watch
from vfguide.bench.article import Changes, article_mission
from vfguide.elementwise import BoolArray, FloatArray
from vfguide.guidance.settings import MpcWeights, PidGains
from vfguide.mission.model import Mission
from vfguide.state import Setpoint

CALM = ("line-calm", "circle-calm")
CALM_S, DURATION_S = 60.0, 120.0
"""How long nothing disturbs, and how long is flown."""

PUSH = Push(course=math.radians(3.0), speed=1.5, from_s=CALM_S)
"""1.2 m/s² on each axis, for holds of 1.2 and 0.8 1/s at 20 m/s: far more than what rounding does."""

TIE_M = 1e-3
"""Errors in calm air that are this close are equal: positions are reported in steps of 11 mm."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """What the candidates came to on one mission, an entry each."""

    error_m: FloatArray
    """Mean distance from the slots in calm air."""
    pushed_m: FloatArray
    """The same after the push."""
    course_rad_s: FloatArray
    """Back and forth of the course setpoints in calm air."""
    speed_m_s2: FloatArray
    """Variation of the speed setpoints in calm air."""
    settle_1m_s: FloatArray
    """When everybody was within 1 m for good; infinite: not before the push."""


def trials_of(calm: Outcome, pushed: Outcome) -> Trials:
    """By what came of the undisturbed part and of the whole."""
    return Trials(
        error_m=calm.mean_error_m,
        pushed_m=pushed.mean_error_m,
        course_rad_s=calm.chatter_rad_s,
        speed_m_s2=calm.speed_variation_m_s2,
        settle_1m_s=calm.settle_1m_s,
    )


def fly_trials(
    name: str,
    law: str,
    count: int = 1,
    *,
    followers: Sequence[str] = ("f1", "f2", "f3"),
    pid: PidGains[FloatArray] | None = None,
    mpc: Sequence[MpcWeights] | None = None,
) -> Trials:
    """Fly a calm mission by so many candidates of one law; with the mission's own gains if none are given."""
    mission = mission_of(name, law, followers)
    conditions = replace(conditions_of(mission, Plane(), rounded=True), calibrates=False, push=PUSH)
    calm, whole = Watch(CALM_S), Watch(DURATION_S)

    def watch(time_s: float, distances: FloatArray, setpoint: Setpoint[FloatArray] | None) -> None:
        calm(time_s, distances, setpoint)
        whole(time_s, distances, setpoint)

    # Candidates that fly away may overflow: they have not settled.
    with np.errstate(over="ignore", invalid="ignore"):
        fly_formations(start_of(mission, count, pid=pid, mpc=mpc), conditions, watch)
    return trials_of(calm.outcome(), whole.outcome())


def mission_of(name: str, law: str, followers: Sequence[str]) -> Mission:
    """A mission flown by a law, with some of its followers."""
    changes: Changes = {"controller": {"type": law}, "rehearsal": {"duration_s": DURATION_S}}
    content = article_mission(name, changes).model_dump(exclude_unset=True)
    absent = {one["vehicle"] for one in content["followers"]} - set(followers)
    content["followers"] = [one for one in content["followers"] if one["vehicle"] not in absent]
    for one in absent:
        del content["vehicles"][one], content["rehearsal"]["start"][one]
    return Mission.model_validate(content)


def admitted(trials: Sequence[Trials], field: Sequence[Trials]) -> BoolArray:
    """Which candidates settle, and ask for no more than the field does; a mission each."""
    fine = [
        (one.settle_1m_s < CALM_S / 2.0)
        & (one.course_rad_s <= allowed.course_rad_s)
        & (one.speed_m_s2 <= allowed.speed_m_s2)
        for one, allowed in zip(trials, field, strict=True)
    ]
    return np.asarray(np.all(fine, axis=0))


def ranked(trials: Sequence[Trials], field: Sequence[Trials]) -> list[int]:
    """The candidates' numbers, the best first: only those admitted."""
    error = np.mean([one.error_m for one in trials], axis=0)
    pushed = np.mean([one.pushed_m for one in trials], axis=0)
    fine = np.flatnonzero(admitted(trials, field))
    if not fine.size:
        return []
    worse = np.maximum(error - error[fine].min() - TIE_M, 0.0)
    return sorted((int(one) for one in fine), key=lambda one: (worse[one], pushed[one]))
