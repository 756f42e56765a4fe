"""The sliding-mode speed law of a follower."""

from vfguide.elementwise import Number, clip
from vfguide.guidance.limits import saturation

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
