"""What is flown in the array form: a batch of formations, and what they have in common."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.formation import Slot
from vfguide.guidance.settings import GuidanceSettings
from vfguide.guidance.wind_triangle import ground_speed_on_course
from vfguide.lab.studies.array_ground import Ground
from vfguide.lab.studies.array_plant import Fleet, Targets
from vfguide.lab.studies.array_wind import SwingingWind
from vfguide.laws.base import Law
from vfguide.laws.leader import LeaderTask
from vfguide.mission.quantity import Section
from vfguide.state import Airframe, Setpoint


@dataclass(frozen=True, slots=True, kw_only=True)
class Push:
    """A disturbance that nobody measures: the followers' holds hold something beside their setpoints."""

    course: float
    """rad, to the right."""
    speed: float
    """m/s, too fast."""
    from_s: float
    """When it begins."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What a batch of formations has in common."""

    task: LeaderTask
    """Of every leader."""
    settings: GuidanceSettings
    """Of every law."""
    law: type[Law]
    """Of every follower."""
    airframe: Airframe
    """What the laws take the vehicles for."""
    plant: Airframe
    """What the vehicles are."""
    ground: Ground
    """What they fly over, and how positions are reported."""
    rounded: bool
    """Whether reports and setpoints are rounded as MAVLink rounds them."""
    rate_hz: float
    """Of the loop."""
    duration_s: float
    """Of the flights."""
    link_delay_s: float
    """Age of a leader state on arrival."""
    calibrates: bool = True
    """Whether everybody calibrates its airspeed, as companions do; here it is the true one already."""
    position_noise_m: float = 0.0
    """Standard deviation of the reported positions on each axis."""
    push: Push | None = None
    """What disturbs the followers."""
    engaged_after_s: float = 1.0
    """The companion's first try to engage its autopilot; the setpoints begin one step later."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """Where everybody begins, 1 + F rows by M columns, and in which wind."""

    north: FloatArray
    """m."""
    east: FloatArray
    """m."""
    course: FloatArray
    """rad."""
    airspeed: float
    """m/s."""
    wind: SwingingWind
    """Of each formation."""
    slot: Slot[FloatArray]
    """Offsets, F by 1 or F by M."""
    gains: Section
    """Of the followers' law; a value may be an array with one for each formation."""


Watcher = Callable[[float, FloatArray, Setpoint[FloatArray] | None], None]
"""Hears the time, the distances from the slots (F by M, m) and the followers' setpoints, at each step."""


def fleet_at(start: Start, conditions: Conditions) -> Fleet:
    """The vehicles in the air, loitering."""
    wind_north, wind_east = start.wind.at(0.0)
    airspeed = np.full_like(start.course, start.airspeed)
    direction = start.course
    if conditions.plant.hold == "heading-hold":
        over_ground = ground_speed_on_course(airspeed, start.course, wind_north, wind_east)
        direction = np.arctan2(
            over_ground * np.sin(start.course) - wind_east,
            over_ground * np.cos(start.course) - wind_north,
        )
    return Fleet(
        airframe=conditions.plant,
        ground=conditions.ground,
        wind=start.wind,
        direction=direction,
        speed=airspeed,
        place=conditions.ground.place(start.north, start.east),
        targets=Targets(None, airspeed),
    )
