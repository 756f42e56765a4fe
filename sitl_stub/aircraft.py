"""The aircraft flown: its limits and the gains of its inner loops."""

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True, kw_only=True)
class PlantParameters:
    """One aircraft with its inner loops."""

    kind: Literal["course-hold", "heading-hold"] = "heading-hold"
    """Which model flies: see the module."""

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
    """Limit of climb and of descent."""

    altitude_gain_1_s: float = 0.5
    """Height hold: climb rate asked for per metre of height error."""

    def __post_init__(self) -> None:
        """Refuse an aircraft that cannot fly.

        Raises:
            ValueError: a parameter is out of its range; the message names it.
        """
        if self.kind not in {"course-hold", "heading-hold"}:
            raise ValueError(f"kind must be course-hold or heading-hold, not {self.kind!r}")
        for name in (
            "alpha_1_s",
            "beta_1_s",
            "airspeed_min_m_s",
            "airspeed_max_m_s",
            "max_acceleration_m_s2",
            "climb_rate_max_m_s",
            "altitude_gain_1_s",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"{name} must be finite and above zero, not {value!r}")
        if self.airspeed_max_m_s < self.airspeed_min_m_s:
            raise ValueError("airspeed_max_m_s must not be below airspeed_min_m_s")
        if not 0.0 < self.max_bank_rad < math.pi / 2:
            raise ValueError(f"max_bank_rad must be in (0, pi/2), not {self.max_bank_rad!r}")
