"""What of an autopilot's parameters a flight depends on, and how they are asked for."""

import math
from collections.abc import Iterable, Mapping

import msgspec
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from vfguide.guidance.air_data import CreepingHold
from vfguide.state import SpeedHold


class FlightNeeds(msgspec.Struct, frozen=True, kw_only=True):
    """What a mission expects of a vehicle's autopilot."""

    airspeed_min: float
    """Lowest airspeed that it will be asked for, m/s."""
    airspeed_max: float
    """Highest airspeed that it will be asked for, m/s."""
    airspeed: float
    """At which alpha is declared, m/s."""
    max_bank: float
    """Bank that turns are planned with, rad."""
    alpha: float
    """Course response that the laws count on, 1/s."""
    rate_hz: float
    """Position reports that will be asked for, per second."""
    system_id: int
    """MAVLink system of vehicle and companion."""
    slips: bool = False
    """Whether it turns less than its bank says."""
    max_acceleration: float = 0.0
    """Fastest change of speed that the laws count on, m/s²; 0 where nothing of it is known."""


class AutopilotResponse(msgspec.Struct, frozen=True, kw_only=True):
    """How an autopilot flies, by its own parameters; None where they do not tell."""

    alpha: float | None = None
    """Course response, 1/s."""
    beta: float | None = None
    """Speed response, 1/s."""
    airspeed_min: float | None = None
    """m/s."""
    airspeed_max: float | None = None
    """m/s."""
    max_bank: float | None = None
    """rad."""
    climb_max: float | None = None
    """Fastest climb that it flies to another height, m/s."""
    sink_max: float | None = None
    """Fastest descent, m/s, above zero."""
    course_dead_time: float | None = None
    """From a course setpoint to the first change of the bank, s."""
    course_lag: float | None = None
    """Time constant of the roll, s."""
    speed_hold: SpeedHold | None = None
    """What kind of hold beta is of."""
    creeping_hold: CreepingHold | None = None
    """What of a new airspeed comes at once, where the rest creeps on."""
    coordinated_alpha: float | None = None
    """Course response if it turned as its bank says, 1/s."""


def request_parameters(
    system_id: int, component_id: int, names: Iterable[str]
) -> list[MAVLink_message]:
    """PARAM_REQUEST_READ by name, one for each."""
    return [
        mavlink.MAVLink_param_request_read_message(
            system_id, component_id, name.encode("ascii"), -1
        )
        for name in names
    ]


def first_known(parameters: Mapping[str, float], *names: str) -> tuple[str, float] | None:
    """The first of these parameters that was answered, with its name: names change with the version."""
    return next(((name, parameters[name]) for name in names if name in parameters), None)


def above_zero(value: float | None) -> float | None:
    """A limit; None where it is not known, or is none."""
    return value if value is not None and value > 0.0 else None


def airspeed_warnings(
    lowest: tuple[str, float] | None, highest: tuple[str, float] | None, needs: FlightNeeds
) -> list[str]:
    """Airspeeds that the mission may ask for and the autopilot would not fly."""
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
    """Turns that the mission plans and the autopilot would not fly; the limit in degrees."""
    wanted = math.degrees(needs.max_bank)
    if limit is None or limit[1] >= wanted - 0.1:
        return []
    return [
        (
            f"{limit[0]} is {limit[1]:g} degrees and the mission turns with up to {wanted:g}:"
            " lower max_bank_deg, or raise it"
        )
    ]
