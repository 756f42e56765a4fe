"""An autopilot emulator that speaks MAVLink: bytes in, bytes out, no hardware."""

from sitl_stub.aircraft import PlantParameters
from sitl_stub.autopilot import Autopilot
from sitl_stub.config import AutopilotConfig
from sitl_stub.truth import Truth
from sitl_stub.wind import ArticleWind, CalmWind, SteadyWind, Wind

__all__ = [
    "ArticleWind",
    "Autopilot",
    "AutopilotConfig",
    "CalmWind",
    "PlantParameters",
    "SteadyWind",
    "Truth",
    "Wind",
]
