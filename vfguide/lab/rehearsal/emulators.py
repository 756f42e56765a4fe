"""The emulated aircraft of a mission."""

import math
from dataclasses import replace

import numpy as np

import sitl_stub
from vfguide.companion.mission_plan import local_frame
from vfguide.errors import InputError
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Mission
from vfguide.mission.rehearsal import ArticleWind, SteadyWind, Wind
from vfguide.mission.starts import StartState, follower_start, leader_start
from vfguide.registry import load_plugins_of_the_environment

STREAMS = {
    "GLOBAL_POSITION_INT": 33,
    "FOLLOW_TARGET": 144,
    "GLOBAL_POSITION_INT_COV": 63,
    "HIGH_LATENCY2": 235,
    "ADSB_VEHICLE": 246,
}
"""Numbers of the messages that a leader without a companion is heard by."""

BOOTED_S = 1234.5
"""What its clock shows at the start of a rehearsal: nobody else's shows that."""

ROUTE_POINTS = 361
"""Of the path of a mission, where an aircraft flies it by itself."""

ROUTE_BEYOND_M = 1000.0
"""A path without end goes on for so much longer than the aircraft can fly."""


def air_of(mission: Mission) -> sitl_stub.Air:
    """The air that a mission declares."""
    wind = mission.wind
    return sitl_stub.air_of(
        wind_of(wind),
        level=wind.turbulence,
        height_m=mission.height_above_origin_m,
        seed=mission.rehearsal.seed,
        gusts=tuple(
            sitl_stub.DiscreteGust(
                start_s=gust.at_s,
                length_s=gust.for_s,
                north_m_s=gust.north_m_s,
                east_m_s=gust.east_m_s,
            )
            for gust in wind.gusts
        ),
        roughness_m=wind.roughness_m,
    )


def wind_of(wind: Wind) -> sitl_stub.Wind:
    """The mean wind that a mission declares."""
    if isinstance(wind, ArticleWind):
        return sitl_stub.ArticleWind()
    if isinstance(wind, SteadyWind):
        return sitl_stub.SteadyWind(wind.speed_m_s, math.radians(wind.toward_deg))
    return sitl_stub.CalmWind()


def plant_of(mission: Mission, name: str) -> sitl_stub.PlantParameters:
    """What really flies under this name.

    Raises:
        InputError: the plant has no such options, or cannot be as the mission says.
    """
    load_plugins_of_the_environment()
    vehicle, emulator = mission.vehicles[name], mission.rehearsal.emulator
    lowest, highest = vehicle.airspeed_range_m_s
    try:
        parameters = sitl_stub.PlantParameters(
            kind=emulator.plant or vehicle.plant,
            alpha_1_s=vehicle.alpha_1_s,
            beta_1_s=vehicle.beta_1_s,
            airspeed_min_m_s=lowest,
            airspeed_max_m_s=highest,
            max_bank_rad=math.radians(vehicle.max_bank_deg),
            max_acceleration_m_s2=vehicle.max_acceleration_m_s2,
            climb_rate_max_m_s=vehicle.climb_range_m_s[1],
            sink_rate_max_m_s=-vehicle.climb_range_m_s[0],
            height_delay_s=vehicle.height_delay_s,
            guided_p_cdeg_rad=emulator.guided_p,
            roll_time_s=emulator.roll_time_s,
            roll_delay_s=emulator.roll_delay_s,
            turn_efficiency=emulator.turn_efficiency,
            speed_response=emulator.speed_response,
            course_dead_time_s=emulator.course_dead_time_s,
            speed_dead_time_s=emulator.speed_dead_time_s,
            options=sitl_stub.options_of(emulator.plant_options),
        )
        sitl_stub.plant_of(parameters)
    except ValueError as error:
        raise InputError(f"rehearsal.emulator: {error}") from error
    return parameters


def emulator_of(
    mission: Mission, name: str, faults: tuple[sitl_stub.Fault, ...] = ()
) -> sitl_stub.Autopilot:
    """The aircraft of this name, in the air at its start, and what is wrong with its reports."""
    vehicle, heard = mission.vehicles[name], mission.rehearsal.leader_telemetry
    start = start_of(mission, name)
    latitude, longitude = local_frame(mission).to_geodetic(start.north_m, start.east_m)
    ground = mission.origin.altitude_amsl_m
    lowest, highest = vehicle.airspeed_range_m_s
    config = sitl_stub.AutopilotConfig(
        system_id=vehicle.system_id,
        autopilot=mission.rehearsal.emulator.autopilot or vehicle.emulated_autopilot,
        plant=plant_of(mission, name),
        latitude_deg=latitude,
        longitude_deg=longitude,
        altitude_amsl_m=ground + mission.height_above_origin_m + start.up_m,
        home_altitude_amsl_m=ground,
        course_rad=math.radians(start.course_deg),
        airspeed_m_s=min(max(mission.leader.airspeed_m_s, lowest), highest),
        sensors=mission.rehearsal.sensors,
        position_noise_m=mission.rehearsal.position_noise_m,
        indicated_airspeed=mission.rehearsal.emulator.indicated_airspeed,
        airspeed_calibration=mission.rehearsal.emulator.airspeed_calibration,
        loop_rate_hz=mission.rehearsal.emulator.loop_rate_hz,
        seed=mission.rehearsal.seed,
        faults=faults,
    )
    if mission.leader.is_foreign and name == mission.leader.vehicle:
        config = replace(
            config,
            route=route_of(mission),
            streams=((STREAMS[heard.message], round(1e6 / heard.rate_hz)),),
            icao_address=mission.leader.icao_address or 0,
            boot_time_s=BOOTED_S,
        )
    return sitl_stub.Autopilot(config, air_of(mission))


def foreign_leader_of(mission: Mission) -> sitl_stub.BadLink:
    """The leader without a companion, as others hear it."""
    heard = mission.rehearsal.leader_telemetry
    return sitl_stub.BadLink(
        emulator_of(mission, mission.leader.vehicle),
        delay_s=heard.delay_s,
        jitter_s=heard.jitter_s,
        loss=heard.loss,
        seed=mission.rehearsal.seed,
    )


def route_of(mission: Mission) -> sitl_stub.Route:
    """The path of a mission as points for an aircraft that flies them by itself."""
    path = path_of(mission.path)
    if math.isfinite(path.length):
        places = path.at(path.outline(ROUTE_POINTS))
    else:
        reach_m = mission.rehearsal.duration_s * mission.leader_vehicle.airspeed_range_m_s[1]
        places = path.at(np.linspace(0.0, reach_m + ROUTE_BEYOND_M, ROUTE_POINTS))
    frame = local_frame(mission)
    points = [
        frame.to_geodetic(float(north), float(east))
        for north, east in zip(places.north, places.east, strict=True)
    ]
    if math.isfinite(path.length):
        points[-1] = points[0]
    return sitl_stub.Route(tuple(points))


def start_of(mission: Mission, name: str) -> StartState:
    """Where a vehicle begins."""
    if name == mission.leader.vehicle:
        return leader_start(mission)
    return follower_start(mission, name)
