"""Steps of an emulated aircraft with its loops, without an autopilot around it."""

import math
from collections.abc import Callable
from typing import Literal

from sitl_stub import CalmWind, PlantParameters, Wind, plant_of
from sitl_stub.loops import AltitudeTarget, SpeedKind, SpeedTarget, Targets, TurnTarget
from sitl_stub.plant import PlantState


def held(
    angle_rad: float = 0.0,
    speed_m_s: float = 20.0,
    altitude_m: float = 500.0,
    *,
    hold: Literal["course", "heading", "bank"] = "course",
    speed: SpeedKind = "airspeed",
) -> Targets:
    """Hold a course of north at 20 m/s, 500 m above the sea, but for what is given."""
    return Targets(
        TurnTarget(hold, angle_rad), SpeedTarget(speed, speed_m_s), AltitudeTarget(altitude_m)
    )


def plant_state(
    direction_rad: float = 0.0, speed_m_s: float = 20.0, speed: SpeedKind = "airspeed"
) -> PlantState:
    """Make a state over 47 N, 500 m above the sea."""
    return PlantState(direction_rad, speed_m_s, speed, math.radians(47.0), 0.1, 500.0)


def flown(
    plant: PlantParameters,
    wanted: Targets | Callable[[float], Targets],
    seconds: float,
    wind: Wind | None = None,
    *,
    step_s: float = 0.005,
    start: PlantState | None = None,
) -> list[PlantState]:
    """Fly what is held, which may change over time; return the state before each step and after."""
    aircraft, states = plant_of(plant), [start or plant_state()]
    for index in range(round(seconds / step_s)):
        now_s = index * step_s
        aim = wanted if isinstance(wanted, Targets) else wanted(now_s)
        state = aircraft.step(aim, states[-1], wind or CalmWind(), time_s=now_s, step_s=step_s)
        states.append(state)
    return states
