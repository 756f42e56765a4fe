"""From standing on the ground into the air, and the distances that flight modes keep."""

import math
from typing import Literal

import msgspec
from msgspec.structs import replace

from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.plant import Motion, PlantState

ROLL_ACCELERATION_M_S2 = 4.0
"""Along the runway."""

LIFT_OFF_MARGIN = 1.1
"""Airspeed of lifting off, in parts of the slowest that is flown."""

REACHED_WITHIN_M = 2.0
"""Below the wanted height by which a climb counts as over, as in ArduPlane."""


def rolling_motion(state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
    """On the ground: along the nose, at the state's speed over ground."""
    north, east = math.cos(state.direction_rad), math.sin(state.direction_rad)
    against_m_s = north * wind_m_s[0] + east * wind_m_s[1]
    return Motion(
        state.speed_m_s * north,
        state.speed_m_s * east,
        0.0,
        state.direction_rad,
        state.speed_m_s,
        state.direction_rad,
        # What blows into the tube from ahead; from behind it shows nothing.
        max(0.0, state.speed_m_s - against_m_s),
        0.0,
        0.0,
    )


Phase = Literal["standing", "rolling", "climbing", "flying"]
"""Standing and rolling are on the ground; climbing is the take-off's part in the air."""


class Navigation(msgspec.Struct, frozen=True, kw_only=True):
    """Distances of the flight modes, which are parameters of the autopilot."""

    take_off_height_m: float = 50.0
    """Above home."""

    take_off_distance_m: float = 200.0
    """From the start of the roll to the loiter after it."""

    loiter_radius_m: float = 80.0
    """Negative is counter-clockwise."""

    return_height_m: float = 100.0
    """Above home, on the way back to it; negative keeps the present one."""


def rolled(state: PlantState, step_s: float) -> PlantState:
    """One step further along the runway."""
    speed_m_s = state.speed_m_s + ROLL_ACCELERATION_M_S2 * step_s
    way_m = 0.5 * (state.speed_m_s + speed_m_s) * step_s
    latitude_rad, longitude_rad = displace(
        state.latitude_rad,
        state.longitude_rad,
        state.altitude_amsl_m,
        north_m=way_m * math.cos(state.direction_rad),
        east_m=way_m * math.sin(state.direction_rad),
    )
    return replace(
        state, speed_m_s=speed_m_s, latitude_rad=latitude_rad, longitude_rad=longitude_rad
    )


def lifts_off(plant: PlantParameters, state: PlantState, wind_m_s: tuple[float, float]) -> bool:
    """Whether the wings carry."""
    wanted_m_s = min(LIFT_OFF_MARGIN * plant.airspeed_min_m_s, plant.airspeed_max_m_s)
    return rolling_motion(state, wind_m_s).airspeed_m_s >= wanted_m_s


def airborne(
    plant: PlantParameters, state: PlantState, wind_m_s: tuple[float, float]
) -> PlantState:
    """A motion as a state of the plant in the air."""
    motion = rolling_motion(state, wind_m_s)
    air_north_m_s, air_east_m_s = motion.north_m_s - wind_m_s[0], motion.east_m_s - wind_m_s[1]
    heading_rad = wrap_to_two_pi(math.atan2(air_east_m_s, air_north_m_s))
    airspeed_m_s = math.hypot(air_north_m_s, air_east_m_s)
    return replace(
        state,
        direction_rad=state.direction_rad if plant.kind == "course-hold" else heading_rad,
        speed_m_s=max(plant.airspeed_min_m_s, min(plant.airspeed_max_m_s, airspeed_m_s)),
        speed_kind="airspeed",
    )
