"""The aircraft whose roll and speed lag, and its integration step.

`bank` is what ArduPlane's GUIDED course really does: bank from course error, then the roll's own lag,
then the turn of that bank. `tecs` is what its speed does: a hold with an integral, limited acceleration,
and height that gives way meanwhile. Either may be flown without the other.

Source of the structure: ArduPlane's guided mode and its GUIDED_P (an AC_PID without integral whose 5 Hz
filter, 0.03 s, is left out beside the roll's 0.4 s). Source of the speed's figures: flights of ArduPlane
4.7 in software; a test holds the model to them.
"""

import math
from typing import NamedTuple

from sitl_stub.air import Wind
from sitl_stub.aircraft import PlantParameters
from sitl_stub.geometry import displace, wrap_to_pi, wrap_to_two_pi
from sitl_stub.loops import (
    GRAVITY_M_S2,
    Targets,
    TurnTarget,
    acceleration_m_s2,
    bank_limited_turn_rate_rad_s,
    bank_of_rad,
    clamped,
    climb_acceleration_m_s2,
    turn_rate_rad_s,
)
from sitl_stub.plant import PlantState

CENTIDEGREE_RAD = math.radians(0.01)

TECS_GAIN_1_S = 0.55
TECS_INTEGRAL_1_S2 = 0.03
"""Proportional and integral gain of the `tecs` speed hold: +-1.5 m/s over 24 s comes out 0.99 times as
large and, with the dead time, 2.3 s late."""

TECS_ACCELERATION_M_S2 = 2.5
"""What throttle and pitch give at most, both ways."""

PX4_SLEW_M_S2 = 1.0
"""How fast PX4's airspeed setpoint goes to a new one, whatever is commanded."""

PX4_FREQUENCY_RAD_S, PX4_DAMPING, PX4_LEAD_S = 3.3, 0.3, 0.4
"""The airspeed follows that setpoint by (1 + a s) / (1 + 2 D s / w + s²/w²): fitted to steps of 0.5 to 2 m/s
and sinusoids of 12, 6 and 3 s of PX4 1.18.0-beta1 with FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX as
the aircraft flies and FW_T_TAS_TC 2, whose speeds it meets to 0.18 m/s rms."""

PX4_REFERENCE_1_S = 20.0
"""At its setpoint the reference rests."""

UNTRIMMED_SHARE, UNTRIMMED_S = 0.6, 70.0
"""Of a change of that setpoint as the parameters come: what of it is followed like that, and the time
constant with which the throttle's integral finds the rest. Steps of 1 and 2 m/s are met to 0.15 m/s rms; of
the holds of first order that with 0.05 to 0.1 1/s comes nearest, to 0.40 m/s."""

TECS_HEIGHT_SHARE = 0.4
"""Part of the kinetic energy's change that comes out of the height: 2 m for 6 m/s."""

MAX_LAGGING_STEP_S = 0.025
"""Longest step: a sixteenth of the roll's time constant; a test measures what it costs in accuracy."""


class LaggingRates(NamedTuple):
    """How everything moves at one moment."""

    turn_rate_rad_s: float
    """Turn rate of the nose, positive right."""

    acceleration_m_s2: float
    """Rate of change of the airspeed."""

    roll_rate_rad_s: float
    """Rate of change of the bank; zero where the plant has no roll."""

    integral_rate_m_s3: float
    """Rate of the speed hold's integral, or of PX4's acceleration; zero where the response is first-order."""

    reference_rate_m_s2: float
    """Rate of the airspeed that is held; zero where the response is not one of `px4`'s."""

    trim_rate_m_s2: float
    """Rate of the trimmed throttle's airspeed; zero where the response is not `px4-untrimmed`."""

    delayed_bank_rate_rad_s: float
    """Rate of the bank on its way to the roll; zero where that takes no time."""

    climb_m_s: float
    """Positive up: of the height hold, and what the speed takes out of it."""

    climb_acceleration_m_s2: float
    """Acceleration of the height hold, positive up."""

    north_m_s: float
    """Ground velocity."""

    east_m_s: float
    """Ground velocity."""


def lagging_rates(
    parameters: PlantParameters,
    targets: Targets,
    *,
    heading_rad: float,
    airspeed_m_s: float,
    roll_rad: float,
    speed_integral_m_s2: float,
    speed_reference_m_s: float,
    speed_trim_m_s: float,
    delayed_bank_rad: float,
    altitude_amsl_m: float,
    climb_m_s: float,
    wind_m_s: tuple[float, float],
) -> LaggingRates:
    """All rates at one moment."""
    north_m_s = airspeed_m_s * math.cos(heading_rad) + wind_m_s[0]
    east_m_s = airspeed_m_s * math.sin(heading_rad) + wind_m_s[1]
    course_rad = math.atan2(east_m_s, north_m_s)
    delayed_bank_rate = 0.0
    if parameters.rolls:
        wanted_rad = wanted_bank_rad(
            parameters,
            targets.turn,
            course_rad=course_rad,
            heading_rad=heading_rad,
            airspeed_m_s=airspeed_m_s,
        )
        if parameters.roll_delay_s > 0.0:
            delayed_bank_rate = (wanted_rad - delayed_bank_rad) / parameters.roll_delay_s
            wanted_rad = delayed_bank_rad
        roll_rate = (wanted_rad - roll_rad) / parameters.roll_time_s
        coordinated = bank_limited_turn_rate_rad_s(roll_rad, airspeed_m_s)
        turn = parameters.turn_efficiency * coordinated
    else:
        roll_rate = 0.0
        turn = turn_rate_rad_s(
            parameters,
            targets.turn,
            course_rad=course_rad,
            heading_rad=heading_rad,
            speed_m_s=airspeed_m_s,
        )
    climb_rate = climb_acceleration_m_s2(parameters, targets.height, altitude_amsl_m, climb_m_s)
    reference_rate = trim_rate = 0.0
    if parameters.speed_response == "tecs":
        error_m_s = targets.speed.speed_m_s - airspeed_m_s
        limit = min(TECS_ACCELERATION_M_S2, targets.speed.max_acceleration_m_s2)
        acceleration = tecs_acceleration_m_s2(error_m_s, speed_integral_m_s2, limit)
        integral_rate = tecs_integral_rate_m_s3(error_m_s, speed_integral_m_s2, limit)
        climb_m_s -= TECS_HEIGHT_SHARE * airspeed_m_s * acceleration / GRAVITY_M_S2
    elif parameters.slews:
        acceleration = speed_integral_m_s2
        missing_m_s = targets.speed.speed_m_s - speed_reference_m_s
        limit = min(PX4_SLEW_M_S2, targets.speed.max_acceleration_m_s2)
        reference_rate = clamped(PX4_REFERENCE_1_S * missing_m_s, limit)
        aimed_m_s, aimed_rate = speed_reference_m_s, reference_rate
        if not parameters.is_trimmed:
            trim_rate = (speed_reference_m_s - speed_trim_m_s) / UNTRIMMED_S
            untrimmed_m_s = speed_reference_m_s - speed_trim_m_s
            aimed_m_s = speed_trim_m_s + UNTRIMMED_SHARE * untrimmed_m_s
            aimed_rate = trim_rate + UNTRIMMED_SHARE * (reference_rate - trim_rate)
        behind_m_s = aimed_m_s + PX4_LEAD_S * aimed_rate - airspeed_m_s
        integral_rate = PX4_FREQUENCY_RAD_S**2 * behind_m_s
        integral_rate -= 2.0 * PX4_DAMPING * PX4_FREQUENCY_RAD_S * acceleration
    else:
        acceleration = acceleration_m_s2(parameters, targets.speed, airspeed_m_s)
        integral_rate = 0.0
    return LaggingRates(
        turn,
        acceleration,
        roll_rate,
        integral_rate,
        reference_rate,
        trim_rate,
        delayed_bank_rate,
        climb_m_s,
        climb_rate,
        north_m_s,
        east_m_s,
    )


def wanted_bank_rad(
    parameters: PlantParameters,
    target: TurnTarget,
    *,
    course_rad: float,
    heading_rad: float,
    airspeed_m_s: float,
) -> float:
    """The bank that is asked for, positive right.

    `bank`, ArduPlane's guided course: phi = sat(GUIDED_P wrap(target - present)). `npfg`, PX4's:
    phi = sat(atan(alpha V sin(target - present) / g)), and beyond 90 degrees as at 90.

    Saturated by the bank limit and by atan(a / g) of the lateral acceleration a that came with the
    command, whichever is smaller.
    """
    if target.hold == "bank":
        return clamped(target.angle_rad, parameters.max_bank_rad)
    error_rad = wrap_to_pi(
        target.angle_rad - (course_rad if target.hold == "course" else heading_rad)
    )
    limit = min(parameters.max_bank_rad, math.atan(target.max_acceleration_m_s2 / GRAVITY_M_S2))
    if parameters.kind == "npfg":
        sine = math.sin(clamped(error_rad, 0.5 * math.pi))
        return clamped(math.atan(parameters.alpha_1_s * airspeed_m_s * sine / GRAVITY_M_S2), limit)
    return clamped(parameters.guided_p_cdeg_rad * CENTIDEGREE_RAD * error_rad, limit)


def tecs_acceleration_m_s2(error_m_s: float, integral_m_s2: float, limit_m_s2: float) -> float:
    """Speed hold with an integral: dV/dt = sat(k (target - V) + I)."""
    return clamped(TECS_GAIN_1_S * error_m_s + integral_m_s2, limit_m_s2)


def tecs_integral_rate_m_s3(error_m_s: float, integral_m_s2: float, limit_m_s2: float) -> float:
    """dI/dt = k_i (target - V), and nothing while the acceleration is at its limit towards it."""
    wanted = TECS_GAIN_1_S * error_m_s + integral_m_s2
    if abs(wanted) >= limit_m_s2 and wanted * error_m_s > 0.0:
        return 0.0
    return TECS_INTEGRAL_1_S2 * error_m_s


def shown_bank_rad(
    parameters: PlantParameters, rates: LaggingRates, roll_rad: float, airspeed_m_s: float
) -> float:
    """The bank as an attitude sensor would see it."""
    if parameters.rolls:
        return roll_rad
    return bank_of_rad(rates.turn_rate_rad_s, airspeed_m_s)


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
        speed_trim_m_s=trim_of(state),
        delayed_bank_rad=state.delayed_bank_rad,
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
        None if parameters.is_trimmed else trim_of(state) + span_s * rates.trim_rate_m_s2,
        state.delayed_bank_rad + span_s * rates.delayed_bank_rate_rad_s,
        climb_m_s=state.climb_m_s + span_s * rates.climb_acceleration_m_s2,
    )


def reference_of(state: PlantState) -> float:
    """The airspeed that PX4's hold holds; the present one where it has not held any."""
    reference = state.speed_reference_m_s
    return state.speed_m_s if reference is None else reference


def trim_of(state: PlantState) -> float:
    """The airspeed to which an untrimmed throttle is trimmed; that which is held where there was none."""
    return reference_of(state) if state.speed_trim_m_s is None else state.speed_trim_m_s


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
