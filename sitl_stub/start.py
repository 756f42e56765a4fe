"""How a flight begins."""

import math

from sitl_stub.air import Air, Place, Wind
from sitl_stub.air_data import AirData
from sitl_stub.config import AutopilotConfig
from sitl_stub.flight import Flight
from sitl_stub.geometry import Home, ground_speed_along_m_s, wrap_to_two_pi
from sitl_stub.personality import Personality
from sitl_stub.plant_state import PlantState
from sitl_stub.sensor_errors import SensorErrors

MISSION_MODES = frozenset({"AUTO", "AUTO.MISSION"})
"""In which the two autopilots fly a mission."""


def flight_at_start(config: AutopilotConfig, air: Wind | Air, personality: Personality) -> Flight:
    """The configured flight, with the distances that the autopilot's parameters give it."""
    air = air if isinstance(air, Air) else Air(air)
    errors = SensorErrors(config.sensors, seed=config.seed, system_id=config.system_id)
    # An autopilot flies by its sensor: what that shows wrongly is flown.
    calibration = config.airspeed_calibration * errors.calibration
    air_data = AirData(config.indicated_airspeed, calibration)
    airspeed_m_s = config.airspeed_m_s / air_data.shown_per_true(config.altitude_amsl_m)
    if config.airborne:
        state = state_in_the_air(config, airspeed_m_s, air_at_start(config, air).at(0.0))
    else:
        state = state_on_the_ground(config)
    flight = Flight(
        plant=config.plant,
        air=air,
        state=state,
        home=Home(
            math.radians(config.latitude_deg),
            math.radians(config.longitude_deg),
            config.home_altitude_amsl_m,
        ),
        cruise_airspeed_m_s=config.airspeed_m_s,
        mode=personality.initial_mode if config.airborne else personality.ground_mode,
        armed=config.armed,
        on_ground=not config.airborne,
        air_data=air_data,
    )
    personality.begin(flight)
    if config.route is not None:
        flight.enter(next(mode for mode in personality.modes if mode.name in MISSION_MODES))
        flight.follow(config.route)
    return flight


def air_at_start(config: AutopilotConfig, air: Air) -> Wind:
    """The air about the start."""
    return air.near(
        Place(
            math.radians(config.latitude_deg),
            math.radians(config.longitude_deg),
            config.altitude_amsl_m,
            config.altitude_amsl_m - config.home_altitude_amsl_m,
        )
    )


def state_in_the_air(
    config: AutopilotConfig, airspeed_m_s: float, wind_m_s: tuple[float, float]
) -> PlantState:
    """The plant's state that has the configured course over ground and airspeed in this wind."""
    course_rad = wrap_to_two_pi(config.course_rad)
    if config.plant.kind == "course-hold":
        direction_rad = course_rad
    else:
        ground_speed_m_s = ground_speed_along_m_s(course_rad, airspeed_m_s, *wind_m_s)
        direction_rad = wrap_to_two_pi(
            math.atan2(
                ground_speed_m_s * math.sin(course_rad) - wind_m_s[1],
                ground_speed_m_s * math.cos(course_rad) - wind_m_s[0],
            )
        )
    return PlantState(
        direction_rad,
        airspeed_m_s,
        "airspeed",
        math.radians(config.latitude_deg),
        math.radians(config.longitude_deg),
        config.altitude_amsl_m,
    )


def state_on_the_ground(config: AutopilotConfig) -> PlantState:
    """Standing at home, the nose in the direction of the runway."""
    return PlantState(
        wrap_to_two_pi(config.course_rad),
        0.0,
        "airspeed",
        math.radians(config.latitude_deg),
        math.radians(config.longitude_deg),
        config.home_altitude_amsl_m,
    )
