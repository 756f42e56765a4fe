"""Saturation, and what a fixed-wing aircraft cannot exceed."""

import math

from vfguide.elementwise import Number, clip, like
from vfguide.guidance.wind_triangle import ground_speed_on_course
from vfguide.state import Airframe, VehicleState

GRAVITY = 9.80665
"""Standard gravity, m/s²."""


def saturation(value: Number) -> Number:
    """sat(.) of the sliding-mode laws: the value itself inside [-1, 1], its sign outside."""
    return clip(value, -1.0, 1.0)


def bank_limited_turn_rate(max_bank: float, speed: Number) -> Number:
    """Greatest turn rate (rad/s) of a coordinated turn: g tan(phi_max) / V.

    Args:
        max_bank: bank limit phi_max, rad, in (0, pi/2).
        speed: speed V through the medium that is turned in, m/s, positive.
    """
    return GRAVITY * math.tan(max_bank) / speed


def speed_range(state: VehicleState[Number], airframe: Airframe) -> tuple[Number, Number]:
    """(slowest, fastest) that a vehicle's speed hold may be told, m/s.

    Of a heading hold it is the airspeed range; of a course hold the ground speeds that the airspeed range
    comes to on the present course, in the present wind.
    """
    if airframe.hold == "course-hold":
        return ground_speed_range(state.course, state.wind_north, state.wind_east, airframe)
    return (
        like(airframe.airspeed_min, state.airspeed),
        like(airframe.airspeed_max, state.airspeed),
    )


def ground_speed_range(
    course: Number, wind_north: Number, wind_east: Number, airframe: Airframe
) -> tuple[Number, Number]:
    """(slowest, fastest) ground speed on a course (rad) in a wind (m/s, toward), m/s: the wind triangle."""
    slowest = like(airframe.airspeed_min, course)
    fastest = like(airframe.airspeed_max, course)
    return (
        ground_speed_on_course(slowest, course, wind_north, wind_east),
        ground_speed_on_course(fastest, course, wind_north, wind_east),
    )
