"""The emulated aircraft of a mission."""

import math

import numpy as np

import sitl_stub
from vfguide.companion.mission_plan import local_frame
from vfguide.errors import InputError
from vfguide.mission.flight_path import path_of
from vfguide.mission.model import Mission
from vfguide.mission.starts import StartState, follower_start, leader_start
from vfguide.registry import load_plugins_of_the_environment

BOOTED_S = 1234.5
"""What its clock shows at the start of a rehearsal: nobody else's shows that."""

DECLARED = (
    "alpha_1_s",
    "beta_1_s",
    "airspeed_range_m_s",
    "max_bank_deg",
    "max_acceleration_m_s2",
    "climb_range_m_s",
    "height_delay_s",
)
"""Fields that are true of an aircraft as its companion is told, where the emulator has none of its own."""

ROUTE_POINTS = 361
"""Points of a mission's path, where an aircraft flies it by itself."""

ROUTE_BEYOND_M = 1000.0
"""A path without end goes on for so much longer than the aircraft can fly."""


def settings_of(mission: Mission, name: str) -> dict[str, object]:
    """What the emulator of a vehicle is started with, as `sitl-stub --config` takes it.

    Lockstep, live flights and containers all make their emulators of this.
    """
    vehicle, rehearsal = mission.vehicles[name], mission.rehearsal
    emulator, start = rehearsal.emulator.of(name), start_of(mission, name)
    latitude, longitude = local_frame(mission).to_geodetic(start.north_m, start.east_m)
    ground = mission.origin.altitude_amsl_m
    altitude = ground + mission.height_above_origin_m + start.up_m
    declared = {field: getattr(vehicle, field) for field in DECLARED}
    lowest, highest = emulator.airspeed_range_m_s or vehicle.airspeed_range_m_s
    settings: dict[str, object] = {
        **declared,
        **emulator.model_dump(mode="json", exclude_none=True),
        "system_id": vehicle.system_id,
        "autopilot": emulator.autopilot or vehicle.emulated_autopilot,
        "plant": emulator.plant or vehicle.plant,
        "wind": mission.wind.model_dump(mode="json"),
        "air_height_m": mission.height_above_origin_m,
        "start": (float(latitude), float(longitude), altitude, start.course_deg),
        "home_altitude_m": ground,
        "airborne": True,
        "climb_m_s": start.climb_m_s,
        "airspeed_m_s": min(max(mission.leader.airspeed_m_s, lowest), highest),
        "sensors": rehearsal.sensors,
        "position_noise_m": rehearsal.position_noise_m,
        "seed": rehearsal.seed,
    }
    if mission.leader.is_foreign and name == mission.leader.vehicle:
        heard = rehearsal.leader_telemetry
        settings |= {
            "route": route_of(mission),
            "streams": [f"{heard.message}:{heard.rate_hz!r}"],
            "delay_s": heard.delay_s,
            "jitter_s": heard.jitter_s,
            "loss": heard.loss,
            "icao_address": mission.leader.icao_address or 0,
            "boot_time_s": BOOTED_S,
        }
    return settings


def checked_settings(mission: Mission, name: str) -> sitl_stub.Settings:
    """The settings of a vehicle's emulator, which can fly by them.

    Raises:
        InputError: it cannot; the message is one line.
    """
    load_plugins_of_the_environment()
    try:
        settings = sitl_stub.Settings.of(settings_of(mission, name))
        sitl_stub.plant_of(settings.config().plant)
    except ValueError as error:
        own = name in mission.rehearsal.emulator.vehicles
        place = f"rehearsal.emulator.vehicles.{name}" if own else "rehearsal.emulator"
        raise InputError(f"{place}: {error}") from error
    return settings


def emulator_of(
    mission: Mission, name: str, faults: tuple[sitl_stub.Fault, ...] = ()
) -> sitl_stub.Autopilot:
    """The aircraft of this name, in the air at its start, and what is wrong with its reports."""
    settings = checked_settings(mission, name)
    return sitl_stub.Autopilot(
        settings.config().model_copy(update={"faults": faults}), settings.air()
    )


def foreign_leader_of(mission: Mission) -> sitl_stub.BadLink:
    """The leader without a companion, as others hear it."""
    leader = mission.leader.vehicle
    return checked_settings(mission, leader).behind_its_link(emulator_of(mission, leader))


def route_of(mission: Mission) -> list[tuple[float, float]]:
    """Points (latitude, longitude; degrees) along a mission's path, for an aircraft without a companion."""
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
    return points


def start_of(mission: Mission, name: str) -> StartState:
    """Where a vehicle begins."""
    if name == mission.leader.vehicle:
        return leader_start(mission)
    return follower_start(mission, name)
