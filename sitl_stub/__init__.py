"""An autopilot emulator that speaks MAVLink: bytes in, bytes out, no hardware."""

from sitl_stub.aircraft import PlantParameters
from sitl_stub.autopilot import Autopilot
from sitl_stub.bad_link import BadLink
from sitl_stub.config import AutopilotConfig, GpsGlitch
from sitl_stub.signing import Signing
from sitl_stub.truth import Truth
from sitl_stub.wind import ArticleWind, CalmWind, SteadyWind, Wind

__all__ = [
    "ArticleWind",
    "Autopilot",
    "AutopilotConfig",
    "BadLink",
    "CalmWind",
    "GpsGlitch",
    "PlantParameters",
    "Signing",
    "SteadyWind",
    "Truth",
    "Wind",
]
