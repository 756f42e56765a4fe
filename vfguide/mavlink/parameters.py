"""Parameters of an autopilot that a flight depends on, and requests for them."""

import math
from collections.abc import Iterable, Mapping

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.guidance.air_data import CreepingHold
from vfguide.state import SpeedHold


class FlightNeeds(msgspec.Struct, frozen=True, kw_only=True):
    """Mission's needs that a vehicle's autopilot must meet."""

    airspeed_min: float
    """Lowest airspeed setpoint, m/s."""
    airspeed_max: float
    """Highest airspeed setpoint, m/s."""
    airspeed: float
    """Airspeed at which alpha is declared, m/s."""
    max_bank: float
    """Bank angle with which turns are planned, rad."""
    alpha: float
    """Course response that the laws count on, 1/s."""
    rate_hz: float
    """Rate of position reports, 1/s."""
    system_id: int
    """MAVLink system of vehicle and companion."""
    slips: bool = False
    """Whether it turns less than its bank angle implies."""
    max_acceleration: float = 0.0
    """Greatest acceleration that the laws count on, m/s²; 0 where unknown."""


class AutopilotResponse(msgspec.Struct, frozen=True, kw_only=True):
    """Response of an autopilot by its own parameters; None where they do not tell."""

    alpha: float | None = None
    """Course response, 1/s."""
    beta: float | None = None
    """Speed response, 1/s."""
    airspeed_min: float | None = None
    """Lowest airspeed, m/s."""
    airspeed_max: float | None = None
    """Highest airspeed, m/s."""
    max_bank: float | None = None
    """Greatest bank angle, rad."""
    climb_max: float | None = None
    """Greatest climb rate to another height, m/s."""
    sink_max: float | None = None
    """Greatest sink rate, m/s, positive."""
    course_dead_time: float | None = None
    """Dead time from a course setpoint to the first change of the bank angle, s."""
    course_lag: float | None = None
    """Time constant of the roll, s."""
    speed_hold: SpeedHold | None = None
    """Kind of hold that beta belongs to."""
    creeping_hold: CreepingHold | None = None
    """Share of a new airspeed that comes at once where the rest creeps on."""
    coordinated_alpha: float | None = None
    """Course response if it turned as its bank angle implies, 1/s."""


def request_parameters(
    system_id: int, component_id: int, names: Iterable[str]
) -> list[MAVLink_message]:
    """Return a PARAM_REQUEST_READ for each name."""
    return [
        mavlink.MAVLink_param_request_read_message(
            system_id, component_id, name.encode("ascii"), -1
        )
        for name in names
    ]


def first_known(parameters: Mapping[str, float], *names: str) -> tuple[str, float] | None:
    """Return the first of these parameters that was answered, with its name: versions differ in names."""
    return next(((name, parameters[name]) for name in names if name in parameters), None)


def above_zero(value: float | None) -> float | None:
    """Return a limit; None where it is unknown or not positive."""
    return value if value is not None and value > 0.0 else None


def airspeed_warnings(
    lowest: tuple[str, float] | None, highest: tuple[str, float] | None, needs: FlightNeeds
) -> list[str]:
    """Return warnings about airspeeds that the mission may ask for and the autopilot would not fly."""
    warnings = []
    if lowest is not None and needs.airspeed_min < lowest[1] - 0.01:
        warnings.append(
            f"{lowest[0]} is {lowest[1]:g} m/s and the mission asks for down to {needs.airspeed_min:g}:"
            " slower setpoints will be refused; narrow airspeed_range_m_s, or lower it"
        )
    if highest is not None and needs.airspeed_max > highest[1] + 0.01:
        warnings.append(
            f"{highest[0]} is {highest[1]:g} m/s and the mission asks for up to {needs.airspeed_max:g}:"
            " faster setpoints will be refused; narrow airspeed_range_m_s, or raise it"
        )
    return warnings


def bank_warning(limit: tuple[str, float] | None, needs: FlightNeeds) -> list[str]:
    """Return a warning if the mission plans steeper turns than the autopilot's limit (degrees)."""
    wanted = math.degrees(needs.max_bank)
    if limit is None or limit[1] >= wanted - 0.1:
        return []
    return [
        (
            f"{limit[0]} is {limit[1]:g} degrees and the mission turns with up to {wanted:g}:"
            " lower max_bank_deg, or raise it"
        )
    ]
