"""The place where a flight started."""

import math
from dataclasses import dataclass

from sitl_stub.earth import displace


@dataclass(frozen=True, slots=True)
class Home:
    """Where the flight started, on the ground."""

    latitude_rad: float
    """Geodetic latitude."""

    longitude_rad: float
    """Longitude."""

    altitude_amsl_m: float
    """Altitude of the ground there."""


def ahead_of(home: Home, course_rad: float, distance_m: float) -> tuple[float, float]:
    """Latitude and longitude (rad) of the point at this distance on this course."""
    return displace(
        home.latitude_rad,
        home.longitude_rad,
        home.altitude_amsl_m,
        north_m=distance_m * math.cos(course_rad),
        east_m=distance_m * math.sin(course_rad),
    )
