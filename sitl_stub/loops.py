"""The inner loops: towards their target, within the aircraft's limits.

Height is held by a loop of second order, all else by one of first.
"""

import math
from typing import Literal

import msgspec
from msgspec.structs import replace

from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import wrap_to_pi

SpeedKind = Literal["airspeed", "ground-speed"]


class TurnTarget(msgspec.Struct, frozen=True):
    """What the lateral loop holds."""

    hold: Literal["course", "heading", "bank"]
    """Course over ground, heading of the nose, or a constant bank (positive right)."""

    angle_rad: float
    """The course, heading or bank held."""

    max_acceleration_m_s2: float = math.inf
    """Lateral acceleration limit of a course or heading; the bank limit holds as well."""


class SpeedTarget(msgspec.Struct, frozen=True):
    """What the speed loop holds. `ground-speed` needs the course-hold plant."""

    kind: SpeedKind
    """Which speed."""

    speed_m_s: float
    """The speed itself, m/s."""

    max_acceleration_m_s2: float = math.inf
    """Limit of its change; the plant's own limit holds as well."""


class AltitudeTarget(msgspec.Struct, frozen=True):
    """What the height loop holds."""

    altitude_amsl_m: float
    """Altitude above mean sea level."""

    max_climb_rate_m_s: float = math.inf
    """Limit of climb and descent; the plant's own limit holds as well."""


class Targets(msgspec.Struct, frozen=True):
    """What the inner loops hold at one moment."""

    turn: TurnTarget
    """Lateral."""

    speed: SpeedTarget
    """Longitudinal."""

    height: AltitudeTarget
    """Vertical."""


def in_true_height(targets: Targets, drift_m: float) -> Targets:
    """What a plant holds for a loop whose altitude shows so much too much."""
    if drift_m == 0.0:
        return targets
    true_m = targets.height.altitude_amsl_m - drift_m
    return replace(targets, height=replace(targets.height, altitude_amsl_m=true_m))


GRAVITY_M_S2 = 9.80665
"""Standard gravity."""

CENTIDEGREE_RAD = math.radians(0.01)

HEIGHT_DAMPING = math.sqrt(0.5)
"""Damping of the height hold: it passes its target by 4 % of a step."""


def clamped(value: float, limit: float) -> float:
    """`value` kept within [-limit, limit]."""
    return limit if value > limit else max(value, -limit)


def bank_limited_turn_rate_rad_s(bank_rad: float, speed_m_s: float) -> float:
    """Turn rate of a coordinated turn: g tan(bank) / V (Beard & McLain, Small Unmanned Aircraft)."""
    return GRAVITY_M_S2 * math.tan(bank_rad) / speed_m_s


def bank_of_rad(turn_rate_rad_s: float, speed_m_s: float) -> float:
    """Bank of the coordinated turn with this turn rate: atan(V omega / g)."""
    return math.atan(speed_m_s * turn_rate_rad_s / GRAVITY_M_S2)


def turn_rate_rad_s(
    parameters: PlantParameters,
    target: TurnTarget,
    *,
    course_rad: float,
    heading_rad: float,
    speed_m_s: float,
) -> float:
    """Lateral loop: omega = sat(alpha wrap(target - present)), article, model equations.

    Saturated by the bank limit and by the lateral acceleration that came with the command, whichever
    is smaller. `speed_m_s` is the speed of the velocity that turns.
    """
    if target.hold == "bank":
        return bank_limited_turn_rate_rad_s(target.angle_rad, speed_m_s)
    present_rad = course_rad if target.hold == "course" else heading_rad
    limit = min(
        bank_limited_turn_rate_rad_s(parameters.max_bank_rad, speed_m_s),
        target.max_acceleration_m_s2 / speed_m_s,
    )
    return clamped(parameters.alpha_1_s * wrap_to_pi(target.angle_rad - present_rad), limit)


def wanted_bank_rad(
    parameters: PlantParameters,
    target: TurnTarget,
    *,
    course_rad: float,
    heading_rad: float,
    airspeed_m_s: float,
) -> float:
    """The bank that is asked for, positive right.

    `bank`, ArduPlane's guided course: phi = sat(GUIDED_P wrap(target - present)). `npfg`, PX4's:
    phi = sat(atan(alpha V sin(target - present) / g)), and beyond 90 degrees as at 90.

    Saturated by the bank limit and by atan(a / g) of the lateral acceleration a that came with the
    command, whichever is smaller.
    """
    if target.hold == "bank":
        return clamped(target.angle_rad, parameters.max_bank_rad)
    error_rad = wrap_to_pi(
        target.angle_rad - (course_rad if target.hold == "course" else heading_rad)
    )
    limit = min(parameters.max_bank_rad, math.atan(target.max_acceleration_m_s2 / GRAVITY_M_S2))
    if parameters.kind == "npfg":
        sine = math.sin(clamped(error_rad, 0.5 * math.pi))
        return clamped(math.atan(parameters.alpha_1_s * airspeed_m_s * sine / GRAVITY_M_S2), limit)
    return clamped(parameters.guided_p_cdeg_rad * CENTIDEGREE_RAD * error_rad, limit)


def acceleration_m_s2(parameters: PlantParameters, target: SpeedTarget, speed_m_s: float) -> float:
    """Speed loop: dV/dt = sat(beta (target - V)), article, model equations."""
    limit = min(parameters.max_acceleration_m_s2, target.max_acceleration_m_s2)
    return clamped(parameters.beta_1_s * (target.speed_m_s - speed_m_s), limit)


def wanted_climb_m_s(
    parameters: PlantParameters, target: AltitudeTarget, altitude_amsl_m: float
) -> float:
    """Climb rate that a height error asks for, positive up: sat((target - h) / delay)."""
    climb = min(parameters.climb_rate_max_m_s, target.max_climb_rate_m_s)
    sink = min(parameters.sink_rate_max_m_s, target.max_climb_rate_m_s)
    wanted = (target.altitude_amsl_m - altitude_amsl_m) / parameters.height_delay_s
    return climb if wanted > climb else max(wanted, -sink)


def climb_acceleration_m_s2(
    parameters: PlantParameters, target: AltitudeTarget, altitude_amsl_m: float, climb_m_s: float
) -> float:
    """Height loop of second order: d2h/dt2 = 2 D w (wanted climb - dh/dt), positive up.

    Within the limits that is w² (target - h) - 2 D w dh/dt. A target that climbs steadily is followed
    2 D / w later: that is the plant's height delay, by which w is found.
    """
    frequency_rad_s = 2.0 * HEIGHT_DAMPING / parameters.height_delay_s
    wanted_m_s = wanted_climb_m_s(parameters, target, altitude_amsl_m)
    return 2.0 * HEIGHT_DAMPING * frequency_rad_s * (wanted_m_s - climb_m_s)
