"""The wind triangle: ground velocity is air velocity plus wind."""

import math

MIN_GROUND_SPEED_M_S = 0.1
"""Floor of a ground speed along a course, so that it stays positive and dividing by it finite."""


def ground_speed_along_m_s(
    course_rad: float, airspeed_m_s: float, wind_north_m_s: float, wind_east_m_s: float
) -> float:
    """Ground speed along a course: V_g = w_along + sqrt(V_a^2 - w_across^2).

    Source: the article's model equations, solved for V_g at a given course (Beard & McLain, Small
    Unmanned Aircraft, ch. 2). Where the crosswind exceeds the airspeed no heading holds the course:
    the root is then taken as zero (nose fully across, only the along-wind left). The result is
    never below `MIN_GROUND_SPEED_M_S`, so it stays usable in a headwind that cannot be beaten.
    """
    along = wind_north_m_s * math.cos(course_rad) + wind_east_m_s * math.sin(course_rad)
    across = wind_east_m_s * math.cos(course_rad) - wind_north_m_s * math.sin(course_rad)
    forward_squared = airspeed_m_s * airspeed_m_s - across * across
    forward = math.sqrt(forward_squared) if forward_squared > 0.0 else 0.0
    return max(along + forward, MIN_GROUND_SPEED_M_S)


def airspeed_of_m_s(
    course_rad: float, ground_speed_m_s: float, wind_north_m_s: float, wind_east_m_s: float
) -> float:
    """Airspeed that belongs to a ground velocity: |v_g - w|, always defined."""
    return math.hypot(
        ground_speed_m_s * math.cos(course_rad) - wind_north_m_s,
        ground_speed_m_s * math.sin(course_rad) - wind_east_m_s,
    )
