"""Motion over the WGS-84 ellipsoid, without any local flat origin."""

import math

from sitl_stub.angles import wrap_to_pi

SEMI_MAJOR_AXIS_M = 6_378_137.0
"""Equatorial radius of WGS-84."""

ECCENTRICITY_SQUARED = 6.694379990141316e-3
"""First eccentricity of WGS-84, squared: f (2 - f) with f = 1/298.257223563."""


def radii_m(latitude_rad: float) -> tuple[float, float]:
    """Radii of curvature at a geodetic latitude: meridian M (north-south), prime vertical N (east).

    N = a / sqrt(s), M = a (1 - e^2) / s^(3/2) with s = 1 - e^2 sin^2(latitude).
    """
    sine = math.sin(latitude_rad)
    shrink = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    transverse_m = SEMI_MAJOR_AXIS_M / math.sqrt(shrink)
    return transverse_m * (1.0 - ECCENTRICITY_SQUARED) / shrink, transverse_m


def displace(
    latitude_rad: float, longitude_rad: float, height_m: float, *, north_m: float, east_m: float
) -> tuple[float, float]:
    """Position after a short displacement: dlat = n / (M + h), dlon = e / ((N + h) cos lat).

    Latitude, longitude and result are geodetic radians. The radii are frozen over the displacement,
    which is meant to be one integration step (metres): over 1 m they change by 1e-8 of themselves.
    The poles are the formula's own singularity.
    """
    meridian_m, transverse_m = radii_m(latitude_rad)
    parallel_m = (transverse_m + height_m) * math.cos(latitude_rad)
    return (
        latitude_rad + north_m / (meridian_m + height_m),
        wrap_to_pi(longitude_rad + east_m / parallel_m),
    )
