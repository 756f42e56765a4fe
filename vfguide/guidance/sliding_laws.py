"""The sliding-mode laws of course and speed, and the setpoints that fly what they ask, within limits.

The boundary layer of the course law follows the loop that it runs in.
"""

from vfguide.elementwise import clip
from vfguide.guidance.airframe import GREATEST_LEAD, bank_limited_turn_rate, saturation, speed_range
from vfguide.guidance.wind_triangle import (
    air_relative_rates,
    ground_speed_on_course,
    heading_rate_at_constant_airspeed,
)
from vfguide.state import Airframe, Setpoint, VehicleState


def boundary_layer(
    gain: float, least: float, *, period: float, delay: float, factor: float
) -> float:
    """Boundary layer epsilon of the sampled law: max(epsilon, factor kappa (dt + delay)).

    The article's kappa = 3, epsilon = 0.01 is a continuous-time law. Sampled every dt it limit-cycles
    as soon as kappa dt / epsilon > 2; a factor of 2 is the least that keeps clear of that with a margin,
    and a greater one buys a smoother setpoint with a little accuracy.

    Args:
        gain: kappa, in the law's unit per second.
        least: the article's epsilon, in the law's unit.
        period: the loop's period dt, s.
        delay: from measurement to effect, s.
        factor: without dimension.
    """
    return max(least, factor * gain * (period + delay))


def sliding_course_rate(
    course_error: float, desired_rate: float, gain: float, layer: float
) -> float:
    """Course rate (rad/s) that brings the course onto the field: d chi^d/dt - kappa sat(chi~ / epsilon).

    Args:
        course_error: chi~ = wrap(chi - chi^d), rad.
        desired_rate: d chi^d/dt, rad/s.
        gain: kappa, rad/s.
        layer: epsilon, rad.
    """
    return desired_rate - gain * saturation(course_error / layer)


def course_command(course: float, course_rate: float, alpha: float, hold: float = 0.0) -> float:
    """chi^c = chi + (d chi/dt) (1 / alpha + T / 2), rad: what a first-order hold turns into the wanted rate.

    With `sliding_course_rate` and T = 0 this is the article's chi^c. A setpoint that stands for T seconds
    while the course turns toward it loses half of that turn on average: T / 2 makes it good. Not wrapped.

    Args:
        course: chi, rad.
        course_rate: d chi/dt, rad/s.
        alpha: response, 1/s.
        hold: T, s.
    """
    lead = course_rate * (1.0 / alpha + 0.5 * hold)
    return course + clip(lead, -GREATEST_LEAD, GREATEST_LEAD)


POSITION_SHARE = 1.0 / 3.0
"""Share of kappa that x_E / rho may have. Beyond kappa it would outweigh the sliding term, and a follower
100 m behind would ask for a speed without end."""


def sliding_acceleration(
    speed_error: float,
    along_track_error: float,
    desired_acceleration: float,
    *,
    gain: float,
    layer: float,
    rho: float,
) -> float:
    """Acceleration (m/s²) that brings the speed onto the field: dV^d/dt + x_E/rho - kappa sat(V~/epsilon).

    Args:
        speed_error: V~ = V_f - V^d, m/s.
        along_track_error: x_E, m, positive where the slot is ahead.
        desired_acceleration: dV^d/dt, m/s².
        gain: kappa, m/s².
        layer: epsilon, m/s.
        rho: weight of the Lyapunov function, s².
    """
    bound = POSITION_SHARE * gain
    position_term = clip(along_track_error / rho, -bound, bound)
    return desired_acceleration + position_term - gain * saturation(speed_error / layer)


def speed_command(speed: float, acceleration: float, beta: float, hold: float = 0.0) -> float:
    """V^c = V + (dV/dt) (1 / beta + T / 2), m/s: what a first-order hold turns into the wanted acceleration.

    T is how long the setpoint stands, s; see `course_command`.
    """
    return speed + acceleration * (1.0 / beta + 0.5 * hold)


def acceleration_toward(command: float, speed: float, beta: float, hold: float = 0.0) -> float:
    """Acceleration (m/s²) for which `speed_command` gives this command (m/s)."""
    return (command - speed) / (1.0 / beta + 0.5 * hold)


LEAST_GROUND_SPEED = 1.0
"""m/s: an aircraft that stands still turns at no rate that can be worked out."""


def foretold_share(state: VehicleState, *, wind_feedforward: bool) -> float:
    """Share of the wind's rate that is fed forward: none of it in gusts, whose rate foretells nothing."""
    return 1.0 - state.gust_share if wind_feedforward else 0.0


def setpoint_for(
    state: VehicleState,
    acceleration: float,
    course_rate: float,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint:
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
    share = foretold_share(state, wind_feedforward=wind_feedforward)
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
    state: VehicleState,
    airspeed: float,
    course_rate: float,
    airframe: Airframe,
    *,
    wind_feedforward: bool,
    hold: float = 0.0,
) -> Setpoint:
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
    share = foretold_share(state, wind_feedforward=wind_feedforward)
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
    state: VehicleState,
    airspeed_rate: float,
    heading_rate: float,
    airframe: Airframe,
    *,
    hold: float = 0.0,
) -> Setpoint:
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
        turn_limited=turn != heading_rate,
        speed_limited=rate != airspeed_rate or airspeed != wanted,
    )


def _course_hold(
    state: VehicleState,
    acceleration: float,
    course_rate: float,
    airframe: Airframe,
    hold: float,
) -> Setpoint:
    """Setpoint for course and ground-speed holds: the article's equations."""
    turn_limit = bank_limited_turn_rate(
        airframe.max_bank, max(state.ground_speed, LEAST_GROUND_SPEED)
    )
    turn = clip(course_rate, -turn_limit, turn_limit)
    rate = clip(acceleration, -airframe.max_acceleration, airframe.max_acceleration)
    wanted = speed_command(state.ground_speed, rate, airframe.beta, hold)
    speed = clip(wanted, *speed_range(state, airframe))
    return Setpoint(
        course=course_command(state.course, turn, airframe.alpha, hold),
        speed=speed,
        turn_limited=turn != course_rate,
        speed_limited=rate != acceleration or speed != wanted,
    )
