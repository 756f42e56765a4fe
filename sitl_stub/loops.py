"""Aircraft limits, loop targets and inner loops.

The height loop is of second order, the others of first order.
"""

import math
from typing import Literal, get_args

import msgspec
from msgspec.structs import replace

from sitl_stub.geometry import wrap_to_pi

SpeedResponse = Literal["first-order", "tecs", "px4", "px4-untrimmed"]

TECS_DEAD_TIME_S = 0.5
"""Time from a new airspeed command to the first change of speed, as measured on ArduPlane."""

MAX_DEAD_TIME_S = 10.0
"""Limit of a dead time: longer than any autopilot's."""


class PlantParameters(msgspec.Struct, frozen=True, kw_only=True):
    """Limits and inner loops of one aircraft."""

    kind: str = "heading-hold"
    """Name of the plant: see `plant`."""

    options: tuple[tuple[str, float], ...] = ()
    """Parameters of a user's plant, by name."""

    alpha_1_s: float = 1.2
    """Gain of the course or heading hold: 1 / time constant."""

    beta_1_s: float = 0.8
    """Gain of the speed hold: 1 / time constant."""

    airspeed_min_m_s: float = 12.0
    """Slowest airspeed flown or accepted as a command."""

    airspeed_max_m_s: float = 32.0
    """Fastest airspeed flown or accepted as a command."""

    max_bank_rad: float = math.pi / 4
    """Bank angle that limits the turn rate to g tan(bank) / V."""

    max_acceleration_m_s2: float = 3.0
    climb_rate_max_m_s: float = 3.0
    sink_rate_max_m_s: float = 3.0
    """Above zero."""

    height_delay_s: float = 2.0
    """Lag of the height behind a target that climbs steadily."""

    guided_p_cdeg_rad: float = 12_000.0
    """`bank` and `six-dof`: bank (0.01 deg) per course error (rad), ArduPlane's GUIDED_P."""

    roll_time_s: float = 0.4
    """`bank` and `npfg` only: time constant of the roll."""

    roll_delay_s: float = 0.0
    """`bank` and `npfg` only: time constant of the wanted bank on its way to the roll. Unlike
    `course_dead_time_s` it adds no lag to a steady turn."""

    turn_efficiency: float = 1.0
    """`bank` only: ratio of the turn rate to the coordinated turn's; 0.7 measured on ArduPlane."""

    speed_response: SpeedResponse = "first-order"
    """`tecs`: ArduPlane's airspeed hold, which overshoots and settles slowly. `px4`: PX4's with a trimmed
    throttle; its setpoint slews and the speed swings. `px4-untrimmed`: PX4's with its default parameters."""

    course_dead_time_s: float = 0.0
    """Dead time of a new course, heading or bank."""

    speed_dead_time_s: float | None = None
    """Dead time of a new speed; None for the speed response's own."""

    @property
    def speed_delay_s(self) -> float:
        """Dead time of the speed loop."""
        if self.speed_dead_time_s is not None:
            return self.speed_dead_time_s
        return TECS_DEAD_TIME_S if self.speed_response == "tecs" else 0.0

    @property
    def rolls(self) -> bool:
        """Whether the bank has a state of its own."""
        return self.kind in {"bank", "npfg"}

    @property
    def slews(self) -> bool:
        """Whether the airspeed setpoint follows commands with PX4's slew rate."""
        return self.speed_response in {"px4", "px4-untrimmed"}

    @property
    def is_trimmed(self) -> bool:
        """Whether the throttle of each airspeed is known, as in all speed holds but `px4-untrimmed`."""
        return self.speed_response != "px4-untrimmed"

    @property
    def banks(self) -> bool:
        """Whether the bank is proportional to the course error, as in ArduPlane."""
        return self.kind in {"bank", "six-dof"}

    @property
    def lags(self) -> bool:
        """Whether roll or speed have a state of their own: see `lagging_plant`."""
        return self.rolls or self.speed_response != "first-order"

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            ValueError: a parameter is out of its range; the message names it.
        """
        self._check_models()
        for name in (
            "alpha_1_s",
            "beta_1_s",
            "airspeed_min_m_s",
            "airspeed_max_m_s",
            "max_acceleration_m_s2",
            "climb_rate_max_m_s",
            "sink_rate_max_m_s",
            "height_delay_s",
            "guided_p_cdeg_rad",
            "roll_time_s",
            "turn_efficiency",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be finite and above zero, not {value!r}")
        for name, delay_s in (
            ("course_dead_time_s", self.course_dead_time_s),
            ("speed_dead_time_s", self.speed_delay_s),
            ("roll_delay_s", self.roll_delay_s),
        ):
            if not 0.0 <= delay_s <= MAX_DEAD_TIME_S:
                raise ValueError(f"{name} must be 0 to {MAX_DEAD_TIME_S:g}, not {delay_s!r}")
        if self.airspeed_max_m_s < self.airspeed_min_m_s:
            raise ValueError("airspeed_max_m_s must not be below airspeed_min_m_s")
        if not 0.0 < self.max_bank_rad < math.pi / 2:
            raise ValueError(f"max_bank_rad must be in (0, pi/2), not {self.max_bank_rad!r}")

    def _check_models(self) -> None:
        if self.speed_response not in get_args(SpeedResponse):
            wanted = ", ".join(get_args(SpeedResponse))
            raise ValueError(f"speed_response must be one of {wanted}, not {self.speed_response!r}")
        if self.kind == "course-hold" and self.lags:
            held = self.speed_response
            raise ValueError(f"speed_response {held} holds an airspeed: it needs another plant")
        if self.kind == "six-dof" and self.speed_response != "first-order":
            raise ValueError("six-dof has a speed hold of its own: leave speed_response out")


SpeedKind = Literal["airspeed", "ground-speed"]


class TurnTarget(msgspec.Struct, frozen=True):
    """Target of the lateral loop."""

    hold: Literal["course", "heading", "bank"]
    """Course over ground, heading of the nose, or a constant bank (positive right)."""

    angle_rad: float
    max_acceleration_m_s2: float = math.inf
    """Limit of a course's or heading's lateral acceleration, beside the bank limit."""


class SpeedTarget(msgspec.Struct, frozen=True):
    """Target of the speed loop; `ground-speed` needs the course-hold plant."""

    kind: SpeedKind
    speed_m_s: float
    max_acceleration_m_s2: float = math.inf
    """Limit of the rate of change, beside the plant's own limit."""


class AltitudeTarget(msgspec.Struct, frozen=True):
    """Target of the height loop."""

    altitude_amsl_m: float
    max_climb_rate_m_s: float = math.inf
    """Limit of climb and descent, beside the plant's own limits."""


class Targets(msgspec.Struct, frozen=True):
    """Targets of the inner loops at one moment."""

    turn: TurnTarget
    speed: SpeedTarget
    height: AltitudeTarget


def in_true_height(targets: Targets, drift_m: float) -> Targets:
    """Shift the target altitude for an autopilot whose altitude reads `drift_m` too high."""
    if drift_m == 0.0:
        return targets
    true_m = targets.height.altitude_amsl_m - drift_m
    return replace(targets, height=replace(targets.height, altitude_amsl_m=true_m))


GRAVITY_M_S2 = 9.80665

CENTIDEGREE_RAD = math.radians(0.01)

HEIGHT_DAMPING = math.sqrt(0.5)
"""Damping ratio of the height hold: it overshoots by 4 % of a step."""


def clamped(value: float, limit: float) -> float:
    """Clamp a value to [-limit, limit]."""
    return limit if value > limit else max(value, -limit)


def bank_limited_turn_rate_rad_s(bank_rad: float, speed_m_s: float) -> float:
    """Return a coordinated turn's turn rate: g tan(bank) / V (Beard & McLain, Small Unmanned Aircraft)."""
    return GRAVITY_M_S2 * math.tan(bank_rad) / speed_m_s


def bank_of_rad(turn_rate_rad_s: float, speed_m_s: float) -> float:
    """Return the bank of a coordinated turn: atan(V omega / g)."""
    return math.atan(speed_m_s * turn_rate_rad_s / GRAVITY_M_S2)


def turn_rate_rad_s(
    parameters: PlantParameters,
    target: TurnTarget,
    *,
    course_rad: float,
    heading_rad: float,
    speed_m_s: float,
) -> float:
    """Return the lateral loop's omega = sat(alpha wrap(target - present)), article, model equations.

    The limit is the smaller of the bank limit and the command's lateral acceleration limit.
    `speed_m_s` is the speed of the velocity that turns.
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
    """Return the bank that the lateral loop asks for, positive right.

    `bank`, ArduPlane's guided course: phi = sat(GUIDED_P wrap(target - present)). `npfg`, PX4's:
    phi = sat(atan(alpha V sin(target - present) / g)), with the error clamped to 90 degrees.

    The limit is the smaller of the bank limit and atan(a / g), a the command's lateral acceleration limit.
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
    """Return the speed loop's dV/dt = sat(beta (target - V)), article, model equations."""
    limit = min(parameters.max_acceleration_m_s2, target.max_acceleration_m_s2)
    return clamped(parameters.beta_1_s * (target.speed_m_s - speed_m_s), limit)


def wanted_climb_m_s(
    parameters: PlantParameters, target: AltitudeTarget, altitude_amsl_m: float
) -> float:
    """Return the climb rate for a height error, positive up: sat((target - h) / delay)."""
    climb = min(parameters.climb_rate_max_m_s, target.max_climb_rate_m_s)
    sink = min(parameters.sink_rate_max_m_s, target.max_climb_rate_m_s)
    wanted = (target.altitude_amsl_m - altitude_amsl_m) / parameters.height_delay_s
    return climb if wanted > climb else max(wanted, -sink)


def climb_acceleration_m_s2(
    parameters: PlantParameters, target: AltitudeTarget, altitude_amsl_m: float, climb_m_s: float
) -> float:
    """Return the height loop's d2h/dt2 = 2 D w (wanted climb - dh/dt), positive up.

    Within the limits this is w² (target - h) - 2 D w dh/dt. The lag behind a target that climbs steadily
    is 2 D / w. It equals the plant's height delay and so determines w.
    """
    frequency_rad_s = 2.0 * HEIGHT_DAMPING / parameters.height_delay_s
    wanted_m_s = wanted_climb_m_s(parameters, target, altitude_amsl_m)
    return 2.0 * HEIGHT_DAMPING * frequency_rad_s * (wanted_m_s - climb_m_s)
