"""Steps of a law for one follower, without a mission around it."""

import math
from collections.abc import Callable

from tests.kit.states import Plant, leader_at
from vfguide.guidance.formation import Slot
from vfguide.guidance.sliding_laws import GuidanceSettings
from vfguide.laws.base import FollowerGuidance, SlotKeeper
from vfguide.registry import laws
from vfguide.state import Airframe, LeaderState, VehicleState


def keeper(
    name: str, settings: GuidanceSettings, slot: Slot, airframe: Airframe, **gains: object
) -> SlotKeeper:
    """A law of this name with its usual gains, but for what is given."""
    law = laws.find(name)
    return SlotKeeper(law(law.Gains(**gains), settings, airframe), slot)


def follower_step(
    state: VehicleState,
    leader: LeaderState,
    slot: Slot,
    settings: GuidanceSettings,
    airframe: Airframe,
    *,
    period: float,
    law: str = "slot",
    **gains: object,
) -> FollowerGuidance:
    """The first step of a law, with its usual gains but for what is given."""
    return keeper(law, settings, slot, airframe, **gains).step(state, leader, period=period)


def follow(
    follower: SlotKeeper,
    plant: Plant,
    motion: Callable[[float], LeaderState],
    seconds: float,
    *,
    period: float = 0.05,
    biased: Callable[[Plant], tuple[float, float]] = lambda _: (0.0, 0.0),
) -> list[FollowerGuidance]:
    """Steps of a law behind a leader that moves so, closed around a plant.

    The holds of the plant are off by so much, rad and m/s.
    """
    steps = []
    for number in range(round(seconds / period)):
        time_s = number * period
        steps.append(follower.step(plant.state(time_s), motion(time_s), period=period))
        (course, speed), setpoint = biased(plant), steps[-1].setpoint
        plant.fly(setpoint.course + course, setpoint.speed + speed, period)
    return steps


def northward(time_s: float) -> LeaderState:
    """A leader that flies north from the origin at 20 m/s."""
    return leader_at(time_s=time_s, north=20.0 * time_s)


def distance(guidance: FollowerGuidance) -> float:
    """From the slot, m."""
    return math.hypot(guidance.error.along_track, guidance.error.cross_track)
