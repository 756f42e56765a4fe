"""Indicated and true airspeed: what a pitot tube shows at height is less than what is flown."""

import math
from dataclasses import dataclass

SEA_LEVEL_TEMPERATURE_K = 288.15
LAPSE_K_M = 0.0065
DENSITY_EXPONENT = 4.2559
"""The standard atmosphere's: g M / (R L) - 1."""


def density_ratio(altitude_amsl_m: float) -> float:
    """Air density in parts of the sea level's: (1 - L h / T_0)^4.2559, ICAO standard atmosphere."""
    share = 1.0 - LAPSE_K_M * altitude_amsl_m / SEA_LEVEL_TEMPERATURE_K
    # The formula's own end; nothing that flies here gets near it.
    return math.pow(max(share, 0.1), DENSITY_EXPONENT)


@dataclass(frozen=True, slots=True)
class AirData:
    """From the airspeed that is flown to the one that is shown, limited and commanded."""

    indicated: bool = False
    """Whether indicated airspeed is shown: true airspeed times the root of the density ratio."""

    calibration: float = 1.0
    """What the sensor shows in parts of what it should; an uncalibrated one is some percent off."""

    def shown_per_true(self, altitude_amsl_m: float) -> float:
        """Shown airspeed in parts of the true one at this altitude."""
        density = math.sqrt(density_ratio(altitude_amsl_m)) if self.indicated else 1.0
        return self.calibration * density
