"""Saturation, and what a fixed-wing aircraft cannot exceed."""

import math

from vfguide.elementwise import Number, clip

GRAVITY = 9.80665
"""Standard gravity, m/s²."""


def saturation(value: Number) -> Number:
    """sat(.) of the sliding-mode laws: the value itself inside [-1, 1], its sign outside."""
    return clip(value, -1.0, 1.0)


def bank_limited_turn_rate(max_bank: float, speed: Number) -> Number:
    """Greatest turn rate (rad/s) of a coordinated turn: g tan(phi_max) / V.

    Args:
        max_bank: bank limit phi_max, rad, in (0, pi/2).
        speed: speed V through the medium that is turned in, m/s, positive.
    """
    return GRAVITY * math.tan(max_bank) / speed
