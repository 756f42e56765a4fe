"""How hard the laws may pull on an autopilot that answers late.

Each loop around another has to be slower than the one inside. The autopilot's dead time and lag are predicted
away, but no prediction is perfect: the sliding laws are slowed with the delay, and the fields with them.

The setpoint V + (dV/dt)/beta of a law slower than the hold itself has the measured speed in it, and a hold
that is not of first order (ArduPlane's answers at once by pitch, seconds later by throttle) rings on it.
For a vehicle that slips the speed law is made just so fast that the measured speed drops out.
"""

from dataclasses import replace

from vfguide.guidance.formation import FieldGains, field_slope
from vfguide.guidance.settings import LEAST_PERIOD, GuidanceSettings

DELAY_SHARE = 0.2
"""Of a delay that is predicted, what the sliding laws still count as one."""

NESTING = 2.0
"""How many times slower than the law inside it a field is."""

GREATEST_GAIN = 0.45
"""1/s: of the course law of a vehicle that slips. On ArduPilot's simulated plane 0.7 and 0.25 of its field
kept the yaw swinging at 0.9 Hz for ever."""


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
    return replace(
        settings,
        sliding=sliding,
        field=with_gains(
            field,
            k_x=min(field.k_x, fastest / field_slope(1.0, field.v_inf)),
            k_y=min(field.k_y, fastest / (field_slope(1.0, field.chi_inf) * speed)),
        ),
    )


def with_gains(field: FieldGains, *, k_x: float, k_y: float) -> FieldGains:
    """A slower field (gains in 1/m), its integral as much slower as the axis that was slowed most.

    The integral's damping is sqrt(s T) / 2, with the field's slope s in proportion to its gain.
    """
    slower = max(field.k_x / k_x, field.k_y / k_y)
    return replace(field, k_x=k_x, k_y=k_y, integral_s=field.integral_s * slower)


def without_swing(
    settings: GuidanceSettings, delay: float, *, period: float, speed: float
) -> GuidanceSettings:
    """`paced` settings for the course of a vehicle that slips, no faster than its yaw bears; see there."""
    sliding = settings.sliding
    if sliding.boundary_layer_factor <= 0.0:
        return paced(settings, delay, period=period, speed=speed)
    missing = loop_delay_for(GREATEST_GAIN, settings, period) - sliding.loop_delay_s
    return paced(settings, max(delay, missing / DELAY_SHARE), period=period, speed=speed)


def without_own_speed(
    settings: GuidanceSettings, delay: float, beta: float, *, period: float, speed: float
) -> GuidanceSettings:
    """`paced` settings for the speed of a vehicle that slips: nothing of the measured one is in the setpoint.

    With the gains g of the speed law and k of its field, 1 - (g + k)/beta of the measured speed is in
    V + (dV/dt)/beta; g = beta - k leaves nothing, and k is at most half of g. What the course swings about
    the field is then no reason either to change the airspeed.

    Args:
        settings: the mission's.
        delay: dead time and lag together, s.
        beta: response of the speed hold, 1/s.
        period: of the loop, s.
        speed: about which the vehicle flies, m/s.
    """
    slow = paced(settings, delay, period=period, speed=speed)
    field = settings.field
    if settings.sliding.boundary_layer_factor <= 0.0:
        return slow
    slope = field_slope(1.0, field.v_inf)
    k_x = min(field.k_x, beta / (1.0 + NESTING) / slope)
    loop_delay_s = max(loop_delay_for(beta - slope * k_x, settings, period), 0.0)
    return replace(
        slow,
        answers_course_error=False,
        sliding=replace(slow.sliding, loop_delay_s=loop_delay_s),
        field=with_gains(slow.field, k_x=k_x, k_y=slow.field.k_y),
    )


def loop_delay_for(gain: float, settings: GuidanceSettings, period: float) -> float:
    """Loop delay (s) with which the sliding laws answer with this gain (1/s)."""
    return 1.0 / (settings.sliding.boundary_layer_factor * gain) - max(period, LEAST_PERIOD)
