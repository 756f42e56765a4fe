"""One integration step of the aircraft whose roll and speed lag."""

from sitl_stub.air import Wind
from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.lagging_plant import LaggingRates, lagging_rates
from sitl_stub.plant_state import PlantState
from sitl_stub.targets import Targets

MAX_LAGGING_STEP_S = 0.025
"""Longest step: a sixteenth of the roll's time constant; a test measures what it costs in accuracy."""


def rates_of(
    parameters: PlantParameters,
    targets: Targets,
    state: PlantState,
    wind_m_s: tuple[float, float],
) -> LaggingRates:
    """How a state moves in this wind."""
    return lagging_rates(
        parameters,
        targets,
        heading_rad=state.direction_rad,
        airspeed_m_s=state.speed_m_s,
        roll_rad=state.roll_rad,
        speed_integral_m_s2=state.speed_integral_m_s2,
        speed_reference_m_s=reference_of(state),
        altitude_amsl_m=state.altitude_amsl_m,
        climb_m_s=state.climb_m_s,
        wind_m_s=wind_m_s,
    )


def displace_by(
    parameters: PlantParameters, state: PlantState, rates: LaggingRates, span_s: float
) -> PlantState:
    """The state after a span at constant rates, within what the aircraft can do."""
    latitude_rad, longitude_rad = displace(
        state.latitude_rad,
        state.longitude_rad,
        state.altitude_amsl_m,
        north_m=span_s * rates.north_m_s,
        east_m=span_s * rates.east_m_s,
    )
    speed_m_s = state.speed_m_s + span_s * rates.acceleration_m_s2
    return PlantState(
        wrap_to_two_pi(state.direction_rad + span_s * rates.turn_rate_rad_s),
        max(parameters.airspeed_min_m_s, min(parameters.airspeed_max_m_s, speed_m_s)),
        "airspeed",
        latitude_rad,
        longitude_rad,
        state.altitude_amsl_m + span_s * rates.climb_m_s,
        state.roll_rad + span_s * rates.roll_rate_rad_s,
        state.speed_integral_m_s2 + span_s * rates.integral_rate_m_s3,
        reference_of(state) + span_s * rates.reference_rate_m_s2,
        climb_m_s=state.climb_m_s + span_s * rates.climb_acceleration_m_s2,
    )


def reference_of(state: PlantState) -> float:
    """The airspeed that the `px4` hold holds; the present one where it has not held any."""
    reference = state.speed_reference_m_s
    return state.speed_m_s if reference is None else reference


def lagging_stepped(
    parameters: PlantParameters,
    targets: Targets,
    state: PlantState,
    wind: Wind,
    *,
    time_s: float,
    step_s: float,
) -> PlantState:
    """The state one midpoint (second-order Runge-Kutta) step later."""
    half_s = 0.5 * step_s
    start = rates_of(parameters, targets, state, wind.at(time_s))
    middle = displace_by(parameters, state, start, half_s)
    rates = rates_of(parameters, targets, middle, wind.at(time_s + half_s))
    return displace_by(parameters, state, rates, step_s)
