"""Flights made up from formulas, close to what a rehearsal records."""

import math
from dataclasses import replace
from typing import Any, Literal, TypeVar

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.record.flight import FlightRecord, RecordAcceptance, VehicleRecord
from vfguide.record.vehicle import SERIES

SLOTS = {"f1": (-20.0, -20.0), "f2": (-20.0, 20.0), "f3": (-40.0, 0.0)}
STARTS = {"f1": (-60.0, -50.0), "f2": (-35.0, 70.0), "f3": (-90.0, 10.0)}
TRACKING = 2

Record = TypeVar("Record", VehicleRecord, FlightRecord)


def replace_some(record: Record, given: dict[str, Any]) -> Record:
    """The same with other values for some fields."""
    return replace(record, **given)


def still_vehicle(
    name: str, role: Literal["leader", "follower"], time_s: FloatArray, **given: object
) -> VehicleRecord:
    """A vehicle at the origin, on course north at 20 m/s, except for what is given."""
    zero = np.zeros_like(time_s)
    unknown = np.full_like(time_s, math.nan)
    vehicle = VehicleRecord(
        name=name,
        role=role,
        system_id=1,
        slot_forward_m=0.0,
        slot_right_m=0.0,
        north_m=zero,
        east_m=zero,
        altitude_amsl_m=zero + 588.0,
        course_rad=zero,
        ground_speed_m_s=zero + 20.0,
        heading_rad=zero,
        airspeed_m_s=zero + 20.0,
        bank_rad=zero,
        wind_north_m_s=zero,
        wind_east_m_s=zero,
        path_cross_track_error_m=zero if role == "leader" else unknown,
        path_course_rad=zero if role == "leader" else unknown,
        course_setpoint_rad=zero,
        airspeed_setpoint_m_s=zero + 20.0,
        ground_speed_setpoint_m_s=unknown,
        mode=np.full(time_s.shape, TRACKING, dtype=np.int64),
        limited=np.zeros(time_s.shape, dtype=np.bool_),
        lyapunov=unknown if role == "leader" else zero,
    )
    return replace_some(vehicle, given)


def still_leader(time_s: FloatArray, **given: object) -> VehicleRecord:
    """A leader at the origin, on course north at 20 m/s, except for what is given."""
    return still_vehicle("leader", "leader", time_s, **given)


def still_follower(time_s: FloatArray, **given: object) -> VehicleRecord:
    """The follower f1 at the origin, on course north at 20 m/s, except for what is given."""
    return still_vehicle("f1", "follower", time_s, **given)


def still_flight(time_s: FloatArray, *vehicles: VehicleRecord, **given: object) -> FlightRecord:
    """A calm flight of the vehicles given, or of a lone leader."""
    flight = FlightRecord(
        time_s=time_s,
        vehicles=vehicles or (still_leader(time_s),),
        mode_names=("waiting", "joining", "tracking"),
        path_north_m=np.array([0.0, 100.0]),
        path_east_m=np.array([0.0, 0.0]),
        mission="line-calm",
        controller="slot",
        plant="heading-hold",
        wind="calm",
        mode="lockstep",
        rate_hz=1.0,
        seed=1,
        duration_s=float(time_s[-1]) if time_s.size else 0.0,
        wall_s=0.5,
        acceptance=RecordAcceptance(mean_error_m=1.0, settle_10m_s=60.0),
    )
    return replace_some(flight, given)


def with_vehicle(record: FlightRecord, name: str, /, **given: object) -> FlightRecord:
    """The same flight with other values for some fields of a vehicle."""
    vehicles = [replace_some(one, given) if one.name == name else one for one in record.vehicles]
    return replace(record, vehicles=tuple(vehicles))


def article_wind(time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(north, east) of 5 + 3 cos(0.1 t) m/s toward 135° + 180° sin(0.1 t)."""
    speed = 5.0 + 3.0 * np.cos(0.1 * time_s)
    toward = math.radians(135.0) + math.pi * np.sin(0.1 * time_s)
    return speed * np.cos(toward), speed * np.sin(toward)


def smooth_noise(time_s: FloatArray, scale: float, phase: float) -> FloatArray:
    """Three sines that never repeat in a flight."""
    waves = [np.sin(rate * time_s + phase * rate) for rate in (0.13, 0.71, 1.9)]
    return scale * np.sum(waves, axis=0)


def moving_vehicle(
    name: str,
    role: Literal["leader", "follower"],
    time_s: FloatArray,
    position: tuple[FloatArray, FloatArray],
    wind: tuple[FloatArray, FloatArray],
    **given: object,
) -> VehicleRecord:
    """A vehicle whose speeds, angles and setpoints follow from its positions and the wind."""
    north, east = position
    velocity_north, velocity_east = np.gradient(north, time_s), np.gradient(east, time_s)
    air_north, air_east = velocity_north - wind[0], velocity_east - wind[1]
    course = np.arctan2(velocity_east, velocity_north)
    turn_rate = np.gradient(np.unwrap(course), time_s)
    airspeed = np.hypot(air_north, air_east)
    setpoint = np.unwrap(course) + turn_rate / 1.2
    return still_vehicle(
        name,
        role,
        time_s,
        north_m=north,
        east_m=east,
        course_rad=course,
        ground_speed_m_s=np.hypot(velocity_north, velocity_east),
        heading_rad=np.arctan2(air_east, air_north),
        airspeed_m_s=airspeed,
        bank_rad=np.arctan(airspeed * turn_rate / 9.81),
        wind_north_m_s=wind[0],
        wind_east_m_s=wind[1],
        course_setpoint_rad=setpoint,
        airspeed_setpoint_m_s=np.clip(airspeed + np.gradient(airspeed, time_s) / 0.8, 12, 32),
        limited=(time_s < 8.0) | (airspeed < 12.0),
        **given,
    )


def leader_on_circle(
    time_s: FloatArray, wind: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(north, east, cross-track error) of a leader that joins a clockwise circle from outside it."""
    outside = 30.0 * np.exp(-time_s / 5.0) + smooth_noise(time_s, 0.02, 0.3)
    bearing = np.empty_like(time_s)
    bearing[0] = math.pi
    for step in range(time_s.size - 1):
        course = bearing[step] + math.pi / 2.0
        along = wind[0][step] * math.cos(course) + wind[1][step] * math.sin(course)
        across = -wind[0][step] * math.sin(course) + wind[1][step] * math.cos(course)
        speed = along + math.sqrt(400.0 - across**2)
        turned = speed / (150.0 + outside[step]) * (time_s[step + 1] - time_s[step])
        bearing[step + 1] = bearing[step] + turned
    distance = 150.0 + outside
    # Outside a clockwise circle is left of the track.
    return 150.0 + distance * np.cos(bearing), distance * np.sin(bearing), -outside


def cut_out(vehicle: VehicleRecord, kept: BoolArray) -> VehicleRecord:
    """The same vehicle with only some of its samples."""
    arrays = {name: getattr(vehicle, name)[kept] for name in (*SERIES, "mode", "limited")}
    return replace(vehicle, **arrays)


def circle_flight(duration_s: float = 300.0, rate_hz: float = 20.0) -> FlightRecord:
    """A leader joins its circle in the article's wind; three followers close in on their slots."""
    # Slopes are off at both ends: the flight is cut out of a longer one.
    time_s = np.arange(-20, (duration_s + 1.0) * rate_hz + 0.5) / rate_hz
    wind = article_wind(time_s)
    north, east, cross = leader_on_circle(time_s, wind)
    leader = moving_vehicle(
        "leader", "leader", time_s, (north, east), wind, path_cross_track_error_m=cross
    )
    vehicles = [leader]
    cosine, sine = np.cos(leader.course_rad), np.sin(leader.course_rad)
    for number, (name, slot) in enumerate(SLOTS.items()):
        decay = np.exp(-time_s / (4.0 + number))
        behind = (STARTS[name][0] - slot[0]) * decay + smooth_noise(time_s, 0.04, 1.0 + number)
        aside = (STARTS[name][1] - slot[1]) * decay + smooth_noise(time_s, 0.03, 4.0 + number)
        forward, right = slot[0] + behind, slot[1] + aside
        position = (north + forward * cosine - right * sine, east + forward * sine + right * cosine)
        vehicles.append(
            moving_vehicle(
                name,
                "follower",
                time_s,
                position,
                wind,
                system_id=number + 2,
                slot_forward_m=slot[0],
                slot_right_m=slot[1],
                lyapunov=0.5 * (behind**2 + aside**2) + 0.01,
            )
        )
    angle = np.linspace(0.0, 2.0 * math.pi, 181)
    kept = (time_s >= 0.0) & (time_s <= duration_s)
    return still_flight(
        time_s[kept],
        *(cut_out(vehicle, kept) for vehicle in vehicles),
        mission="circle-wind",
        wind="article",
        rate_hz=rate_hz,
        wall_s=duration_s / 73.0,
        path_north_m=150.0 + 150.0 * np.cos(angle),
        path_east_m=150.0 * np.sin(angle),
        acceptance=RecordAcceptance(mean_error_m=0.3, settle_10m_s=60.0, min_separation_m=5.0),
    )
