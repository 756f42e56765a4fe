"""Angles, the wind triangle, and motion over the WGS-84 ellipsoid without a local flat origin.

Angles are in radians, clockwise from north. Ground velocity is air velocity plus wind.
"""

import math

import msgspec

MIN_GROUND_SPEED_M_S = 0.1
"""Floor of the ground speed along a course, so that dividing by it stays finite."""

SEMI_MAJOR_AXIS_M = 6_378_137.0
"""Equatorial radius of WGS-84."""

ECCENTRICITY_SQUARED = 6.694379990141316e-3
"""First eccentricity of WGS-84, squared: f (2 - f) with f = 1/298.257223563."""


def wrap_to_pi(angle_rad: float) -> float:
    """Wrap a direction or an error between two courses to (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return wrapped if wrapped > -math.pi else math.pi


def wrap_to_two_pi(angle_rad: float) -> float:
    """Wrap a direction to [0, 2 pi), as a compass reads."""
    wrapped = angle_rad % math.tau
    # A tiny negative angle rounds up to the full circle.
    return wrapped if wrapped < math.tau else 0.0


def ground_speed_along_m_s(
    course_rad: float, airspeed_m_s: float, wind_north_m_s: float, wind_east_m_s: float
) -> float:
    """Return the ground speed along a course: V_g = w_along + sqrt(V_a^2 - w_across^2).

    Source: the article's model equations, solved for V_g at a given course (Beard & McLain, Small
    Unmanned Aircraft, ch. 2). Where the crosswind exceeds the airspeed, no heading holds the course:
    the root is then zero (nose fully across, only the along-wind left). The result is never below
    `MIN_GROUND_SPEED_M_S`, so it stays usable in a headwind faster than the airspeed.
    """
    along = wind_north_m_s * math.cos(course_rad) + wind_east_m_s * math.sin(course_rad)
    across = wind_east_m_s * math.cos(course_rad) - wind_north_m_s * math.sin(course_rad)
    forward_squared = airspeed_m_s * airspeed_m_s - across * across
    forward = math.sqrt(forward_squared) if forward_squared > 0.0 else 0.0
    return max(along + forward, MIN_GROUND_SPEED_M_S)


def airspeed_of_m_s(
    course_rad: float, ground_speed_m_s: float, wind_north_m_s: float, wind_east_m_s: float
) -> float:
    """Return the airspeed of a ground velocity, |v_g - w|, which always exists."""
    return math.hypot(
        ground_speed_m_s * math.cos(course_rad) - wind_north_m_s,
        ground_speed_m_s * math.sin(course_rad) - wind_east_m_s,
    )


def radii_m(latitude_rad: float) -> tuple[float, float]:
    """Return the radii of curvature at a geodetic latitude: meridian M (north), prime vertical N (east).

    N = a / sqrt(s), M = a (1 - e^2) / s^(3/2) with s = 1 - e^2 sin^2(latitude).
    """
    sine = math.sin(latitude_rad)
    shrink = 1.0 - ECCENTRICITY_SQUARED * sine * sine
    transverse_m = SEMI_MAJOR_AXIS_M / math.sqrt(shrink)
    return transverse_m * (1.0 - ECCENTRICITY_SQUARED) / shrink, transverse_m


def displace(
    latitude_rad: float, longitude_rad: float, height_m: float, *, north_m: float, east_m: float
) -> tuple[float, float]:
    """Return the position after a short displacement: dlat = n / (M + h), dlon = e / ((N + h) cos lat).

    Latitude and longitude are geodetic, in radians. The radii are constant over the displacement, which
    should be one integration step (metres): over 1 m they change by a factor of 1e-8. The formula is
    singular at the poles.
    """
    meridian_m, transverse_m = radii_m(latitude_rad)
    parallel_m = (transverse_m + height_m) * math.cos(latitude_rad)
    return (
        latitude_rad + north_m / (meridian_m + height_m),
        wrap_to_pi(longitude_rad + east_m / parallel_m),
    )


class Home(msgspec.Struct, frozen=True):
    """Geodetic position of the start on the ground."""

    latitude_rad: float
    longitude_rad: float
    altitude_amsl_m: float
