"""The plants of the article (first order) and the plants with roll and speed lag.

`heading-hold` acts on heading and airspeed with first-order loops, and the wind carries the aircraft.
`course-hold` is the article's model: its loops act on course and ground speed, and the wind only matters
where an airspeed is held. Both fly in the horizontal plane with a second-order height hold. The climb
angle's effect on the ground speed (below 1 % at 3 m/s of climb) is left out.

`bank` models ArduPlane's GUIDED course: bank from course error, the roll's lag, then the turn of that bank.
`tecs` models its speed: a hold with an integral, limited acceleration, and a height that gives way.
Each of the two may be flown without the other.

Source of the structure: ArduPlane's guided mode and its GUIDED_P (an AC_PID without integral whose 5 Hz
filter, 0.03 s, is left out beside the roll's 0.4 s). Source of the speed's figures: flights of ArduPlane
4.7 in software; a test checks the model against them.
"""

import math

import msgspec

from sitl_stub.air import Wind
from sitl_stub.geometry import (
    MIN_GROUND_SPEED_M_S,
    airspeed_of_m_s,
    displace,
    ground_speed_along_m_s,
    wrap_to_two_pi,
)
from sitl_stub.loops import (
    GRAVITY_M_S2,
    AltitudeTarget,
    PlantParameters,
    SpeedKind,
    SpeedTarget,
    Targets,
    acceleration_m_s2,
    bank_limited_turn_rate_rad_s,
    bank_of_rad,
    clamped,
    climb_acceleration_m_s2,
    turn_rate_rad_s,
    wanted_bank_rad,
)
from sitl_stub.plant import AirPlant, AirRates, AirState, Motion, Plant, PlantState, plant

MAX_STEP_S = 0.05
"""Longest step of the first-order plants. Over two minutes of turning in the article's wind, it stays within
the telemetry's resolution (11 mm, 0.01 deg) of steps a hundred times finer; a test measures this."""

TECS_GAIN_1_S = 0.55
TECS_INTEGRAL_1_S2 = 0.03
"""Proportional and integral gain of the `tecs` speed hold. It follows +-1.5 m/s over 24 s with 0.99 times the
amplitude and, with the dead time, 2.3 s late."""

TECS_ACCELERATION_M_S2 = 2.5
"""Limit of the acceleration by throttle and pitch, both ways."""

PX4_SLEW_M_S2 = 1.0
"""Slew rate of PX4's airspeed setpoint toward the commanded airspeed."""

PX4_FREQUENCY_RAD_S, PX4_DAMPING, PX4_LEAD_S = 3.3, 0.3, 0.4
"""Response of the airspeed to PX4's slewed setpoint: (1 + a s) / (1 + 2 D s / w + s²/w²).

Fitted to steps of 0.5 to 2 m/s and sinusoids of 12, 6 and 3 s of PX4 1.18.0-beta1, to 0.18 m/s
rms. FW_THR_ASPD_MIN, FW_THR_TRIM and FW_THR_ASPD_MAX were as the aircraft flies, FW_T_TAS_TC was 2.
"""

PX4_REFERENCE_1_S = 20.0
"""Gain of the slewed setpoint's approach to the commanded airspeed, at which it comes to rest."""

UNTRIMMED_SHARE, UNTRIMMED_S = 0.6, 70.0
"""Response to a setpoint change with PX4's default parameters.

A share is followed as with a trimmed throttle; the throttle's integral finds the rest with the time constant.
Steps of 1 and 2 m/s are met to 0.15 m/s rms, and to 0.40 m/s by the best first-order hold (0.05 to 0.1 1/s).
"""

TECS_HEIGHT_SHARE = 0.4
"""Share of a change of kinetic energy that comes from height: 2 m for 6 m/s."""

MAX_LAGGING_STEP_S = 0.025
"""Longest step: a sixteenth of the roll's time constant; a test measures the loss of accuracy."""


class PlantRates(msgspec.Struct, frozen=True):
    """Rates of turn and speed, and the ground velocity."""

    turn_rate_rad_s: float
    """Turn rate of the heading or course held, positive right."""

    acceleration_m_s2: float
    north_m_s: float
    east_m_s: float


def heading_hold_rates(
    parameters: PlantParameters,
    targets: Targets,
    heading_rad: float,
    airspeed_m_s: float,
    wind_m_s: tuple[float, float],
) -> PlantRates:
    """Return the rates of the heading-hold plant, whose nose turns and which drifts with the wind.

    A course is flown by its error, which includes the drift, turning the nose.
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
    """Return the rates of the course-hold plant, by the article's equations: the course is the loop's state.

    Under a ground speed target `speed_m_s` is the ground speed and the wind does not matter. Under an
    airspeed target it is the airspeed, and the ground speed follows from the wind triangle at once.
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
"""Equations of motion by the plant's name."""


def bounded_ground_speed_m_s(
    parameters: PlantParameters,
    course_rad: float,
    ground_speed_m_s: float,
    wind_m_s: tuple[float, float],
) -> float:
    """Clamp a ground speed to the range that the aircraft can fly along a course.

    The range is that of the slowest and fastest airspeed in the wind triangle. Where the wind leaves
    none, it shrinks to the floor of the triangle.
    """
    slowest = ground_speed_along_m_s(course_rad, parameters.airspeed_min_m_s, *wind_m_s)
    fastest = ground_speed_along_m_s(course_rad, parameters.airspeed_max_m_s, *wind_m_s)
    return max(slowest, min(fastest, ground_speed_m_s))


def with_speed_kind(
    state: PlantState, kind: SpeedKind, wind_m_s: tuple[float, float]
) -> PlantState:
    """Convert a course-hold plant's state to the other kind of speed without a jump of its motion."""
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


def height_step(
    parameters: PlantParameters,
    target: AltitudeTarget,
    altitude_m: float,
    climb_m_s: float,
    step_s: float,
) -> tuple[float, float, float]:
    """Return (height half way, height, climb rate) one midpoint step later, m and m/s."""
    half_s = 0.5 * step_s
    rate = climb_acceleration_m_s2(parameters, target, altitude_m, climb_m_s)
    middle_m, middle_m_s = altitude_m + half_s * climb_m_s, climb_m_s + half_s * rate
    rate = climb_acceleration_m_s2(parameters, target, middle_m, middle_m_s)
    return middle_m, altitude_m + step_s * middle_m_s, climb_m_s + step_s * rate


def nose_turn_rate_rad_s(
    rates: PlantRates,
    *,
    drift_rad: float,
    ground_speed_m_s: float,
    airspeed_m_s: float,
    holds_airspeed: bool,
) -> float:
    """Return the turn rate of the air velocity while the course turns: the wind triangle's derivative.

    In steady wind the accelerations over ground and through the air are equal; the component across
    the nose turns it.
    """
    turning_m_s2 = ground_speed_m_s * rates.turn_rate_rad_s
    if holds_airspeed:
        across_m_s2 = turning_m_s2 / math.cos(drift_rad)
    else:
        across_m_s2 = turning_m_s2 * math.cos(drift_rad) + rates.acceleration_m_s2 * math.sin(
            drift_rad
        )
    return across_m_s2 / max(airspeed_m_s, 1.0)


def tecs_acceleration_m_s2(error_m_s: float, integral_m_s2: float, limit_m_s2: float) -> float:
    """Return the acceleration of a speed hold with an integral: dV/dt = sat(k (target - V) + I)."""
    return clamped(TECS_GAIN_1_S * error_m_s + integral_m_s2, limit_m_s2)


def tecs_integral_rate_m_s3(error_m_s: float, integral_m_s2: float, limit_m_s2: float) -> float:
    """Return dI/dt = k_i (target - V), or 0 while the acceleration is at its limit toward the target."""
    wanted = TECS_GAIN_1_S * error_m_s + integral_m_s2
    if abs(wanted) >= limit_m_s2 and wanted * error_m_s > 0.0:
        return 0.0
    return TECS_INTEGRAL_1_S2 * error_m_s


@plant("course-hold")
@plant("heading-hold")
class FirstOrder(Plant):
    """First-order plant with one gain each for heading or course, and speed."""

    longest_step_s = MAX_STEP_S

    @classmethod
    def of(cls, parameters: PlantParameters) -> Plant:
        """Return the plant, which is a `Lagging` one if its roll or speed lags."""
        return (Lagging if parameters.lags else cls)(parameters)

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """Return the state after one midpoint (second-order Runge-Kutta) step."""
        parameters = self.parameters
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
            speed_m_s = max(
                parameters.airspeed_min_m_s, min(parameters.airspeed_max_m_s, speed_m_s)
            )
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

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Return the motion by the rates of the loops."""
        state = with_speed_kind(state, targets.speed.kind, wind_m_s)
        rates = RATES[self.parameters.kind](
            self.parameters, targets, state.direction_rad, state.speed_m_s, wind_m_s
        )
        north_m_s, east_m_s = rates.north_m_s, rates.east_m_s
        air_north_m_s, air_east_m_s = north_m_s - wind_m_s[0], east_m_s - wind_m_s[1]
        ground_speed_m_s = math.hypot(north_m_s, east_m_s)
        airspeed_m_s = math.hypot(air_north_m_s, air_east_m_s)
        heading_rad = math.atan2(air_east_m_s, air_north_m_s)
        turn_rate_rad_s = rates.turn_rate_rad_s
        if self.parameters.kind == "course-hold":
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


@plant("npfg")
@plant("bank")
class Lagging(AirPlant):
    """Plant whose roll and speed have states of their own.

    Its memory is the integral of the speed hold (of `px4` the acceleration), the slewed setpoint of `px4`,
    the airspeed to which `px4-untrimmed` has trimmed its throttle, and the delayed bank.
    """

    longest_step_s = MAX_LAGGING_STEP_S

    def first_memory(self, state: PlantState) -> tuple[float, ...]:
        """Return the memory that holds the present airspeed."""
        return (0.0, state.speed_m_s, state.speed_m_s, 0.0)

    def rates(self, targets: Targets, state: AirState) -> AirRates:
        """Return all rates at one moment."""
        parameters, delayed_bank_rate = self.parameters, 0.0
        if parameters.rolls:
            wanted_rad = wanted_bank_rad(
                parameters,
                targets.turn,
                course_rad=state.course_rad,
                heading_rad=state.heading_rad,
                airspeed_m_s=state.airspeed_m_s,
            )
            if parameters.roll_delay_s > 0.0:
                delayed_rad = state.memory[3]
                delayed_bank_rate = (wanted_rad - delayed_rad) / parameters.roll_delay_s
                wanted_rad = delayed_rad
            roll_rate = (wanted_rad - state.roll_rad) / parameters.roll_time_s
            coordinated = bank_limited_turn_rate_rad_s(state.roll_rad, state.airspeed_m_s)
            turn = parameters.turn_efficiency * coordinated
        else:
            roll_rate = 0.0
            turn = turn_rate_rad_s(
                parameters,
                targets.turn,
                course_rad=state.course_rad,
                heading_rad=state.heading_rad,
                speed_m_s=state.airspeed_m_s,
            )
        climb_m_s, speed_rates = 0.0, (0.0, 0.0, 0.0)
        if parameters.speed_response == "tecs":
            error_m_s = targets.speed.speed_m_s - state.airspeed_m_s
            limit = min(TECS_ACCELERATION_M_S2, targets.speed.max_acceleration_m_s2)
            acceleration = tecs_acceleration_m_s2(error_m_s, state.memory[0], limit)
            speed_rates = (tecs_integral_rate_m_s3(error_m_s, state.memory[0], limit), 0.0, 0.0)
            climb_m_s = -(TECS_HEIGHT_SHARE * state.airspeed_m_s * acceleration / GRAVITY_M_S2)
        elif parameters.slews:
            acceleration = state.memory[0]
            speed_rates = self._px4_speed_rates(targets.speed, state)
        else:
            acceleration = acceleration_m_s2(parameters, targets.speed, state.airspeed_m_s)
        return AirRates(
            turn_rate_rad_s=turn,
            acceleration_m_s2=acceleration,
            roll_rate_rad_s=roll_rate,
            climb_m_s=climb_m_s,
            memory=(*speed_rates, delayed_bank_rate),
        )

    def _px4_speed_rates(self, target: SpeedTarget, state: AirState) -> tuple[float, float, float]:
        """Return the rates of the acceleration, of the slewed setpoint and of the trimmed airspeed."""
        acceleration, reference_m_s, trim_m_s, _ = state.memory
        limit = min(PX4_SLEW_M_S2, target.max_acceleration_m_s2)
        reference_rate = clamped(PX4_REFERENCE_1_S * (target.speed_m_s - reference_m_s), limit)
        aimed_m_s, aimed_rate, trim_rate = reference_m_s, reference_rate, 0.0
        if not self.parameters.is_trimmed:
            untrimmed_m_s = reference_m_s - trim_m_s
            trim_rate = untrimmed_m_s / UNTRIMMED_S
            aimed_m_s = trim_m_s + UNTRIMMED_SHARE * untrimmed_m_s
            aimed_rate = trim_rate + UNTRIMMED_SHARE * (reference_rate - trim_rate)
        behind_m_s = aimed_m_s + PX4_LEAD_S * aimed_rate - state.airspeed_m_s
        jerk = PX4_FREQUENCY_RAD_S**2 * behind_m_s
        jerk -= 2.0 * PX4_DAMPING * PX4_FREQUENCY_RAD_S * acceleration
        return jerk, reference_rate, trim_rate
