"""What one emulated aircraft starts with."""

import math
from dataclasses import dataclass
from typing import Literal

from sitl_stub.aircraft import PlantParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class AutopilotConfig:
    """One emulated aircraft at the start of its flight: airborne, in a loiter."""

    system_id: int
    """MAVLink system id, 1 to 255."""

    autopilot: Literal["ardupilot", "px4"] = "ardupilot"
    """Whose manners it has."""

    plant: PlantParameters
    """How it flies."""

    latitude_deg: float
    """Start position; home is on the ground below it."""

    longitude_deg: float
    """Start position."""

    altitude_amsl_m: float
    """Start altitude."""

    home_altitude_amsl_m: float
    """Altitude of the ground at home."""

    course_rad: float
    """Start course over ground."""

    airspeed_m_s: float
    """Start airspeed; also what it flies whenever no speed is commanded."""

    position_noise_m: float = 0.0
    """Standard deviation, per horizontal axis, of white noise on reported positions."""

    seed: int = 0
    """Of that noise; the system id is mixed in, so that one seed serves a formation."""

    armed: bool = True
    """Whether it reports to be armed. It flies either way."""

    boot_time_s: float = 0.0
    """time_boot_ms at simulation time zero, in seconds."""

    def __post_init__(self) -> None:
        """Refuse a start that cannot be flown.

        Raises:
            ValueError: a field is out of its range; the message names it.
        """
        for name in (
            "latitude_deg",
            "longitude_deg",
            "altitude_amsl_m",
            "home_altitude_amsl_m",
            "course_rad",
        ):
            if not math.isfinite(getattr(self, name)):
                raise ValueError(f"{name} must be finite")
        if not 1 <= self.system_id <= 255:
            raise ValueError(f"system_id must be 1 to 255, not {self.system_id!r}")
        if self.autopilot not in {"ardupilot", "px4"}:
            raise ValueError(f"autopilot must be ardupilot or px4, not {self.autopilot!r}")
        if abs(self.latitude_deg) > 89.0:
            raise ValueError("latitude_deg must be within 89 degrees: poles are not flown")
        plant = self.plant
        if not plant.airspeed_min_m_s <= self.airspeed_m_s <= plant.airspeed_max_m_s:
            raise ValueError(f"airspeed_m_s {self.airspeed_m_s!r} is outside the plant's range")
        for name in ("position_noise_m", "boot_time_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} must be finite and not negative")
