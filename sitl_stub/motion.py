"""The true motion at one instant, and the way from standing on the ground into the air."""

import math
from typing import Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.lagging_plant import rates_of, shown_bank_rad
from sitl_stub.loops import Targets, bank_of_rad
from sitl_stub.plant import RATES, PlantRates, PlantState, with_speed_kind
from sitl_stub.rigid_body import air_flow, attitude_rates, body_to_ground, velocity_ned_m_s
from sitl_stub.six_dof import body_of

ROLL_ACCELERATION_M_S2 = 4.0
"""Along the runway."""

LIFT_OFF_MARGIN = 1.1
"""Airspeed of lifting off, in parts of the slowest that is flown."""

REACHED_WITHIN_M = 2.0
"""Below the wanted height by which a climb counts as over, as in ArduPlane."""


class Motion(NamedTuple):
    """The true motion at one instant. A tuple, since one is made per report."""

    north_m_s: float
    """Ground velocity."""

    east_m_s: float
    """Ground velocity."""

    down_m_s: float
    """Ground velocity, positive down."""

    course_rad: float
    """Direction of the ground velocity, [0, 2 pi)."""

    ground_speed_m_s: float
    """Horizontal speed over ground."""

    heading_rad: float
    """Direction of the nose, which is that of the air velocity but on the six-dof plant, [0, 2 pi)."""

    airspeed_m_s: float
    """Horizontal speed through the air."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""

    bank_rad: float
    """Bank of the coordinated turn, positive right."""


def ideal_motion(
    plant: PlantParameters, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]
) -> Motion:
    """In the air, of the plants of first order."""
    state = with_speed_kind(state, targets.speed.kind, wind_m_s)
    rates = RATES[plant.kind](plant, targets, state.direction_rad, state.speed_m_s, wind_m_s)
    north_m_s, east_m_s = rates.north_m_s, rates.east_m_s
    air_north_m_s, air_east_m_s = north_m_s - wind_m_s[0], east_m_s - wind_m_s[1]
    ground_speed_m_s = math.hypot(north_m_s, east_m_s)
    airspeed_m_s = math.hypot(air_north_m_s, air_east_m_s)
    heading_rad = math.atan2(air_east_m_s, air_north_m_s)
    turn_rate_rad_s = rates.turn_rate_rad_s
    if plant.kind == "course-hold":
        turn_rate_rad_s = nose_turn_rate_rad_s(
            rates,
            drift_rad=math.atan2(east_m_s, north_m_s) - heading_rad,
            ground_speed_m_s=ground_speed_m_s,
            airspeed_m_s=airspeed_m_s,
            holds_airspeed=targets.speed.kind == "airspeed",
        )
    return Motion(
        north_m_s,
        east_m_s,
        -state.climb_m_s,
        wrap_to_two_pi(math.atan2(east_m_s, north_m_s)),
        ground_speed_m_s,
        wrap_to_two_pi(heading_rad),
        airspeed_m_s,
        turn_rate_rad_s,
        bank_of_rad(turn_rate_rad_s, airspeed_m_s),
    )


def nose_turn_rate_rad_s(
    rates: PlantRates,
    *,
    drift_rad: float,
    ground_speed_m_s: float,
    airspeed_m_s: float,
    holds_airspeed: bool,
) -> float:
    """Turn rate of the air velocity while the course turns, in steady wind: the wind triangle's derivative.

    The acceleration over ground is that through the air, and its part across the nose turns the nose.
    """
    turning_m_s2 = ground_speed_m_s * rates.turn_rate_rad_s
    if holds_airspeed:
        across_m_s2 = turning_m_s2 / math.cos(drift_rad)
    else:
        across_m_s2 = turning_m_s2 * math.cos(drift_rad) + rates.acceleration_m_s2 * math.sin(
            drift_rad
        )
    return across_m_s2 / max(airspeed_m_s, 1.0)


def lagging_motion(
    plant: PlantParameters, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]
) -> Motion:
    """In the air, of the plants whose roll or speed lag."""
    rates = rates_of(plant, targets, state, wind_m_s)
    return Motion(
        rates.north_m_s,
        rates.east_m_s,
        -rates.climb_m_s,
        wrap_to_two_pi(math.atan2(rates.east_m_s, rates.north_m_s)),
        math.hypot(rates.north_m_s, rates.east_m_s),
        state.direction_rad,
        state.speed_m_s,
        rates.turn_rate_rad_s,
        shown_bank_rad(plant, rates, state.roll_rad, state.speed_m_s),
    )


def body_motion(state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
    """In the air, of the rigid body."""
    body = body_of(state, wind_m_s)
    rotation = body_to_ground(body)
    north_m_s, east_m_s, down_m_s = velocity_ned_m_s(body, rotation)
    _, _, turn_rate_rad_s = attitude_rates(body)
    return Motion(
        north_m_s,
        east_m_s,
        down_m_s,
        wrap_to_two_pi(math.atan2(east_m_s, north_m_s)),
        math.hypot(north_m_s, east_m_s),
        wrap_to_two_pi(body.heading_rad),
        air_flow(body, rotation, wind_m_s).airspeed_m_s,
        turn_rate_rad_s,
        body.bank_rad,
    )


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
