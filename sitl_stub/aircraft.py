"""The aircraft flown: its limits and the gains of its inner loops."""

import math
from typing import Literal, get_args

import msgspec

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
    """Numbers of a model of one's own, by name."""

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
