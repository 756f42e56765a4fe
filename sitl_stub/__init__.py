"""An autopilot emulator that speaks MAVLink: bytes in, bytes out, no hardware."""

from sitl_stub.air import (
    Air,
    ArticleWind,
    CalmWind,
    DiscreteGust,
    Shear,
    SteadyWind,
    TurbulenceField,
    Wind,
    air_of,
    low_altitude_intensity,
)
from sitl_stub.arduplane import EmulatedArduPlane
from sitl_stub.autopilot import Autopilot, Truth
from sitl_stub.codec import Signing
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import AutopilotMode
from sitl_stub.lagging_plant import FirstOrder, Lagging
from sitl_stub.links import BadLink
from sitl_stub.loops import PlantParameters
from sitl_stub.personality import Personality, autopilots, personality
from sitl_stub.plant import AirPlant, AirRates, AirState, Plant, options_of, plant, plant_of, plants
from sitl_stub.px4 import EmulatedPx4
from sitl_stub.registry import load_plugins
from sitl_stub.route import Route
from sitl_stub.sensor_errors import Fault
from sitl_stub.settings import Settings
from sitl_stub.six_dof import SixDof

__version__ = "1.0.0"
"""Version of the emulator and of vfguide."""

__all__ = [
    "Air",
    "AirPlant",
    "AirRates",
    "AirState",
    "ArticleWind",
    "Autopilot",
    "AutopilotConfig",
    "AutopilotMode",
    "BadLink",
    "CalmWind",
    "DiscreteGust",
    "EmulatedArduPlane",
    "EmulatedPx4",
    "Fault",
    "FirstOrder",
    "Lagging",
    "Personality",
    "Plant",
    "PlantParameters",
    "Route",
    "Settings",
    "Shear",
    "Signing",
    "SixDof",
    "SteadyWind",
    "Truth",
    "TurbulenceField",
    "Wind",
    "air_of",
    "autopilots",
    "load_plugins",
    "low_altitude_intensity",
    "options_of",
    "personality",
    "plant",
    "plant_of",
    "plants",
]
