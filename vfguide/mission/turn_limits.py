"""Before take-off: does anything have to turn faster than its bank limit allows?

Nelson et al., Vector field path following for miniature air vehicles, IEEE T-RO 2007, for the field.
"""

import math
from collections.abc import Iterator

import numpy as np

from vfguide.guidance.airframe import GRAVITY, bank_limited_turn_rate
from vfguide.guidance.formation import Slot
from vfguide.mission.conditions import Conditions
from vfguide.mission.finding import Finding
from vfguide.mission.flight_path import Location
from vfguide.mission.model import Mission

FIELD_TURN_CONSTANT = 2.0 / (3.0 * math.sqrt(3.0))
"""0.385: greatest value of sin(atan u) / (1 + u^2) = u (1 + u^2)^(-3/2), reached at u = k e = 1/sqrt 2."""


def field_turn_rate(gain: float, ground_speed: float, approach: float) -> float:
    """Greatest turn rate (rad/s) of the field around a straight path: 0.385 k V_g (2/pi) chi_inf.

    On the field the course is chi_inf (2/pi) atan(k e) off the path, the error shrinks at V_g times the sine
    of that, and the field's course changes by chi_inf (2/pi) k / (1 + (k e)^2) for each metre. Exact for
    chi_inf = pi/2 and an upper bound below.

    Args:
        gain: k, 1/m.
        ground_speed: V_g, m/s.
        approach: chi_inf, rad, at most pi/2.
    """
    return FIELD_TURN_CONSTANT * gain * ground_speed * (2.0 / math.pi) * approach


def bank_for(ground_speed: float, turn_rate: float) -> float:
    """Bank (rad) of a turn: atan(V omega / g), with V in m/s and omega in rad/s."""
    return math.atan(ground_speed * abs(turn_rate) / GRAVITY)


def turns_beyond_bank(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """Arcs of the path that the leader or a slot's vehicle cannot fly."""
    airspeed = mission.leader.airspeed_m_s
    turn_rate = conditions.turn_rate(airspeed)
    for location, name, slot in _everyone(mission):
        speed = np.hypot(*conditions.slot_velocity(airspeed, slot))
        worst = int(np.argmax(speed * np.abs(turn_rate)))
        bank = math.degrees(bank_for(float(speed[worst]), float(turn_rate[worst])))
        allowed = mission.vehicles[name].max_bank_deg
        if bank > allowed:
            message = (
                f"'{name}' has to bank {bank:.0f}° on the turn at up to {speed[worst]:.1f} m/s "
                f"over ground, its limit is {allowed:g}°"
            )
            remedy = (
                "widen the path's turns, fly slower, or move the slot to the inside of the turn"
            )
            yield Finding("error", location, message, remedy)


def _everyone(mission: Mission) -> Iterator[tuple[Location, str, Slot[float]]]:
    """(where the mission places it, vehicle, offset from the leader) of the leader and each follower."""
    yield ("path",), mission.leader.vehicle, Slot(forward=0.0, right=0.0)
    for index, follower in enumerate(mission.followers):
        slot = Slot(forward=follower.slot.forward_m, right=follower.slot.right_m)
        yield ("followers", index, "slot"), follower.vehicle, slot


def field_beyond_bank(mission: Mission, conditions: Conditions) -> Iterator[Finding]:
    """A path field that turns faster than the leader can while it joins the path."""
    path = mission.path
    speed = float(conditions.ground_speed(mission.leader.airspeed_m_s).max())
    curvature = float(np.abs(conditions.curvature).max())
    max_bank = math.radians(mission.leader_vehicle.max_bank_deg)
    allowed = bank_limited_turn_rate(max_bank, speed)
    field = field_turn_rate(path.gain, speed, path.approach_angle)
    needed = field + speed * curvature
    if needed <= allowed:
        return
    message = (
        f"joining the path, the field turns at up to {needed:.2f} rad/s at {speed:.1f} m/s over ground, "
        f"a bank of {mission.leader_vehicle.max_bank_deg:g}° gives {allowed:.2f}: "
        "the leader cannot keep to it there"
    )
    room = allowed - speed * curvature
    if room > 0.0:
        remedy = (
            f"lower gain to {math.floor(1000.0 * path.gain * room / field) / 1000.0:g} 1/m or less"
        )
    else:
        remedy = "widen the path's turns or fly slower"
    yield Finding("warning", ("path", "gain"), message, remedy)
