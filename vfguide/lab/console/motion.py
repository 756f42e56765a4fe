"""A vehicle's newest state, carried on along its turn to the moment that is shown."""

import cmath
from dataclasses import dataclass

from vfguide.link.codec import LeaderMessage

CARRIED_S = 2.0
"""For so long a place is carried on along its turn; no slot is reckoned by an older one."""

CLIMB_S = 0.5
"""Over so long climb rates are averaged."""

STEEPEST_M_S = 20.0
"""More is no climb, but a height that was set right."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateReport:
    """The newest state of a vehicle."""

    message: LeaderMessage
    """As it came."""
    place: complex
    """North and east as real and imaginary part, m."""
    climb: float
    """m/s; the state does not say it."""
    received_s: float
    """When it came."""


def climb_between(before: StateReport | None, message: LeaderMessage) -> float:
    """How fast a vehicle climbs, m/s, by its last states."""
    if before is None:
        return 0.0
    passed_s = message.time_s - before.message.time_s
    if not 0.0 < passed_s < CARRIED_S:
        return 0.0
    newest = (message.altitude_amsl - before.message.altitude_amsl) / passed_s
    newest = min(max(newest, -STEEPEST_M_S), STEEPEST_M_S)
    return before.climb + min(passed_s / CLIMB_S, 1.0) * (newest - before.climb)


def carry(heard: StateReport, seconds: float) -> tuple[complex, complex]:
    """(place in m, velocity in m/s) some seconds after a state, along the turn that it flew."""
    message = heard.message
    half_turn = cmath.rect(1.0, 0.5 * message.turn_rate * seconds)
    velocity = cmath.rect(message.ground_speed, message.course) * half_turn
    return heard.place + velocity * seconds, velocity * half_turn
