"""States of vehicles and leaders to start from, and a kinematic plant to close a loop in a few lines."""

import math
from dataclasses import dataclass
from typing import Any, TypedDict, Unpack

from msgspec.structs import replace

from vfguide.companion.possibilities import Viewpoint
from vfguide.frames import LocalFrame
from vfguide.guidance.navigation import FilterTimes
from vfguide.guidance.sliding_laws import GuidanceSettings, ObserverGains, SlidingGains, SpeedSource
from vfguide.link.codec import LeaderMessage
from vfguide.mavlink.reports import PositionReport
from vfguide.state import LeaderState, VehicleState

FRAME = LocalFrame(47.397742, 8.545594, 488.0)
"""Around the origin of line-calm."""

NORTHBOUND: LeaderState = LeaderState(
    time_s=0.0,
    north=0.0,
    east=0.0,
    course=0.0,
    ground_speed=20.0,
    acceleration=0.0,
    turn_rate=0.0,
    turn_acceleration=0.0,
)

USUAL = GuidanceSettings(
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
"""What a mission file chooses by default."""

SAID = LeaderMessage(
    sequence=7,
    time_s=123.25,
    latitude_deg=47.397742,
    longitude_deg=8.545594,
    altitude_amsl=588.0,
    course=0.5,
    ground_speed=22.0,
    acceleration=-0.25,
    turn_rate=0.125,
    turn_acceleration=0.0625,
    climb_rate=3.0,
    term=2,
    arrangement=5,
)


GREATEST = {
    "latitude_deg": 90.0,
    "longitude_deg": 180.0,
    "altitude_amsl": 50_000.0,
    "course": 10.0,
    "ground_speed": 500.0,
    "acceleration": 100.0,
    "turn_rate": 10.0,
    "turn_acceleration": 100.0,
    "climb_rate": 200.0,
}
"""Greatest magnitudes of a leader's motion as it crosses the link."""


def vehicle_at(
    north: float = 0.0,
    east: float = 0.0,
    course: float = 0.0,
    ground_speed: float = 20.0,
    *,
    wind: tuple[float, float] = (0.0, 0.0),
    wind_rate: tuple[float, float] = (0.0, 0.0),
    time_s: float = 0.0,
    height: float = 0.0,
) -> VehicleState:
    """Make a state whose wind triangle closes: heading and airspeed follow from the rest."""
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
        height=height,
    )


def leader_at(**changes: float) -> LeaderState:
    """Make a leader at the origin that flies north at 20 m/s, but for what is given."""
    return replace(NORTHBOUND, **changes)


def reported(
    time_s: float = 1.0,
    north: float = 0.0,
    east: float = 0.0,
    *,
    velocity: tuple[float, float] = (20.0, 0.0),
    heading: float | None = 0.0,
) -> PositionReport:
    """Make a report of a place around the origin of line-calm, 588 m high."""
    latitude, longitude = FRAME.to_geodetic(north, east)
    return PositionReport(
        boot_time_s=time_s,
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl=588.0,
        velocity_north=velocity[0],
        velocity_east=velocity[1],
        heading=heading,
    )


def view(time_s: float, north: float = 0.0, east: float = 0.0, **changes: Any) -> Viewpoint:
    """Make the view of a vehicle that flies north at 20 m/s in calm air, 588 m high."""
    flight = {"velocity": 20.0 + 0j, "wanted": 20.0 + 0j, "wind": 0j, "astray": 0.0}
    height = {"altitude_amsl": 588.0, "climb_rate": 0.0, "reaction_s": 2.0}
    return Viewpoint(time_s=time_s, place=complex(north, east), **(flight | height | changes))


def circling(time_s: float) -> LeaderState:
    """Make a leader on a circle of 150 m about the origin, clockwise at 20 m/s, 150 m north at first."""
    bearing = 20.0 / 150.0 * time_s
    return leader_at(
        time_s=time_s,
        north=150.0 * math.cos(bearing),
        east=150.0 * math.sin(bearing),
        course=bearing + math.pi / 2.0,
        turn_rate=20.0 / 150.0,
    )


def leader_message(**values: float) -> LeaderMessage:
    """Make a leader state as it crosses the link, with some values of interest."""
    return replace(SAID, **values)


class Changes(TypedDict, total=False):
    """What tests change of the settings."""

    filters: FilterTimes
    speed_source: SpeedSource
    predict_leader: bool
    wind_feedforward: bool
    give_way: bool


def choices(**changes: Unpack[Changes]) -> GuidanceSettings:
    """Choose what a mission file chooses by default, but for what is given."""
    return replace(USUAL, **changes)


@dataclass(slots=True)
class Plant:
    """The article's vehicle: first-order holds on course and ground speed, no limits."""

    north: float = 0.0
    east: float = 0.0
    course: float = 0.0
    speed: float = 20.0
    alpha: float = 1.2
    beta: float = 0.8

    def state(self, time_s: float = 0.0) -> VehicleState:
        """Return what it reports at a time, in calm air."""
        return vehicle_at(self.north, self.east, self.course, self.speed, time_s=time_s)

    def fly(self, course: float, speed: float, period: float) -> None:
        """Hold a course and a speed for a period: exact responses, position by the midpoint."""
        before_course, before_speed = self.course, self.speed
        self.course = course + (self.course - course) * math.exp(-self.alpha * period)
        self.speed = speed + (self.speed - speed) * math.exp(-self.beta * period)
        mean_course = (before_course + self.course) / 2.0
        distance = (before_speed + self.speed) / 2.0 * period
        self.north += distance * math.cos(mean_course)
        self.east += distance * math.sin(mean_course)
