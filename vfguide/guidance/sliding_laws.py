"""The sliding-mode course law, with a boundary layer that follows the loop it runs in.

The sliding-mode speed law of a follower.
"""

from vfguide.elementwise import Number, clip
from vfguide.guidance.limits import saturation


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
    course_error: Number, desired_rate: Number, gain: float, layer: float
) -> Number:
    """Course rate (rad/s) that brings the course onto the field: d chi^d/dt - kappa sat(chi~ / epsilon).

    Args:
        course_error: chi~ = wrap(chi - chi^d), rad.
        desired_rate: d chi^d/dt, rad/s.
        gain: kappa, rad/s.
        layer: epsilon, rad.
    """
    return desired_rate - gain * saturation(course_error / layer)


def course_command(course: Number, course_rate: Number, alpha: float, hold: float = 0.0) -> Number:
    """chi^c = chi + (d chi/dt) (1 / alpha + T / 2), rad: what a first-order hold turns into the wanted rate.

    With `sliding_course_rate` and T = 0 this is the article's chi^c. A setpoint that stands for T seconds
    while the course turns toward it loses half of that turn on average: T / 2 makes it good. Not wrapped.

    Args:
        course: chi, rad.
        course_rate: d chi/dt, rad/s.
        alpha: response, 1/s.
        hold: T, s.
    """
    return course + course_rate * (1.0 / alpha + 0.5 * hold)


POSITION_SHARE = 1.0 / 3.0
"""Share of kappa that x_E / rho may have. Beyond kappa it would outweigh the sliding term, and a follower
100 m behind would ask for a speed without end."""


def sliding_acceleration(
    speed_error: Number,
    along_track_error: Number,
    desired_acceleration: Number,
    *,
    gain: float,
    layer: float,
    rho: float,
) -> Number:
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


def speed_command(speed: Number, acceleration: Number, beta: float, hold: float = 0.0) -> Number:
    """V^c = V + (dV/dt) (1 / beta + T / 2), m/s: what a first-order hold turns into the wanted acceleration.

    T is how long the setpoint stands, s; see `course_command`.
    """
    return speed + acceleration * (1.0 / beta + 0.5 * hold)


def acceleration_toward(command: Number, speed: Number, beta: float, hold: float = 0.0) -> Number:
    """Acceleration (m/s²) for which `speed_command` gives this command (m/s)."""
    return (command - speed) / (1.0 / beta + 0.5 * hold)
