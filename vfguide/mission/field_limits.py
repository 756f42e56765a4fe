"""Before take-off: do the loops around a slot follow each other, each slower than the one inside it?"""

import math
from collections.abc import Iterator

from vfguide.guidance.formation import field_slope
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.loop_limits import effective_layer
from vfguide.mission.model import Mission

LEAST_DAMPING = 0.5
"""Of the integral's loop; less, and a follower swings through its slot."""


def field_pulls(mission: Mission, speed: float) -> tuple[float, float]:
    """(along, across) how fast the field draws onto the slot, 1/s, at a speed over ground (m/s)."""
    controller = mission.controller
    across = field_slope(controller.k_y, math.radians(controller.chi_inf_deg)) * speed
    return field_slope(controller.k_x, controller.v_inf_m_s), across


def law_pull(mission: Mission) -> float:
    """How fast the laws answer an error of course or speed: kappa / epsilon, 1/s."""
    controller = mission.controller
    return controller.kappa / effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)


def integral_damping(slope: float, integral_s: float) -> float:
    """Damping sqrt(s T) / 2 of a field with this slope (1/s) that learns in this time (s)."""
    return math.sqrt(slope * integral_s) / 2.0


def fields_beyond_the_loop(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Followers' fields that pull faster than the laws beneath them follow: the two then swing."""
    if not mission.followers:
        return
    controller = mission.controller
    followed = law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    along, across = field_pulls(mission, speed)
    for name, gain, pull in (("k_y", controller.k_y, across), ("k_x", controller.k_x, along)):
        if pull <= followed:
            continue
        message = (
            f"near its slot the field pulls at {pull:.1f} 1/s, "
            f"faster than the {followed:.1f} 1/s at which the law follows: the formation swings"
        )
        most = math.floor(1000.0 * gain * followed / pull) / 1000.0
        yield Finding(
            "warning", ("controller", name), message, f"lower {name} to {most:g} 1/m or less"
        )


def integral_too_fast(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """An integral that learns faster than the field beneath it moves: the follower swings, or worse.

    With the law's answer g the loop is e'''/g + e'' + s e' + (s/T) e = 0, stable where T > 1/g (Routh).
    """
    controller = mission.controller
    if not mission.followers or controller.type != "slot" or controller.integral_s == 0.0:
        return
    location = ("controller", "integral_s")
    shortest = 1.0 / law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).min())
    slope = min(field_pulls(mission, speed))
    usual = math.ceil(10.0 * (2.0 * LEAST_DAMPING) ** 2 / slope) / 10.0
    remedy = f"set it to {max(usual, math.ceil(10.0 * shortest) / 10.0):g} s or more, or to 0"
    if controller.integral_s <= shortest:
        message = (
            f"the field learns in {controller.integral_s:g} s, and the law beneath it answers in "
            f"{shortest:.2f} s: followers swing ever wider"
        )
        yield Finding("error", location, message, remedy)
    elif (damping := integral_damping(slope, controller.integral_s)) < LEAST_DAMPING:
        message = (
            f"the field learns in {controller.integral_s:g} s and draws onto the slot at "
            f"{slope:.1f} 1/s: a damping of {damping:.2f}, followers swing through their slots"
        )
        yield Finding("warning", location, message, remedy)
