"""The plant `six-dof`: the Aerosonde with attitude loops and a total-energy loop as in autopilots.

The course error sets the bank as in ArduPlane's guided mode. The ailerons hold it, and the rudder damps the
yaw toward a coordinated turn. Airspeed and height are controlled by energy: the thrust sets the total, the
pitch the distribution (Lambregts, "Vertical flight path and speed control autopilot design using total
energy principles", AIAA 83-2239). The equations are the project's own, not JSBSim's; docs/emulator.md tells
why.
"""

import math
from typing import NamedTuple

import sitl_stub.rigid_body as craft
from sitl_stub.air import Wind
from sitl_stub.geometry import displace, wrap_to_two_pi
from sitl_stub.loops import (
    GRAVITY_M_S2,
    PlantParameters,
    Targets,
    acceleration_m_s2,
    clamped,
    wanted_bank_rad,
    wanted_climb_m_s,
)
from sitl_stub.plant import Motion, Plant, PlantState, plant
from sitl_stub.rigid_body import (
    AirFlow,
    Body,
    Surfaces,
    accelerations,
    air_flow,
    attitude_rates,
    body_to_ground,
    velocity_ned_m_s,
)

MAX_SIX_DOF_STEP_S = 0.0125
"""Longest step: a fifth of the roll's own time constant at 32 m/s; a test measures the loss of accuracy."""

ROLL_P, ROLL_D = 0.6, 0.0
PITCH_P, PITCH_D = 4.0, 0.5
YAW_D = 0.5
"""Deflections in rad for each rad and rad/s. The airframe itself damps the roll."""

GREATEST_DEFLECTION_RAD = 0.5

GREATEST_PITCH_RAD = 0.4

THRUST_S = 0.2
"""Time constant of motor and propeller."""

AIRSPEED_S = 1.0
"""Time constant of the complementary filter of the loops' airspeed, as autopilots have it. The filter blends
accelerometers and measured airspeed, so that a gust does not change the speed at once."""

WEIGHT_N = craft.MASS_KG * GRAVITY_M_S2

CRUISE_DRAG, TURN_DRAG = 0.07, 0.05
"""Drag as a fraction of the weight: in cruise, and its growth per (n² - 1) at load factor n."""

CRUISE_PITCH_RAD = 0.07

ENERGY_P, ENERGY_I = 0.6, 0.3
"""Gains from the missing rate of energy to thrust as a fraction of the weight; the second per second."""

BALANCE_P, BALANCE_I = 0.6, 0.5
"""Gains from the missing balance to pitch, rad; the second per second."""

GREATEST_INTEGRAL = 0.3


class BodyRates(NamedTuple):
    """Rates of the body's fields, ground velocity (down positive) and airspeed V_a at one moment."""

    body: Body
    north_m_s: float
    east_m_s: float
    down_m_s: float
    airspeed_m_s: float


def body_of(state: PlantState, wind_m_s: tuple[float, float]) -> Body:
    """Return the body of a state, or one in trimmed level or climbing flight where it has none yet."""
    if state.body is not None:
        return state.body
    airspeed = state.speed_m_s
    wanted_lift = WEIGHT_N / (0.5 * craft.AIR_KG_M3 * airspeed**2 * craft.WING_M2)
    alpha = min((wanted_lift - craft.LIFT_0) / craft.LIFT_ALPHA, 0.3)
    # Gravity along the path needs thrust, and the body is pitched up by the climb angle.
    climb = math.asin(min(max(state.climb_m_s / airspeed, -0.5), 0.5))
    level = Body(
        *(0.0, 0.0, 0.0),
        *(0.0, 0.0, 0.0),
        bank_rad=0.0,
        pitch_rad=alpha + climb,
        heading_rad=state.direction_rad,
        thrust_n=max(CRUISE_DRAG + math.sin(climb), 0.0) * WEIGHT_N,
        slow_airspeed_m_s=airspeed,
        energy_integral=0.0,
        balance_integral_rad=alpha - CRUISE_PITCH_RAD,
    )
    first, second, _ = body_to_ground(level)
    north, east = wind_m_s
    return level._replace(
        u_m_s=airspeed * math.cos(alpha) + first[0] * north + second[0] * east,
        v_m_s=first[1] * north + second[1] * east,
        w_m_s=airspeed * math.sin(alpha) + first[2] * north + second[2] * east,
    )


def six_dof_rates(
    parameters: PlantParameters,
    targets: Targets,
    body: Body,
    altitude_amsl_m: float,
    wind_m_s: tuple[float, float],
) -> BodyRates:
    """Return all rates at one moment."""
    rotation = body_to_ground(body)
    flow = air_flow(body, rotation, wind_m_s)
    north, east, down = velocity_ned_m_s(body, rotation)
    bank = wanted_bank_rad(
        parameters,
        targets.turn,
        course_rad=math.atan2(east, north),
        heading_rad=body.heading_rad,
        airspeed_m_s=flow.airspeed_m_s,
    )
    rate = path_acceleration_m_s2(body, flow, down / flow.airspeed_m_s)
    slow_rate = rate + (flow.airspeed_m_s - body.slow_airspeed_m_s) / AIRSPEED_S
    speed_rate = acceleration_m_s2(parameters, targets.speed, body.slow_airspeed_m_s) / GRAVITY_M_S2
    path = wanted_climb_m_s(parameters, targets.height, altitude_amsl_m) / flow.airspeed_m_s
    speed_missing = speed_rate - rate / GRAVITY_M_S2
    path_missing = path + down / flow.airspeed_m_s
    energy_missing, balance_missing = path_missing + speed_missing, path_missing - speed_missing
    thrust = thrust_wanted_n(body, path + speed_rate, energy_missing, flow)
    pitch = pitch_wanted_rad(body, path - speed_rate, balance_missing)
    acceleration = accelerations(body, flow, surfaces_of(body, bank, pitch, flow))
    return BodyRates(
        Body(
            *acceleration,
            *attitude_rates(body),
            (thrust - body.thrust_n) / THRUST_S,
            slow_rate,
            integral_rate(body.energy_integral, ENERGY_I * energy_missing),
            integral_rate(body.balance_integral_rad, BALANCE_I * balance_missing),
        ),
        north,
        east,
        down,
        flow.airspeed_m_s,
    )


def path_acceleration_m_s2(body: Body, flow: AirFlow, sinking: float) -> float:
    """Return the acceleration along the path from thrust, drag and slope, without the effect of gusts."""
    pressure_n = 0.5 * craft.AIR_KG_M3 * flow.airspeed_m_s**2 * craft.WING_M2
    drag_n = pressure_n * (craft.DRAG_PARASITIC + craft.INDUCED * craft.lift(flow.alpha_rad) ** 2)
    forward_n = body.thrust_n * math.cos(flow.alpha_rad) - drag_n
    return forward_n / craft.MASS_KG + GRAVITY_M_S2 * sinking


def integral_rate(integral: float, rate: float) -> float:
    """Return the rate of an integral, or 0 where the rate would drive it further beyond its limit."""
    return 0.0 if abs(integral) >= GREATEST_INTEGRAL and integral * rate > 0.0 else rate


def thrust_wanted_n(body: Body, wanted: float, missing: float, flow: AirFlow) -> float:
    """Return the thrust for a rate of the total energy (per weight and airspeed)."""
    # No autopilot holds a bank beyond 60 degrees.
    load_factor = 1.0 / max(math.cos(body.bank_rad), 0.5)
    share = CRUISE_DRAG + TURN_DRAG * (load_factor**2 - 1.0) + wanted
    share += ENERGY_P * missing + body.energy_integral
    throttle = craft.throttle_for(share * WEIGHT_N, flow.airspeed_m_s)
    return craft.thrust_n(throttle, flow.airspeed_m_s)


def pitch_wanted_rad(body: Body, wanted: float, missing: float) -> float:
    """Return the pitch for a distribution of energy; `wanted` counts half, as path and speed change alike."""
    pitch = CRUISE_PITCH_RAD + 0.5 * wanted + BALANCE_P * missing + body.balance_integral_rad
    return clamped(pitch, GREATEST_PITCH_RAD)


def surfaces_of(body: Body, bank_rad: float, pitch_rad: float, flow: AirFlow) -> Surfaces:
    """Return the deflections that the attitude loops set for a bank and pitch."""
    turning = GRAVITY_M_S2 / flow.airspeed_m_s * math.sin(body.bank_rad)
    turning *= math.cos(body.pitch_rad)
    # A turn needs a pitch rate.
    pitching = turning * math.tan(clamped(body.bank_rad, 1.0))
    aileron = ROLL_P * (bank_rad - body.bank_rad) - ROLL_D * body.p_rad_s
    elevator = PITCH_D * (body.q_rad_s - pitching) - PITCH_P * (pitch_rad - body.pitch_rad)
    rudder = YAW_D * (body.r_rad_s - turning)
    limit = GREATEST_DEFLECTION_RAD
    return Surfaces(clamped(aileron, limit), clamped(elevator, limit), clamped(rudder, limit))


def advanced(body: Body, rates: Body, span_s: float) -> Body:
    """Return the body after a span at constant rates."""
    return Body(*(value + span_s * rate for value, rate in zip(body, rates, strict=True)))


@plant("six-dof")
class SixDof(Plant):
    """The rigid body with its loops."""

    longest_step_s = MAX_SIX_DOF_STEP_S

    def step(
        self, targets: Targets, state: PlantState, wind: Wind, *, time_s: float, step_s: float
    ) -> PlantState:
        """Return the state after one midpoint (second-order Runge-Kutta) step."""
        half_s = 0.5 * step_s
        start_wind = wind.at(time_s)
        body, altitude = body_of(state, start_wind), state.altitude_amsl_m
        start = six_dof_rates(self.parameters, targets, body, altitude, start_wind)
        middle = six_dof_rates(
            self.parameters,
            targets,
            advanced(body, start.body, half_s),
            altitude - half_s * start.down_m_s,
            wind.at(time_s + half_s),
        )
        latitude, longitude = displace(
            state.latitude_rad,
            state.longitude_rad,
            altitude,
            north_m=step_s * middle.north_m_s,
            east_m=step_s * middle.east_m_s,
        )
        after = advanced(body, middle.body, step_s)
        return PlantState(
            wrap_to_two_pi(after.heading_rad),
            middle.airspeed_m_s,
            "airspeed",
            latitude,
            longitude,
            altitude - step_s * middle.down_m_s,
            after.bank_rad,
            body=after,
        )

    def motion(self, targets: Targets, state: PlantState, wind_m_s: tuple[float, float]) -> Motion:
        """Return the motion of the body."""
        del targets
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
