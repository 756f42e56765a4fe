"""The ground-speed observer: flying a field without a measured ground speed.

The article's observer, with the regressor phi in the place of its printed "d chi^d/d e . d e/d chi". With
the estimate in the law, W = rho chi~^2 / 2 + V~^2 / (2 Gamma) falls as
dW/dt = -rho kappa chi~ sat(chi~/epsilon) - sigma V~^2.
"""

from dataclasses import dataclass

from vfguide.elementwise import Number


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverGains:
    """Gains of the observer."""

    gamma: float
    """Gamma: adaptation gain."""
    rho: float
    """rho: weight of the course error in the Lyapunov function."""
    sigma: float
    """sigma: pull toward the reference speed; Gamma sigma is its rate, 1/s."""


def speed_estimate_rate(
    estimate: Number,
    reference_speed: Number,
    course_error: Number,
    regressor: Number,
    gains: ObserverGains,
) -> Number:
    """dV^_g/dt = -Gamma rho chi~ phi - sigma Gamma (V^_g - V_ref), m/s².

    Args:
        estimate: V^_g, m/s.
        reference_speed: V_ref, m/s: the measured ground speed while it is fresh, else the airspeed.
        course_error: chi~ = wrap(chi - chi^d), rad.
        regressor: phi, rad/m.
        gains: Gamma, rho, sigma.
    """
    adaptation = gains.rho * course_error * regressor
    return -gains.gamma * (adaptation + gains.sigma * (estimate - reference_speed))
