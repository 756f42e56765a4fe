"""How hard the sliding laws may pull on an autopilot that answers late.

Each loop around another has to be slower than the one inside. The autopilot's dead time and lag are predicted
away, but no prediction is perfect: the sliding laws are slowed with the delay, and the fields with them.
"""

from dataclasses import replace

from vfguide.guidance.settings import LEAST_PERIOD, SlidingGains
from vfguide.state import Airframe

DELAY_SHARE = 0.2
"""Of a delay that is predicted, what the sliding laws still count as one."""

GREATEST_GAIN = 0.45
"""1/s: of the course law of a vehicle that slips. On ArduPilot's simulated plane 0.7 and 0.25 of its field
kept the yaw swinging at 0.9 Hz for ever."""


def limit_bandwidth(sliding: SlidingGains, delay: float) -> SlidingGains:
    """Gains for an autopilot that answers after a delay (s); the same ones where there is none."""
    if delay <= 0.0:
        return sliding
    return replace(sliding, loop_delay_s=sliding.loop_delay_s + DELAY_SHARE * delay)


def course_delay(sliding: SlidingGains, airframe: Airframe, *, slips: bool, period: float) -> float:
    """What a course setpoint counts as late, s: dead time and lag; more for a vehicle that slips.

    Args:
        sliding: the mission's gains.
        airframe: of the vehicle.
        slips: whether its nose leaves the direction of flight in turns.
        period: of the loop, s.
    """
    delay = airframe.course_dead_time + airframe.course_lag
    if not slips or sliding.boundary_layer_factor <= 0.0:
        return delay
    missing = loop_delay_for(GREATEST_GAIN, sliding, period) - sliding.loop_delay_s
    return max(delay, missing / DELAY_SHARE)


def speed_delay(airframe: Airframe) -> float:
    """What a speed setpoint counts as late, s: dead time and lag."""
    return airframe.speed_dead_time + airframe.speed_lag


def loop_delay_for(gain: float, sliding: SlidingGains, period: float) -> float:
    """Loop delay (s) with which the sliding laws answer with this gain (1/s)."""
    return 1.0 / (sliding.boundary_layer_factor * gain) - max(period, LEAST_PERIOD)
