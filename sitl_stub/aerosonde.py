"""The Aerosonde's airframe: a small fixed wing whose coefficients are published.

Source: Beard and McLain, Small Unmanned Aircraft (Princeton University Press, 2012), appendix E and chapter
4, with the coefficients of the authors' later supplement. Body axes: forward, right, down; angles in rad.
"""

import math

MASS_KG = 11.0
JX, JY, JZ, JXZ = 0.8244, 1.135, 1.759, 0.1204
"""Moments and product of inertia, kg m²."""

WING_M2, SPAN_M, CHORD_M = 0.55, 2.8956, 0.18994
PROPELLER_M2, MOTOR_M_S = 0.2027, 80.0
"""Disc of the propeller, and the speed of its air at full throttle in still air; its C_prop is 1."""

AIR_KG_M3 = 1.2682
OSWALD = 0.9
INDUCED = 1.0 / (math.pi * OSWALD * SPAN_M * SPAN_M / WING_M2)
"""Induced drag for the square of the lift."""

STALL_RAD, STALL_SHARPNESS = 0.4712, 50.0
"""alpha0 and M of the blend into a flat plate."""

LIFT_0, LIFT_ALPHA, LIFT_Q, LIFT_ELEVATOR = 0.23, 5.61, 7.95, 0.13
DRAG_PARASITIC, DRAG_ELEVATOR = 0.043, 0.0135
PITCH_0, PITCH_ALPHA, PITCH_Q, PITCH_ELEVATOR = 0.0135, -2.74, -38.21, -0.99
SIDE_BETA, SIDE_AILERON, SIDE_RUDDER = -0.98, 0.075, 0.19
ROLL_BETA, ROLL_P, ROLL_R, ROLL_AILERON, ROLL_RUDDER = -0.13, -0.51, 0.25, 0.17, 0.0024
YAW_BETA, YAW_P, YAW_R, YAW_AILERON, YAW_RUDDER = 0.073, -0.069, -0.095, -0.011, -0.069


def lift(alpha_rad: float) -> float:
    """C_L of the wing alone, with a stall: the blend of chapter 4, (4.9)."""
    linear = LIFT_0 + LIFT_ALPHA * alpha_rad
    # Beyond any angle of attack that is flown the exponentials would only overflow.
    bounded = min(max(alpha_rad, -1.5), 1.5)
    before = math.exp(-STALL_SHARPNESS * (bounded - STALL_RAD))
    behind = math.exp(STALL_SHARPNESS * (bounded + STALL_RAD))
    plate_share = (1.0 + before + behind) / ((1.0 + before) * (1.0 + behind))
    sine = math.sin(bounded)
    plate = math.copysign(2.0 * sine * sine * math.cos(bounded), bounded)
    return (1.0 - plate_share) * linear + plate_share * plate


def thrust_n(throttle: float, airspeed_m_s: float) -> float:
    """Thrust of the propeller, (4.18): negative where it is slower than the air."""
    exit_m_s = MOTOR_M_S * throttle
    return 0.5 * AIR_KG_M3 * PROPELLER_M2 * (exit_m_s**2 - airspeed_m_s**2)


def throttle_for(wanted_n: float, airspeed_m_s: float) -> float:
    """Throttle, 0 to 1, of a thrust."""
    exit_squared = wanted_n / (0.5 * AIR_KG_M3 * PROPELLER_M2) + airspeed_m_s**2
    return min(math.sqrt(max(exit_squared, 0.0)) / MOTOR_M_S, 1.0)
