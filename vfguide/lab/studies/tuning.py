"""What the searches for gains look for, the field's and the baselines' alike: as stiff as setpoints allow.

Every candidate flies the calm missions, and nothing else. It is admitted if it has settled when errors begin
to count, and if its setpoints of course and of speed vary no more than is allowed to every law. Of those
admitted, the least error in calm air counts; of those within two millimetres of it, the least error after a
push: in the second half the followers' holds hold something beside what they are told, and nobody measures
it. Answering such a load is what a controller is there for (Astrom and Hagglund, Advanced PID Control, 2006,
chapter 4). Without the push calm air would choose the softest, and without the bound the push the stiffest.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.lab.studies.array_case import ArrayOutcome, Push, Watch, conditions_of, start_of
from vfguide.lab.studies.array_formation import fly_formations
from vfguide.lab.studies.array_plant import Plane
from vfguide.lab.studies.flown import Changes, article_mission
from vfguide.mission.controller import gains_of
from vfguide.mission.model import Mission
from vfguide.state import Setpoint

CALM = ("line-calm", "circle-calm")
CALM_S, DURATION_S = 60.0, 120.0
"""How long nothing disturbs, and how long is flown."""

PUSH = Push(course=math.radians(3.0), speed=1.5, from_s=CALM_S)
"""1.2 m/s² on each axis, for holds of 1.2 and 0.8 1/s at 20 m/s: far more than what rounding does."""

TIE_M = 2e-3
"""Errors in calm air that are this close are equal: on a line it is chance how positions and velocities,
reported in steps of 11 mm and 1 cm/s, are rounded; the same gains are 2 mm nearer or farther for it."""

COURSE_RAD_S = 0.03
"""Greatest back and forth of the course setpoints in calm air: a tenth of a degree between two at 20 Hz."""

SPEED_M_S2 = 1.4
"""Greatest variation of the speed setpoints in calm air: 7 cm/s between two at 20 Hz."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trials:
    """What the candidates came to on one mission, an entry each."""

    error_m: FloatArray
    """Mean distance from the slots in calm air."""
    pushed_m: FloatArray
    """Mean distance from the slots after the push."""
    course_rad_s: FloatArray
    """Back and forth of the course setpoints in calm air."""
    speed_m_s2: FloatArray
    """Variation of the speed setpoints in calm air."""
    settle_1m_s: FloatArray
    """When everybody was within 1 m for good; infinite: not before the push."""


def trials_of(calm: ArrayOutcome, pushed: ArrayOutcome) -> Trials:
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
    controller: Mapping[str, float] | None = None,
    gains: Mapping[str, FloatArray] | None = None,
) -> Trials:
    """Fly a calm mission by so many candidates of one law; with the mission's own gains if none are given.

    Args:
        name: of the mission.
        law: type of the controller.
        count: of candidates.
        followers: that take part.
        controller: fields of the mission's controller, for all candidates alike.
        gains: of the law that the candidates differ by, an entry for each of them.
    """
    mission = mission_of(name, law, followers, controller)
    chosen = gains_of(mission.controller).model_copy(update=gains)
    conditions = replace(conditions_of(mission, Plane(), rounded=True), calibrates=False, push=PUSH)
    calm, whole = Watch(CALM_S), Watch(DURATION_S)

    def watch(time_s: float, distances: FloatArray, setpoint: Setpoint[FloatArray] | None) -> None:
        calm(time_s, distances, setpoint)
        whole(time_s, distances, setpoint)

    # Candidates that fly away may overflow: they have not settled.
    with np.errstate(over="ignore", invalid="ignore"):
        fly_formations(start_of(mission, count, gains=chosen), conditions, watch)
    return trials_of(calm.outcome(), whole.outcome())


def mission_of(
    name: str, law: str, followers: Sequence[str], controller: Mapping[str, float] | None = None
) -> Mission:
    """A mission flown by a law with some gains, with some of its followers."""
    changes: Changes = {
        "controller": {"type": law, "slot_frame": "leader", **(controller or {})},
        "rehearsal": {"duration_s": DURATION_S},
    }
    content = article_mission(name, changes).model_dump(exclude_unset=True)
    absent = {one["vehicle"] for one in content["followers"]} - set(followers)
    content["followers"] = [one for one in content["followers"] if one["vehicle"] not in absent]
    for one in absent:
        del content["vehicles"][one], content["rehearsal"]["start"][one]
    return Mission.model_validate(content)


def admitted(trials: Sequence[Trials]) -> BoolArray:
    """Which candidates settle, and ask for no more than is allowed; a mission each."""
    fine = [
        (one.settle_1m_s < CALM_S / 2.0)
        & (one.course_rad_s <= COURSE_RAD_S)
        & (one.speed_m_s2 <= SPEED_M_S2)
        for one in trials
    ]
    return np.asarray(np.all(fine, axis=0))


def ranked(trials: Sequence[Trials]) -> list[int]:
    """The candidates' numbers, the best first: only those admitted."""
    error = np.mean([one.error_m for one in trials], axis=0)
    pushed = np.mean([one.pushed_m for one in trials], axis=0)
    fine = np.flatnonzero(admitted(trials))
    if not fine.size:
        return []
    worse = np.maximum(error - error[fine].min() - TIE_M, 0.0)
    return sorted((int(one) for one in fine), key=lambda one: (worse[one], pushed[one]))


def trial_line(trials: Sequence[Trials], index: int) -> str:
    """What a candidate came to, mission by mission."""
    return "; ".join(
        f"{name} {one.error_m[index]:.4f} m, pushed {one.pushed_m[index]:.4f} m, "
        f"{one.course_rad_s[index]:.4f} rad/s, {one.speed_m_s2[index]:.3f} m/s², within 1 m after "
        f"{one.settle_1m_s[index]:.1f} s"
        for name, one in zip(CALM, trials, strict=True)
    )
