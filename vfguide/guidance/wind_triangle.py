"""The wind triangle: ground velocity = air velocity + wind, and the accelerations that go with it.

Beard and McLain, Small Unmanned Aircraft: Theory and Practice, chapter 2; article, model equations.
"""

from vfguide.elementwise import Number, cos, greater_of, hypot, sin, square_root


def resolve(north: Number, east: Number, direction: Number) -> tuple[Number, Number]:
    """Components of a horizontal vector (along, right of) a direction in radians."""
    ahead, aside = cos(direction), sin(direction)
    return north * ahead + east * aside, east * ahead - north * aside


def compose(along: Number, right: Number, direction: Number) -> tuple[Number, Number]:
    """(north, east) of a vector given by its components along and right of a direction."""
    ahead, aside = cos(direction), sin(direction)
    return along * ahead - right * aside, along * aside + right * ahead


def polar(length: Number, direction: Number) -> tuple[Number, Number]:
    """(north, east) of a vector given by its length and direction."""
    return length * cos(direction), length * sin(direction)


def ground_speed_on_course(
    airspeed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Ground speed (m/s) at which an aircraft flies a course with a given airspeed.

    V_g = W_along + sqrt(V_a^2 - W_across^2). A wind across the course that is faster than the aircraft
    leaves no heading that holds the course: the root is then taken as 0, so that the value stays finite.
    """
    tail, cross = resolve(wind_north, wind_east, course)
    return tail + square_root(greater_of(airspeed * airspeed - cross * cross, 0.0))


def airspeed_for_ground_velocity(
    ground_speed: Number, course: Number, wind_north: Number, wind_east: Number
) -> Number:
    """Airspeed (m/s) that gives a ground speed on a course: |v_g - w|."""
    tail, cross = resolve(wind_north, wind_east, course)
    return hypot(ground_speed - tail, cross)


def air_relative_rates(
    acceleration: Number,
    course_rate: Number,
    *,
    ground_speed: Number,
    course: Number,
    airspeed: Number,
    heading: Number,
    wind_rate_north: Number,
    wind_rate_east: Number,
) -> tuple[Number, Number]:
    """What airspeed and heading have to do for a wanted change of the ground velocity.

    The wanted ground acceleration is (dV_g/dt, V_g dchi/dt) along and right of the course. What the
    wind does by itself is taken off; the rest is resolved along and right of the heading, where it is
    (dV_a/dt, V_a dpsi/dt).

    Args:
        acceleration: wanted dV_g/dt, m/s².
        course_rate: wanted dchi/dt, rad/s.
        ground_speed: V_g, m/s.
        course: chi, rad.
        airspeed: V_a, m/s, positive.
        heading: psi, rad.
        wind_rate_north: rate of change of the wind's north component, m/s².
        wind_rate_east: rate of change of the wind's east component, m/s².

    Returns:
        (airspeed rate in m/s², heading rate in rad/s).
    """
    north, east = compose(acceleration, ground_speed * course_rate, course)
    along, right = resolve(north - wind_rate_north, east - wind_rate_east, heading)
    return along, right / airspeed


def heading_rate_at_constant_airspeed(
    course_rate: Number,
    *,
    ground_speed: Number,
    course: Number,
    airspeed: Number,
    heading: Number,
    wind_rate_north: Number,
    wind_rate_east: Number,
) -> Number:
    """Heading rate (rad/s) that turns the course at a wanted rate while the airspeed stays as it is.

    Right of the course, V_g dchi/dt = V_a dpsi/dt cos(psi - chi) + dW/dt; arguments as in
    `air_relative_rates`. A drift of more than 70 degrees is treated as one of 70: nearer to abeam, no
    heading rate turns the course.
    """
    _, wind_right = resolve(wind_rate_north, wind_rate_east, course)
    leverage = greater_of(cos(heading - course), 0.34)
    return (ground_speed * course_rate - wind_right) / (airspeed * leverage)
