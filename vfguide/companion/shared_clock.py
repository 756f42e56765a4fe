"""The clock that a formation shares: its leader's, which every follower knows by comparison with its own."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedClock:
    """From one's own clock to the formation's and back."""

    to_own: Callable[[float], float] = float
    """A time of the shared clock on one's own, s; NaN while not known."""
    from_own: Callable[[float], float] = float
    """A time of one's own clock on the shared one, s; NaN while not known."""


SAME_CLOCK = SharedClock()
"""Where all companions read one clock."""
