"""How hard the laws may pull on an autopilot that answers late.

Each loop around another has to be slower than the one inside. The autopilot's dead time and lag are predicted
away, but no prediction is perfect: the sliding laws are slowed with the delay, and the fields with them.

The setpoint V + (dV/dt)/beta of a law slower than the hold itself has the measured speed in it, and a hold that is
not quite of first order (ArduPlane's answers at once by pitch, and seconds later by throttle) rings on it. The
speed law is then made just so fast that the measured speed drops out: what is sent is where the field wants to be.
"""

import math
from dataclasses import replace

from vfguide.guidance.settings import LEAST_PERIOD, GuidanceSettings

DELAY_SHARE = 0.2
"""Of a delay that is predicted, what the sliding laws still count as one."""

SLOPE_SHARE = 2.0 / math.pi
"""Slope of the arc-tangent field at its middle, in parts of its gain and greatest value."""

NESTING = 2.0
"""How many times slower than the law inside it a field is."""


def paced(
    settings: GuidanceSettings, delay: float, *, period: float, speed: float
) -> GuidanceSettings:
    """Settings for an autopilot that answers after a delay (s); the same ones where there is none.

    Args:
        settings: the mission's.
        delay: dead time and lag together.
        period: of the loop, s.
        speed: about which the vehicle flies, m/s.
    """
    if delay <= 0.0:
        return settings
    sliding = replace(
        settings.sliding, loop_delay_s=settings.sliding.loop_delay_s + DELAY_SHARE * delay
    )
    field = settings.field
    fastest = sliding.kappa / sliding.layer(period) / NESTING
    share = SLOPE_SHARE
    return replace(
        settings,
        sliding=sliding,
        field=replace(
            field,
            k_x=min(field.k_x, fastest / (share * field.v_inf)),
            k_y=min(field.k_y, fastest / (share * field.chi_inf * speed)),
        ),
    )


def without_own_speed(
    settings: GuidanceSettings, beta: float, *, period: float
) -> GuidanceSettings:
    """Settings whose speed law is not slower than the hold that it drives; the same ones where it is not anyway.

    With the gains g of the speed law and k of its field, V + (dV/dt)/beta has 1 - (g + k)/beta of the measured
    speed in it; g = beta - k leaves nothing.

    Args:
        settings: those of a vehicle that answers late.
        beta: response of its speed hold, 1/s.
        period: of the loop, s.
    """
    sliding, field = settings.sliding, settings.field
    wanted = beta - SLOPE_SHARE * field.v_inf * field.k_x
    factor = sliding.boundary_layer_factor
    if wanted <= sliding.kappa / sliding.layer(period):
        return settings
    delay = 1.0 / (factor * wanted) - max(period, LEAST_PERIOD)
    return replace(
        settings,
        answers_course_error=False,
        sliding=replace(sliding, loop_delay_s=max(delay, 0.0)),
    )
