"""The motion of a rigid fixed wing with six degrees of freedom, over a flat earth.

Source: Beard and McLain, Small Unmanned Aircraft, (3.14) to (3.17) and chapter 4; the airframe's figures are
`aerosonde`'s.
"""

import math
from typing import NamedTuple

import sitl_stub.aerosonde as craft
from sitl_stub.loops import GRAVITY_M_S2

GAMMA = craft.JX * craft.JZ - craft.JXZ**2


class Body(NamedTuple):
    """Motion over the ground in body axes, attitude, and what the autopilot's loops remember."""

    u_m_s: float
    """Velocity over ground: forward."""
    v_m_s: float
    """Right."""
    w_m_s: float
    """Down."""
    p_rad_s: float
    """Roll rate."""
    q_rad_s: float
    """Pitch rate."""
    r_rad_s: float
    """Yaw rate."""
    bank_rad: float
    """phi."""
    pitch_rad: float
    """theta."""
    heading_rad: float
    """psi, not wrapped."""
    thrust_n: float
    """Thrust of the propeller now."""
    slow_airspeed_m_s: float
    """Airspeed as the energy loops see it."""
    energy_integral: float
    """Integral of the total energy's loop, in parts of the weight."""
    balance_integral_rad: float
    """Integral of the loop that shares energy between height and speed."""


class Surfaces(NamedTuple):
    """Deflections, rad."""

    aileron: float
    elevator: float
    rudder: float


class AirFlow(NamedTuple):
    """The air as it meets the aircraft."""

    airspeed_m_s: float
    """V_a."""
    alpha_rad: float
    """Angle of attack."""
    beta_rad: float
    """Sideslip."""


Matrix = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]


def body_to_ground(body: Body) -> Matrix:
    """Rotation from body axes to north, east, down."""
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
    """Velocity over ground: north, east, down."""
    u, v, w = body.u_m_s, body.v_m_s, body.w_m_s
    north, east, down = (row[0] * u + row[1] * v + row[2] * w for row in rotation)
    return north, east, down


def air_flow(body: Body, rotation: Matrix, wind_m_s: tuple[float, float]) -> AirFlow:
    """The air's flow in a horizontal wind (north, east)."""
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
    """Rates of (u, v, w) in m/s² and of (p, q, r) in rad/s²."""
    airspeed, alpha, beta = flow
    pressure_n = 0.5 * craft.AIR_KG_M3 * airspeed * airspeed * craft.WING_M2
    p, q, r = body.p_rad_s, body.q_rad_s, body.r_rad_s
    half_chord_s, half_span_s = craft.CHORD_M / (2.0 * airspeed), craft.SPAN_M / (2.0 * airspeed)
    wing = craft.lift(alpha)
    lift_n = pressure_n * (
        wing + craft.LIFT_Q * half_chord_s * q + craft.LIFT_ELEVATOR * surfaces.elevator
    )
    drag_n = pressure_n * (
        craft.DRAG_PARASITIC
        + craft.INDUCED * wing * wing
        + craft.DRAG_ELEVATOR * abs(surfaces.elevator)
    )
    side_n = pressure_n * (
        craft.SIDE_BETA * beta
        + craft.SIDE_AILERON * surfaces.aileron
        + craft.SIDE_RUDDER * surfaces.rudder
    )
    sin_alpha, cos_alpha = math.sin(alpha), math.cos(alpha)
    sin_pitch, cos_pitch = math.sin(body.pitch_rad), math.cos(body.pitch_rad)
    mass = craft.MASS_KG
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
        * craft.SPAN_M
        * (
            craft.ROLL_BETA * beta
            + half_span_s * (craft.ROLL_P * p + craft.ROLL_R * r)
            + craft.ROLL_AILERON * surfaces.aileron
            + craft.ROLL_RUDDER * surfaces.rudder
        )
    )
    pitching = (
        pressure_n
        * craft.CHORD_M
        * (
            craft.PITCH_0
            + craft.PITCH_ALPHA * alpha
            + craft.PITCH_Q * half_chord_s * q
            + craft.PITCH_ELEVATOR * surfaces.elevator
        )
    )
    yawing = (
        pressure_n
        * craft.SPAN_M
        * (
            craft.YAW_BETA * beta
            + half_span_s * (craft.YAW_P * p + craft.YAW_R * r)
            + craft.YAW_AILERON * surfaces.aileron
            + craft.YAW_RUDDER * surfaces.rudder
        )
    )
    jx, jy, jz, jxz = craft.JX, craft.JY, craft.JZ, craft.JXZ
    # J domega/dt = M - omega x J omega, its first and third rows solved for the rates.
    about_x = rolling + jxz * p * q + (jy - jz) * q * r
    about_z = yawing - jxz * q * r + (jx - jy) * p * q
    p_rate = (jz * about_x + jxz * about_z) / GAMMA
    q_rate = (pitching + (jz - jx) * p * r - jxz * (p * p - r * r)) / jy
    r_rate = (jxz * about_x + jx * about_z) / GAMMA
    return u_rate, v_rate, w_rate, p_rate, q_rate, r_rate


def attitude_rates(body: Body) -> tuple[float, float, float]:
    """Rates of bank, pitch and heading, rad/s."""
    sin_bank, cos_bank = math.sin(body.bank_rad), math.cos(body.bank_rad)
    # Never upright: pitch is held far from it.
    cos_pitch = max(math.cos(body.pitch_rad), 0.1)
    yawing = body.q_rad_s * sin_bank + body.r_rad_s * cos_bank
    heading_rate = yawing / cos_pitch
    return (
        body.p_rad_s + heading_rate * math.sin(body.pitch_rad),
        body.q_rad_s * cos_bank - body.r_rad_s * sin_bank,
        heading_rate,
    )
