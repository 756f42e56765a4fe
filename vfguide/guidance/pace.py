"""How hard the laws may pull on an autopilot that answers late.

Each loop around another has to be slower than the one inside. The autopilot's dead time and lag are predicted
away, but no prediction is perfect: the sliding laws are slowed with the delay, and the fields with them.
"""

import math
from dataclasses import replace

from vfguide.guidance.settings import GuidanceSettings

DELAY_SHARE = 0.2
"""Of a delay that is predicted, what the sliding laws still count as one."""

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
    share = 2.0 / math.pi
    return replace(
        settings,
        sliding=sliding,
        field=replace(
            field,
            k_x=min(field.k_x, fastest / (share * field.v_inf)),
            k_y=min(field.k_y, fastest / (share * field.chi_inf * speed)),
        ),
    )
