"""Before take-off: do the loops around a slot follow each other, each slower than the one inside it?

What `vfguide check` says of the field's gains. Nelson et al., Vector field path following for miniature air
vehicles, IEEE T-RO 2007, for how fast a field turns.
"""

import math
from collections.abc import Iterator

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.guidance.airframe import bank_limited_turn_rate
from vfguide.guidance.formation import Slot, field_slope
from vfguide.guidance.slot_integral import learning_growth
from vfguide.laws.field import FieldGains, SlotGains
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.loop_limits import effective_layer
from vfguide.mission.model import Mission


def error_for_correction(correction: FloatArray, greatest: float, gain: float) -> FloatArray:
    """Error (m) at which the dual field gives a correction: tan(pi c / (2 c_inf)) / k; infinite beyond c_inf.

    Inverse of the article's c_inf (2/pi) atan(k e).

    Args:
        correction: c, rad of course or m/s of speed.
        greatest: c_inf, the field's correction far away, in the same unit.
        gain: k, 1/m.
    """
    share = np.abs(correction) / greatest
    inside = np.minimum(share, 1.0 - 1e-9)
    return np.where(share < 1.0, np.tan(math.pi / 2.0 * inside) / gain, np.inf)


def turns_beyond_field(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """The article's field on turns on which its correction falls short of the slots' own motion.

    A rigid slot moves with (V_l - omega g_y, omega g_x), the field aims at (V_l, 0): the difference in
    course and speed has to come from an error that never goes away.
    """
    if isinstance(gains, SlotGains):
        return
    airspeed = mission.leader.airspeed_m_s
    turning = conditions.curvature != 0.0
    for follower in mission.followers:
        slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
        along, right = conditions.slot_velocity(airspeed, slot)
        extra_speed = np.hypot(along, right) - conditions.ground_speed(airspeed)
        lateral = error_for_correction(np.arctan2(right, along), gains.chi_inf, gains.k_y)
        ahead = error_for_correction(extra_speed, gains.v_inf_m_s, gains.k_x)
        if np.isinf(np.hypot(lateral, ahead)[turning]).any():
            message = "on the turn the field cannot correct as much as the slots' own motion takes"
            remedy = "use controller type slot, which steers around the slots' own motion"
            yield Finding("warning", ("controller",), message, remedy)
            return


LEAST_DAMPING = 0.5
"""Damping of the integral's loop; with less a follower swings through its slot."""


def field_findings(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Everything that is known about a field's gains on a mission; after an error nothing else matters."""
    for check in (
        field_beyond_bank,
        fields_beyond_the_loop,
        integral_too_fast,
        turns_beyond_field,
    ):
        found = list(check(mission, conditions, gains))
        yield from found
        if any(one.severity == "error" for one in found):
            return


def field_pulls(gains: FieldGains, speed: float) -> tuple[float, float]:
    """(along, across) how fast the field draws onto the slot, 1/s, at a speed over ground (m/s)."""
    across = field_slope(gains.k_y, gains.chi_inf) * speed
    return field_slope(gains.k_x, gains.v_inf_m_s), across


def told_apart(first: float, second: float) -> tuple[str, str]:
    """Two numbers with as many digits, one after the point at least, as it takes to tell them apart."""
    for digits in range(1, 4):
        texts = f"{first:.{digits}f}", f"{second:.{digits}f}"
        if texts[0] != texts[1]:
            break
    return texts


def law_pull(mission: Mission) -> float:
    """How fast the laws answer an error of course or speed: kappa / epsilon, 1/s."""
    controller = mission.controller
    return controller.kappa / effective_layer(controller, 1.0 / mission.rehearsal.rate_hz)


def integral_damping(slope: float, integral_s: float) -> float:
    """Damping sqrt(s T) / 2 of a field with this slope (1/s) that learns in this time (s)."""
    return math.sqrt(slope * integral_s) / 2.0


def fields_beyond_the_loop(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """Followers' fields that pull faster than the laws beneath them follow: the two then swing."""
    followed = law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    along, across = field_pulls(gains, speed)
    for name, gain, pull in (("k_y", gains.k_y, across), ("k_x", gains.k_x, along)):
        if pull <= followed:
            continue
        pulls, follows = told_apart(pull, followed)
        message = (
            f"near its slot the field pulls at {pulls} 1/s, "
            f"faster than the {follows} 1/s at which the law follows: the formation swings"
        )
        most = math.floor(1000.0 * gain * followed / pull) / 1000.0
        yield Finding(
            "warning", ("controller", name), message, f"lower {name} to {most:g} 1/m or less"
        )


def integral_too_fast(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """An integral that learns faster than the field beneath it moves: the follower swings, or worse.

    With the law's answer g the loop is e'''/g + e'' + s e' + (s/T) e = 0, stable where T > 1/g (Routh); in a
    turn, where harmonics are learned beside the mean, T counts as so much shorter.
    """
    if not isinstance(gains, SlotGains) or not gains.integral_s:
        return
    location = ("controller", "integral_s")
    turn_rate = float(abs(conditions.turn_rate(mission.leader.airspeed_m_s)).max())
    shortest = learning_growth(turn_rate, gains.integral_s) / law_pull(mission)
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).min())
    slope = min(field_pulls(gains, speed))
    usual = math.ceil(10.0 * (2.0 * LEAST_DAMPING) ** 2 / slope) / 10.0
    remedy = f"set it to {max(usual, math.ceil(10.0 * shortest) / 10.0):g} s or more, or to 0"
    if gains.integral_s <= shortest:
        message = (
            f"the field learns in {gains.integral_s:g} s, which the law beneath it follows from "
            f"{shortest:.2f} s on: followers swing ever wider"
        )
        yield Finding("error", location, message, remedy)
    elif (damping := integral_damping(slope, gains.integral_s)) < LEAST_DAMPING:
        message = (
            f"the field learns in {gains.integral_s:g} s and draws onto the slot at "
            f"{slope:.1f} 1/s: a damping of {damping:.2f}, followers swing through their slots"
        )
        yield Finding("warning", location, message, remedy)


def course_field_turn_rate(gain: float, ground_speed: float, greatest: float) -> float:
    """Greatest turn rate (rad/s) of a course field: max of c (2/pi) k V sin(c (2/pi) atan u) / (1 + u^2).

    Unlike `turn_limits.field_turn_rate` also exact for corrections c far below a quarter turn, by looking
    for the greatest value over u = k e.

    Args:
        gain: k, 1/m.
        ground_speed: V, m/s.
        greatest: c, rad.
    """
    share = greatest * (2.0 / math.pi)
    scaled = np.linspace(0.0, 3.0, 301)
    shape = np.sin(share * np.arctan(scaled)) / (1.0 + scaled * scaled)
    return share * gain * ground_speed * float(shape.max())


def field_beyond_bank(
    mission: Mission, conditions: Conditions, gains: FieldGains
) -> Iterator[Finding]:
    """A followers' course field that turns faster than one of them can, on its slot's speed and turn.

    It is the same field as the one around a path, with k_y and the followers' chi_inf. Worth a note only:
    its setpoint is limited while it joins, and near the slot the field asks for less.
    """
    airspeed = mission.leader.airspeed_m_s
    turn = float(np.abs(conditions.turn_rate(airspeed)).max())
    for follower in mission.followers:
        name, offset = follower.vehicle, follower.slot
        slot = Slot(forward=offset.forward_m, right=offset.right_m)
        speed = float(np.hypot(*conditions.slot_velocity(airspeed, slot)).max())
        allowed = bank_limited_turn_rate(math.radians(mission.vehicles[name].max_bank_deg), speed)
        needed = turn + course_field_turn_rate(gains.k_y, speed, gains.chi_inf)
        if needed > allowed:
            message = (
                f"joining its slot, '{name}' is asked to turn at up to {needed:.2f} rad/s at "
                f"{speed:.1f} m/s over ground; its bank gives {allowed:.2f}, so it joins less sharply"
            )
            yield Finding("note", ("controller", "k_y"), message)
            return
