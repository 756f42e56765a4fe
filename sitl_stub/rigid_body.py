"""The Aerosonde as a rigid body with six degrees of freedom, over a flat earth.

Source: Beard and McLain, Small Unmanned Aircraft (Princeton University Press, 2012), (3.14) to (3.17),
chapter 4 and appendix E, with the coefficients of the authors' later supplement. Body axes: forward, right,
down; angles in rad.
"""

import math
from typing import NamedTuple

from sitl_stub.loops import GRAVITY_M_S2

MASS_KG = 11.0
JX, JY, JZ, JXZ = 0.8244, 1.135, 1.759, 0.1204
"""Moments and product of inertia, kg m²."""

WING_M2, SPAN_M, CHORD_M = 0.55, 2.8956, 0.18994
PROPELLER_M2, MOTOR_M_S = 0.2027, 80.0
"""Propeller disc area, and exit speed at full throttle in still air; C_prop is 1."""

AIR_KG_M3 = 1.2682
OSWALD = 0.9
INDUCED = 1.0 / (math.pi * OSWALD * SPAN_M * SPAN_M / WING_M2)
"""Induced drag coefficient per square of the lift coefficient."""

STALL_RAD, STALL_SHARPNESS = 0.4712, 50.0
"""alpha0 and M of the blend into a flat plate."""

LIFT_0, LIFT_ALPHA, LIFT_Q, LIFT_ELEVATOR = 0.23, 5.61, 7.95, 0.13
DRAG_PARASITIC, DRAG_ELEVATOR = 0.043, 0.0135
PITCH_0, PITCH_ALPHA, PITCH_Q, PITCH_ELEVATOR = 0.0135, -2.74, -38.21, -0.99
SIDE_BETA, SIDE_AILERON, SIDE_RUDDER = -0.98, 0.075, 0.19
ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER = -0.13, -0.51, 0.25, 0.17, 0.0024
YAW_BETA, YAW_P, YAW_R, YAW_AILERON, YAW_RUDDER = 0.073, -0.069, -0.095, -0.011, -0.069


def lift(alpha_rad: float) -> float:
    """Return the wing's C_L with a stall: the blend of chapter 4, (4.9)."""
    linear = LIFT_0 + LIFT_ALPHA * alpha_rad
    # Keeps the exponentials from overflowing, at angles of attack that are never flown.
    bounded = min(max(alpha_rad, -1.5), 1.5)
    before = math.exp(-STALL_SHARPNESS * (bounded - STALL_RAD))
    behind = math.exp(STALL_SHARPNESS * (bounded + STALL_RAD))
    plate_share = (1.0 + before + behind) / ((1.0 + before) * (1.0 + behind))
    sine = math.sin(bounded)
    plate = math.copysign(2.0 * sine * sine * math.cos(bounded), bounded)
    return (1.0 - plate_share) * linear + plate_share * plate


def thrust_n(throttle: float, airspeed_m_s: float) -> float:
    """Return the propeller's thrust, (4.18): negative where the exit speed is below the airspeed."""
    exit_m_s = MOTOR_M_S * throttle
    return 0.5 * AIR_KG_M3 * PROPELLER_M2 * (exit_m_s**2 - airspeed_m_s**2)


def throttle_for(wanted_n: float, airspeed_m_s: float) -> float:
    """Return the throttle, 0 to 1, of a thrust."""
    exit_squared = wanted_n / (0.5 * AIR_KG_M3 * PROPELLER_M2) + airspeed_m_s**2
    return min(math.sqrt(max(exit_squared, 0.0)) / MOTOR_M_S, 1.0)


GAMMA = JX * JZ - JXZ**2


class Body(NamedTuple):
    """Ground velocity and rotation rates in body axes (forward, right, down), attitude, and loop states."""

    u_m_s: float
    v_m_s: float
    w_m_s: float
    p_rad_s: float
    q_rad_s: float
    r_rad_s: float
    bank_rad: float
    """phi."""
    pitch_rad: float
    """theta."""
    heading_rad: float
    """psi, not wrapped."""
    thrust_n: float
    slow_airspeed_m_s: float
    """Airspeed of the energy loops, filtered."""
    energy_integral: float
    """Integral of the total-energy loop, as a fraction of the weight."""
    balance_integral_rad: float
    """Integral of the loop that distributes energy between height and speed."""


class Surfaces(NamedTuple):
    """Deflections, rad."""

    aileron: float
    elevator: float
    rudder: float


class AirFlow(NamedTuple):
    """Airspeed V_a, angle of attack and sideslip."""

    airspeed_m_s: float
    alpha_rad: float
    beta_rad: float


Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


def body_to_ground(body: Body) -> Matrix:
    """Return the rotation from body axes to north, east, down."""
    sin_bank, cos_bank = math.sin(body.bank_rad), math.cos(body.bank_rad)
    sin_pitch, cos_pitch = math.sin(body.pitch_rad), math.cos(body.pitch_rad)
    sin_heading, cos_heading = math.sin(body.heading_rad), math.cos(body.heading_rad)
    return (
        (
            cos_pitch * cos_heading,
            sin_bank * sin_pitch * cos_heading - cos_bank * sin_heading,
            cos_bank * sin_pitch * cos_heading + sin_bank * sin_heading,
        ),
        (
            cos_pitch * sin_heading,
            sin_bank * sin_pitch * sin_heading + cos_bank * cos_heading,
            cos_bank * sin_pitch * sin_heading - sin_bank * cos_heading,
        ),
        (-sin_pitch, sin_bank * cos_pitch, cos_bank * cos_pitch),
    )


def velocity_ned_m_s(body: Body, rotation: Matrix) -> tuple[float, float, float]:
    """Return the ground velocity: north, east, down."""
    u, v, w = body.u_m_s, body.v_m_s, body.w_m_s
    north, east, down = (row[0] * u + row[1] * v + row[2] * w for row in rotation)
    return north, east, down


def air_flow(body: Body, rotation: Matrix, wind_m_s: tuple[float, float]) -> AirFlow:
    """Return the air flow in a horizontal wind (north, east)."""
    north, east = wind_m_s
    first, second, _ = rotation
    u = body.u_m_s - (first[0] * north + second[0] * east)
    v = body.v_m_s - (first[1] * north + second[1] * east)
    w = body.w_m_s - (first[2] * north + second[2] * east)
    airspeed = max(math.sqrt(u * u + v * v + w * w), 1.0)
    return AirFlow(airspeed, math.atan2(w, u), math.asin(min(max(v / airspeed, -1.0), 1.0)))


def accelerations(
    body: Body, flow: AirFlow, surfaces: Surfaces
) -> tuple[float, float, float, float, float, float]:
    """Return the rates of (u, v, w) in m/s² and of (p, q, r) in rad/s²."""
    airspeed, alpha, beta = flow
    pressure_n = 0.5 * AIR_KG_M3 * airspeed * airspeed * WING_M2
    p, q, r = body.p_rad_s, body.q_rad_s, body.r_rad_s
    half_chord_s, half_span_s = CHORD_M / (2.0 * airspeed), SPAN_M / (2.0 * airspeed)
    wing = lift(alpha)
    lift_n = pressure_n * (wing + LIFT_Q * half_chord_s * q + LIFT_ELEVATOR * surfaces.elevator)
    drag_n = pressure_n * (
        DRAG_PARASITIC + INDUCED * wing * wing + DRAG_ELEVATOR * abs(surfaces.elevator)
    )
    side_n = pressure_n * (
        SIDE_BETA * beta + SIDE_AILERON * surfaces.aileron + SIDE_RUDDER * surfaces.rudder
    )
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    sin_pitch, cos_pitch = math.sin(body.pitch_rad), math.cos(body.pitch_rad)
    mass = MASS_KG
    forward = (lift_n * sin_alpha - drag_n * cos_alpha + body.thrust_n) / mass
    downward = (-lift_n * cos_alpha - drag_n * sin_alpha) / mass
    gravity = GRAVITY_M_S2
    u_rate = r * body.v_m_s - q * body.w_m_s + forward - gravity * sin_pitch
    v_rate = p * body.w_m_s - r * body.u_m_s + side_n / mass
    v_rate += gravity * cos_pitch * math.sin(body.bank_rad)
    w_rate = q * body.u_m_s - p * body.v_m_s + downward
    w_rate += gravity * cos_pitch * math.cos(body.bank_rad)
    rolling = (
        pressure_n
        * SPAN_M
        * (
            ROLL_BETA * beta
            + half_span_s * (ROLL_P * p + ROLL_R * r)
            + ROLL_AILERON * surfaces.aileron
            + ROLL_RUDDER * surfaces.rudder
        )
    )
    pitching = (
        pressure_n
        * CHORD_M
        * (
            PITCH_0
            + PITCH_ALPHA * alpha
            + PITCH_Q * half_chord_s * q
            + PITCH_ELEVATOR * surfaces.elevator
        )
    )
    yawing = (
        pressure_n
        * SPAN_M
        * (
            YAW_BETA * beta
            + half_span_s * (YAW_P * p + YAW_R * r)
            + YAW_AILERON * surfaces.aileron
            + YAW_RUDDER * surfaces.rudder
        )
    )
    jx, jy, jz, jxz = JX, JY, JZ, JXZ
    # J domega/dt = M - omega x J omega, its first and third rows solved for the rates.
    about_x = rolling + jxz * p * q + (jy - jz) * q * r
    about_z = yawing - jxz * q * r + (jx - jy) * p * q
    p_rate = (jz * about_x + jxz * about_z) / GAMMA
    q_rate = (pitching + (jz - jx) * p * r - jxz * (p * p - r * r)) / jy
    r_rate = (jxz * about_x + jx * about_z) / GAMMA
    return u_rate, v_rate, w_rate, p_rate, q_rate, r_rate


def attitude_rates(body: Body) -> tuple[float, float, float]:
    """Return the rates of bank, pitch and heading, rad/s."""
    sin_bank, cos_bank = math.sin(body.bank_rad), math.cos(body.bank_rad)
    # Avoids the singularity of a vertical pitch, which is never flown.
    cos_pitch = max(math.cos(body.pitch_rad), 0.1)
    yawing = body.q_rad_s * sin_bank + body.r_rad_s * cos_bank
    heading_rate = yawing / cos_pitch
    return (
        body.p_rad_s + heading_rate * math.sin(body.pitch_rad),
        body.q_rad_s * cos_bank - body.r_rad_s * sin_bank,
        heading_rate,
    )
