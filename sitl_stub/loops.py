"""The aircraft flown: its limits, and its inner loops, towards their target within those limits.

Height is held by a loop of second order, all else by one of first.
"""

import math
from typing import Literal, get_args

import msgspec
from msgspec.structs import replace

from sitl_stub.geometry import wrap_to_pi

SpeedResponse = Literal["first-order", "tecs", "px4", "px4-untrimmed"]

TECS_DEAD_TIME_S = 0.5
"""From a new airspeed to the first change of speed, as measured on ArduPlane."""

MAX_DEAD_TIME_S = 10.0
"""Longer than any autopilot's: what is asked for beyond it is a mistake."""


class PlantParameters(msgspec.Struct, frozen=True, kw_only=True):
    """One aircraft with its inner loops."""

    kind: str = "heading-hold"
    """Which model flies: see `plant`."""

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
    """Limit of the rate of change of speed, both ways."""

    climb_rate_max_m_s: float = 3.0
    """Limit of climb."""

    sink_rate_max_m_s: float = 3.0
    """Limit of descent, above zero."""

    height_delay_s: float = 2.0
    """Height hold: by how much the height lags behind a target that climbs steadily."""

    guided_p_cdeg_rad: float = 12_000.0
    """`bank` and `six-dof`: bank (0.01 deg) per course error (rad), ArduPlane's GUIDED_P."""

    roll_time_s: float = 0.4
    """`bank` and `npfg` only: time constant with which the roll follows."""

    roll_delay_s: float = 0.0
    """`bank` and `npfg` only: time constant with which the bank that is wanted reaches the roll. Unlike
    `course_dead_time_s` it puts a steady turn no further behind."""

    turn_efficiency: float = 1.0
    """`bank` only: turn rate in parts of the coordinated turn's; 0.7 measured on ArduPlane."""

    speed_response: SpeedResponse = "first-order"
    """`tecs`: an airspeed hold like ArduPlane's, which overshoots and settles slowly. `px4`: PX4's with a
    throttle that is trimmed, whose setpoint slews, and which swings; `px4-untrimmed`: as it comes."""

    course_dead_time_s: float = 0.0
    """From a new course, heading or bank to the moment at which the loop knows it."""

    speed_dead_time_s: float | None = None
    """From a new speed to the moment at which the loop knows it, s; None: that of the speed response."""

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
        """Whether an airspeed that is commanded is gone to with PX4's slew."""
        return self.speed_response in {"px4", "px4-untrimmed"}

    @property
    def is_trimmed(self) -> bool:
        """Whether the throttle of each airspeed is known, as of every hold but one."""
        return self.speed_response != "px4-untrimmed"

    @property
    def banks(self) -> bool:
        """Whether the bank is in proportion to the course error, as ArduPlane's."""
        return self.kind in {"bank", "six-dof"}

    @property
    def lags(self) -> bool:
        """Whether roll or speed have a state of their own: see `lagging_plant`."""
        return self.rolls or self.speed_response != "first-order"

    def __post_init__(self) -> None:
        """Refuse an aircraft that cannot fly.

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
