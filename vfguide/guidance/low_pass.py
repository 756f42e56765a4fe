"""The first-order low-pass filter of whatever is smoothed and may lag."""

from vfguide.elementwise import Number


def low_pass(previous: Number, target: Number, period: float, time_constant: float) -> Number:
    """First-order low-pass filter, backward Euler."""
    return previous + (period / (time_constant + period)) * (target - previous)
