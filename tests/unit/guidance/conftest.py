"""States to start from and a kinematic plant, for tests that close a loop in a few lines."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict, Unpack

import pytest
from msgspec.structs import replace

from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.settings import GuidanceSettings, ObserverGains, SlidingGains, SpeedSource
from vfguide.state import LeaderState, VehicleState


@dataclass(slots=True)
class Plant:
    """The article's vehicle: first-order holds on course and ground speed, no limits."""

    north: float = 0.0
    east: float = 0.0
    course: float = 0.0
    speed: float = 20.0
    alpha: float = 1.2
    beta: float = 0.8

    def fly(self, course: float, speed: float, period: float) -> None:
        """Hold a course and a speed for a period: exact responses, position by the midpoint."""
        before_course, before_speed = self.course, self.speed
        self.course = course + (self.course - course) * math.exp(-self.alpha * period)
        self.speed = speed + (self.speed - speed) * math.exp(-self.beta * period)
        mean_course = (before_course + self.course) / 2.0
        distance = (before_speed + self.speed) / 2.0 * period
        self.north += distance * math.cos(mean_course)
        self.east += distance * math.sin(mean_course)


class Changes(TypedDict, total=False):
    """What tests change of the settings."""

    filters: FilterTimes
    speed_source: SpeedSource
    predict_leader: bool
    wind_feedforward: bool
    give_way: bool


@pytest.fixture(scope="session")
def plant() -> Callable[..., Plant]:
    return Plant


@pytest.fixture(scope="session")
def vehicle() -> Callable[..., VehicleState[float]]:
    """A state whose wind triangle closes: heading and airspeed follow from course, speed and wind."""

    def make(
        north: float = 0.0,
        east: float = 0.0,
        course: float = 0.0,
        ground_speed: float = 20.0,
        *,
        wind: tuple[float, float] = (0.0, 0.0),
        wind_rate: tuple[float, float] = (0.0, 0.0),
        time_s: float = 0.0,
    ) -> VehicleState[float]:
        air_north = ground_speed * math.cos(course) - wind[0]
        air_east = ground_speed * math.sin(course) - wind[1]
        return VehicleState(
            time_s=time_s,
            north=north,
            east=east,
            course=course,
            ground_speed=ground_speed,
            heading=math.atan2(air_east, air_north),
            airspeed=math.hypot(air_north, air_east),
            wind_north=wind[0],
            wind_east=wind[1],
            wind_rate_north=wind_rate[0],
            wind_rate_east=wind_rate[1],
            wind_jerk_north=0.0,
            wind_jerk_east=0.0,
        )

    return make


@pytest.fixture(scope="session")
def leader() -> Callable[..., LeaderState[float]]:
    """A leader at the origin that flies north at 20 m/s, but for what is given."""
    usual = LeaderState(
        time_s=0.0,
        north=0.0,
        east=0.0,
        course=0.0,
        ground_speed=20.0,
        acceleration=0.0,
        turn_rate=0.0,
        turn_acceleration=0.0,
    )

    def make(**changes: float) -> LeaderState[float]:
        return replace(usual, **changes)

    return make


@pytest.fixture(scope="session")
def choices() -> Callable[..., GuidanceSettings]:
    """What a mission file chooses by default, but for what is given."""
    usual = GuidanceSettings(
        sliding=SlidingGains(
            kappa=3.0, epsilon=0.01, boundary_layer_factor=3.5, loop_delay_s=0.0, rho=50.0
        ),
        observer=ObserverGains(gamma=1.0, rho=200.0, sigma=0.5),
        filters=FilterTimes(position_s=2.0, wind_s=0.2),
        rate_filter_s=0.4,
        speed_source="measured",
        predict_leader=True,
        wind_feedforward=True,
        give_way=True,
    )

    def make(**changes: Unpack[Changes]) -> GuidanceSettings:
        return replace(usual, **changes)

    return make
