"""What all messages of one instant are made from, and the units that MAVLink counts in."""

import math
from typing import NamedTuple

from sitl_stub.flight import Flight
from sitl_stub.motion import Motion
from sitl_stub.personality import Personality


class Report(NamedTuple):
    """What all messages of one instant are made from, so that they agree."""

    time_boot_ms: int
    """Time stamp."""

    flight: Flight
    """State, mode and home."""

    motion: Motion
    """Motion as measured."""

    latitude_rad: float
    """As measured: with noise, if there is any."""

    longitude_rad: float
    """As measured."""

    personality: Personality
    """Which autopilot speaks."""

    altitude_error_m: float = 0.0
    """Of the barometer."""

    ready: bool = True
    """Whether its sensors have settled."""

    icao_address: int = 0
    """Of its transponder."""

    @property
    def altitude_amsl_m(self) -> float:
        """As measured."""
        return self.flight.state.altitude_amsl_m + self.altitude_error_m


def centidegrees(angle_rad: float) -> int:
    """An angle in hundredths of a degree, [0, 36000)."""
    return round(math.degrees(angle_rad) * 100.0) % 36_000


def centimetres_per_second(speed_m_s: float) -> int:
    """A speed in cm/s, kept within the field's 16 bits."""
    return max(-32_767, min(32_767, round(speed_m_s * 100.0)))


def degrees_e7(angle_rad: float) -> int:
    """A latitude or longitude in 1e-7 degrees (11 mm)."""
    return round(math.degrees(angle_rad) * 1e7)


def millimetres(length_m: float) -> int:
    """A height in mm, kept within the field's 32 bits."""
    return max(-(2**31), min(2**31 - 1, round(length_m * 1000.0)))
