"""From the wanted change of the ground velocity to what an autopilot's holds must be told, within limits."""

from vfguide.elementwise import Number, clip, greater_of
from vfguide.guidance.limits import bank_limited_turn_rate, speed_range
from vfguide.guidance.sliding_laws import acceleration_toward, course_command, speed_command
from vfguide.guidance.wind_triangle import (
    air_relative_rates,
    ground_speed_on_course,
    heading_rate_at_constant_airspeed,
)
from vfguide.state import Airframe, Setpoint, VehicleState

LEAST_GROUND_SPEED = 1.0
"""m/s: an aircraft that stands still turns at no rate that can be worked out."""


def setpoint_for(
    state: VehicleState[Number],
    acceleration: Number,
    course_rate: Number,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint[Number]:
    """Setpoint for a wanted ground acceleration (m/s²) and course rate (rad/s).

    Args:
        state: navigated state of the vehicle.
        acceleration: wanted dV_g/dt.
        course_rate: wanted dchi/dt.
        airframe: what the autopilot holds, how it responds, what the vehicle can do.
        wind_feedforward: whether the wind's rate of change is taken off.
        hold: how long the setpoint stands, s.
    """
    if airframe.hold == "course-hold":
        return _course_hold(state, acceleration, course_rate, airframe, hold)
    share = 1.0 if wind_feedforward else 0.0
    airspeed_rate, heading_rate = air_relative_rates(
        acceleration,
        course_rate,
        ground_speed=state.ground_speed,
        course=state.course,
        airspeed=state.airspeed,
        heading=state.heading,
        wind_rate_north=share * state.wind_rate_north,
        wind_rate_east=share * state.wind_rate_east,
    )
    return heading_hold(state, airspeed_rate, heading_rate, airframe, hold=hold)


def cruise_setpoint(
    state: VehicleState[Number],
    airspeed: Number,
    course_rate: Number,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint[Number]:
    """Setpoint that turns the course at a rate (rad/s) and keeps an airspeed (m/s).

    Args:
        state: navigated state of the vehicle.
        airspeed: to be kept.
        course_rate: wanted dchi/dt.
        airframe: what the autopilot holds, how it responds, what the vehicle can do.
        wind_feedforward: whether the wind's rate of change is taken off.
        hold: how long the setpoint stands, s.
    """
    if airframe.hold == "course-hold":
        wind = (state.wind_north, state.wind_east)
        wanted = ground_speed_on_course(airspeed, state.course, *wind)
        acceleration = acceleration_toward(wanted, state.ground_speed, airframe.beta, hold)
        return setpoint_for(
            state, acceleration, course_rate, airframe, wind_feedforward=False, hold=hold
        )
    share = 1.0 if wind_feedforward else 0.0
    heading_rate = heading_rate_at_constant_airspeed(
        course_rate,
        ground_speed=state.ground_speed,
        course=state.course,
        airspeed=state.airspeed,
        heading=state.heading,
        wind_rate_north=share * state.wind_rate_north,
        wind_rate_east=share * state.wind_rate_east,
    )
    # The airspeed setpoint is the airspeed itself: this hold needs no lead.
    airspeed_rate = acceleration_toward(airspeed, state.airspeed, airframe.beta, hold)
    return heading_hold(state, airspeed_rate, heading_rate, airframe, hold=hold)


def heading_hold(
    state: VehicleState[Number],
    airspeed_rate: Number,
    heading_rate: Number,
    airframe: Airframe,
    *,
    hold: float = 0.0,
) -> Setpoint[Number]:
    """Setpoint for heading and airspeed holds that stands for `hold` seconds.

    The course is commanded, and the autopilot flies it as a heading through the drift it measures: a
    course setpoint (heading rate)/alpha ahead of the course turns the heading at that rate.
    """
    turn_limit = bank_limited_turn_rate(airframe.max_bank, state.airspeed)
    turn = clip(heading_rate, -turn_limit, turn_limit)
    rate = clip(airspeed_rate, -airframe.max_acceleration, airframe.max_acceleration)
    wanted = speed_command(state.airspeed, rate, airframe.beta, hold)
    airspeed = clip(wanted, *speed_range(state, airframe))
    return Setpoint(
        course=course_command(state.course, turn, airframe.alpha, hold),
        speed=airspeed,
        limited=(turn != heading_rate) | (rate != airspeed_rate) | (airspeed != wanted),
    )


def _course_hold(
    state: VehicleState[Number],
    acceleration: Number,
    course_rate: Number,
    airframe: Airframe,
    hold: float,
) -> Setpoint[Number]:
    """Setpoint for course and ground-speed holds: the article's equations."""
    turn_limit = bank_limited_turn_rate(
        airframe.max_bank, greater_of(state.ground_speed, LEAST_GROUND_SPEED)
    )
    turn = clip(course_rate, -turn_limit, turn_limit)
    rate = clip(acceleration, -airframe.max_acceleration, airframe.max_acceleration)
    wanted = speed_command(state.ground_speed, rate, airframe.beta, hold)
    speed = clip(wanted, *speed_range(state, airframe))
    return Setpoint(
        course=course_command(state.course, turn, airframe.alpha, hold),
        speed=speed,
        limited=(turn != course_rate) | (rate != acceleration) | (speed != wanted),
    )
