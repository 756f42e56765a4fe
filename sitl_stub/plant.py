"""What an aircraft remembers from one step to the next, and the two plants of first order.

All are pure functions over a frozen state. Two plants of first order, chosen by name; `lagging_plant` has
the one whose roll and speed lag. `heading-hold` is the air-relative truth: the loops act on heading and
airspeed, and the wind carries the aircraft. `course-hold` is the article's model: the loops act on course
and ground speed, and the wind only enters where an airspeed is held.

Both fly in the horizontal plane; height is a hold of second order beside it, and the climb angle's share
in the ground speed (below 1 % at 3 m/s of climb) is left out.
"""

import math
from typing import NamedTuple

import msgspec

from sitl_stub.air import Wind
from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import (
    MIN_GROUND_SPEED_M_S,
    airspeed_of_m_s,
    displace,
    ground_speed_along_m_s,
    wrap_to_two_pi,
)
from sitl_stub.loops import (
    AltitudeTarget,
    SpeedKind,
    Targets,
    acceleration_m_s2,
    climb_acceleration_m_s2,
    turn_rate_rad_s,
)
from sitl_stub.rigid_body import Body

MAX_STEP_S = 0.05
"""Longest integration step. Over two minutes of turning in the article's wind such steps stay within
the resolution of the telemetry (11 mm, 0.01 deg) of steps a hundred times finer; a test measures it."""


class PlantState(msgspec.Struct, frozen=True):
    """Position, motion, and the states of loops that have some."""

    direction_rad: float
    """Heading (all others) or course (course-hold), in [0, 2 pi)."""

    speed_m_s: float
    """The speed that `speed_kind` names."""

    speed_kind: SpeedKind
    """Always `airspeed` but on the course-hold plant."""

    latitude_rad: float
    """Geodetic latitude."""

    longitude_rad: float
    """Longitude, in (-pi, pi]."""

    altitude_amsl_m: float
    """Altitude, also taken as height above the ellipsoid (the geoid's 100 m at most are 2e-5)."""

    roll_rad: float = 0.0
    """Bank of the bank plant, positive right."""

    speed_integral_m_s2: float = 0.0
    """Integral of the `tecs` speed hold; of `px4`'s its acceleration."""

    speed_reference_m_s: float | None = None
    """What the `px4` speed hold holds now, on its way to what is commanded; None before its first step."""

    speed_trim_m_s: float | None = None
    """Airspeed to which `px4-untrimmed` has brought its throttle; None before its first step."""

    delayed_bank_rad: float = 0.0
    """Bank that has reached the roll, of the bank that is wanted: `npfg` with a delay of the roll."""

    memory: tuple[float, ...] = ()
    """State of the loops of a user's plant; empty before its first step."""

    body: Body | None = None
    """State of the `six-dof` plant's body; None before its first step in the air."""

    climb_m_s: float = 0.0
    """Climb rate of the height hold, positive up; the `six-dof` plant has its own in its body."""


__all__ = [
    "MAX_STEP_S",
    "PlantParameters",
    "PlantRates",
    "PlantState",
    "bounded_ground_speed_m_s",
    "course_hold_rates",
    "heading_hold_rates",
    "stepped",
    "with_speed_kind",
]


class PlantRates(NamedTuple):
    """How the plant moves now. A tuple, since four of them are made per report."""

    turn_rate_rad_s: float
    """Turn rate of the heading or course held, positive right."""

    acceleration_m_s2: float
    """Rate of change of the speed held."""

    north_m_s: float
    """Ground velocity."""

    east_m_s: float
    """Ground velocity."""


def heading_hold_rates(
    parameters: PlantParameters,
    targets: Targets,
    heading_rad: float,
    airspeed_m_s: float,
    wind_m_s: tuple[float, float],
) -> PlantRates:
    """The heading-hold plant: the nose turns, the wind drifts.

    A course is flown through the drift the autopilot measures: the course error turns the nose.
    """
    north_m_s = airspeed_m_s * math.cos(heading_rad) + wind_m_s[0]
    east_m_s = airspeed_m_s * math.sin(heading_rad) + wind_m_s[1]
    turn = turn_rate_rad_s(
        parameters,
        targets.turn,
        course_rad=math.atan2(east_m_s, north_m_s),
        heading_rad=heading_rad,
        speed_m_s=airspeed_m_s,
    )
    return PlantRates(
        turn, acceleration_m_s2(parameters, targets.speed, airspeed_m_s), north_m_s, east_m_s
    )


def course_hold_rates(
    parameters: PlantParameters,
    targets: Targets,
    course_rad: float,
    speed_m_s: float,
    wind_m_s: tuple[float, float],
) -> PlantRates:
    """The course-hold plant, the article's equations: the course itself is the loop's state.

    Under a ground speed target `speed_m_s` is the ground speed and the wind does not enter; under an
    airspeed target it is the airspeed, and the ground speed follows from the triangle at once.
    """
    if targets.speed.kind == "ground-speed":
        ground_speed_m_s = max(speed_m_s, MIN_GROUND_SPEED_M_S)
    else:
        ground_speed_m_s = ground_speed_along_m_s(course_rad, speed_m_s, *wind_m_s)
    north_m_s = ground_speed_m_s * math.cos(course_rad)
    east_m_s = ground_speed_m_s * math.sin(course_rad)
    turn = turn_rate_rad_s(
        parameters,
        targets.turn,
        course_rad=course_rad,
        heading_rad=math.atan2(east_m_s - wind_m_s[1], north_m_s - wind_m_s[0]),
        speed_m_s=ground_speed_m_s,
    )
    return PlantRates(
        turn, acceleration_m_s2(parameters, targets.speed, speed_m_s), north_m_s, east_m_s
    )


RATES = {"heading-hold": heading_hold_rates, "course-hold": course_hold_rates}
"""The equations of motion by the plant's name."""


def bounded_ground_speed_m_s(
    parameters: PlantParameters,
    course_rad: float,
    ground_speed_m_s: float,
    wind_m_s: tuple[float, float],
) -> float:
    """A ground speed kept where the aircraft can fly it.

    Between those the triangle gives for the slowest and the fastest airspeed along the course; where
    the wind leaves none, at the triangle's floor.
    """
    slowest = ground_speed_along_m_s(course_rad, parameters.airspeed_min_m_s, *wind_m_s)
    fastest = ground_speed_along_m_s(course_rad, parameters.airspeed_max_m_s, *wind_m_s)
    return max(slowest, min(fastest, ground_speed_m_s))


def with_speed_kind(
    state: PlantState, kind: SpeedKind, wind_m_s: tuple[float, float]
) -> PlantState:
    """The motion of a course-hold plant as a state with the other speed: a switch without a jump."""
    if kind == state.speed_kind:
        return state
    convert = ground_speed_along_m_s if kind == "ground-speed" else airspeed_of_m_s
    return PlantState(
        state.direction_rad,
        convert(state.direction_rad, state.speed_m_s, *wind_m_s),
        kind,
        state.latitude_rad,
        state.longitude_rad,
        state.altitude_amsl_m,
        climb_m_s=state.climb_m_s,
    )


def stepped(
    parameters: PlantParameters,
    targets: Targets,
    state: PlantState,
    wind: Wind,
    *,
    time_s: float,
    step_s: float,
) -> PlantState:
    """The state one midpoint (second-order Runge-Kutta) step later."""
    rates = RATES[parameters.kind]
    kind = targets.speed.kind
    start_wind_m_s = wind.at(time_s)
    state = with_speed_kind(state, kind, start_wind_m_s)
    half_s = 0.5 * step_s
    start = rates(parameters, targets, state.direction_rad, state.speed_m_s, start_wind_m_s)
    middle_direction_rad = state.direction_rad + half_s * start.turn_rate_rad_s
    middle_speed_m_s = state.speed_m_s + half_s * start.acceleration_m_s2
    middle_wind_m_s = wind.at(time_s + half_s)
    if kind == "ground-speed":
        middle_speed_m_s = bounded_ground_speed_m_s(
            parameters, middle_direction_rad, middle_speed_m_s, middle_wind_m_s
        )
    middle = rates(parameters, targets, middle_direction_rad, middle_speed_m_s, middle_wind_m_s)
    direction_rad = state.direction_rad + step_s * middle.turn_rate_rad_s
    speed_m_s = state.speed_m_s + step_s * middle.acceleration_m_s2
    if kind == "ground-speed":
        speed_m_s = bounded_ground_speed_m_s(
            parameters, direction_rad, speed_m_s, wind.at(time_s + step_s)
        )
    else:
        speed_m_s = max(parameters.airspeed_min_m_s, min(parameters.airspeed_max_m_s, speed_m_s))
    middle_altitude_m, altitude_m, climb_m_s = height_step(
        parameters, targets.height, state.altitude_amsl_m, state.climb_m_s, step_s
    )
    latitude_rad, longitude_rad = displace(
        state.latitude_rad,
        state.longitude_rad,
        middle_altitude_m,
        north_m=step_s * middle.north_m_s,
        east_m=step_s * middle.east_m_s,
    )
    return PlantState(
        wrap_to_two_pi(direction_rad),
        speed_m_s,
        kind,
        latitude_rad,
        longitude_rad,
        altitude_m,
        climb_m_s=climb_m_s,
    )


def height_step(
    parameters: PlantParameters,
    target: AltitudeTarget,
    altitude_m: float,
    climb_m_s: float,
    step_s: float,
) -> tuple[float, float, float]:
    """(height half way, height, climb rate) one midpoint step later, m and m/s."""
    half_s = 0.5 * step_s
    rate = climb_acceleration_m_s2(parameters, target, altitude_m, climb_m_s)
    middle_m, middle_m_s = altitude_m + half_s * climb_m_s, climb_m_s + half_s * rate
    rate = climb_acceleration_m_s2(parameters, target, middle_m, middle_m_s)
    return middle_m, altitude_m + step_s * middle_m_s, climb_m_s + step_s * rate
