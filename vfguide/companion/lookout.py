"""Who has to be looked at, and when again: a follower's cost is not to grow with the number of the others.

A barrier binds where the closing speed c that is asked for exceeds gamma (d - keep): never beyond

    reach = keep + c / gamma        c <= |wish| + |v_slot - v_other|

with the wish for the velocity relative to the slot's, which the field bounds by the distance from the slot.
Whoever is farther away cannot come within that reach, whatever both do, before some time has passed. Where
nobody is within it, no barrier takes anything off; where somebody is, what is taken off may turn the wish
toward another, and all who are within a longer reach are looked at.
"""

import math
from dataclasses import dataclass

from vfguide.guidance.formation import FieldGains, SlotMotion, arc_tangent_field
from vfguide.guidance.separation import CLOSING_RATE, Obstacle
from vfguide.guidance.wind_triangle import compose
from vfguide.state import VehicleState

TURNED_M_S = 3.0
"""By how much a wish for a closing speed may grow, turned by what another barrier takes off."""

HARDEST_M_S2 = 21.0
"""Of two that turn at 45 degrees of bank and brake, one away from the other. While a leader rolls into a
turn, a slot far out may be swung harder, one's own or theirs: then one looks later, by part of a second."""

LONGEST_S = 2.0
"""Nobody is left unlooked at for longer."""

ROOM_M = 0.5
"""Farther than twice what it foresees and this no follower comes without looking round again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standpoint:
    """A follower, as far as it matters to whom it has to look at."""

    time_s: float
    """On its own clock."""
    north: float
    """m."""
    east: float
    """m."""
    slot_north: float
    """Velocity of its slot, m/s."""
    slot_east: float
    """Velocity of its slot, m/s."""
    off_slot: float
    """Speed relative to the slot's, m/s."""
    distance: float
    """From its slot, m."""
    aims_off: float = 0.0
    """How far beside its slot it aims, m."""
    avoiding: bool
    """Whether it keeps clear of somebody already, and may wish for anything."""

    @property
    def foreseen(self) -> float:
        """Distance (m) from where it aims, which bounds what it wishes for now."""
        return math.inf if self.avoiding else self.distance + self.aims_off


def standpoint_of(
    state: VehicleState[float],
    motion: SlotMotion[float],
    distance: float,
    *,
    aims_off: float,
    avoiding: bool,
) -> Standpoint:
    """Of a follower whose slot moves like this, at a distance (m) from it, aiming somewhat (m) beside it."""
    slot_north, slot_east = compose(motion.speed, 0.0, motion.course)
    north, east = compose(state.ground_speed, 0.0, state.course)
    return Standpoint(
        time_s=state.time_s,
        north=state.north,
        east=state.east,
        slot_north=slot_north,
        slot_east=slot_east,
        off_slot=math.hypot(north - slot_north, east - slot_east),
        distance=distance,
        aims_off=aims_off,
        avoiding=avoiding,
    )


def greatest_wish(distance: float, slot_speed: float, gains: FieldGains) -> float:
    """Greatest speed (m/s) relative to the slot that a field asks for so far (m) from one so fast (m/s)."""
    turn, _ = arc_tangent_field(distance, 0.0, gains.k_y, gains.chi_inf)
    push, _ = arc_tangent_field(distance, 0.0, gains.k_x, gains.v_inf)
    # The chord of the turn, at the greatest speed, and what is faster.
    return push + 2.0 * (slot_speed + push) * math.sin(0.5 * turn)


def calm_for(here: Standpoint, obstacle: Obstacle[float], wish: float) -> float:
    """For how long (s) the barrier of an obstacle cannot bind; 0 where it may now.

    Args:
        here: the follower.
        obstacle: somebody else, at the same time.
        wish: greatest speed relative to the slot that may be asked for, m/s.
    """
    return calm_within(*room_to(here, obstacle), wish)


def room_to(here: Standpoint, obstacle: Obstacle[float]) -> tuple[float, float]:
    """Distance (m) left beyond the reach of one that wishes for nothing, and how fast that gets less, m/s.

    In a time t the two come nearer by (|v_slot - v_other| + |v - v_slot|) t + a t² / 2 at most, and the reach
    grows by a t / gamma, a being the hardest that they can do.
    """
    distance = math.hypot(obstacle.north - here.north, obstacle.east - here.east)
    between = math.hypot(
        obstacle.velocity_north - here.slot_north, obstacle.velocity_east - here.slot_east
    )
    room = distance - obstacle.keep - between / CLOSING_RATE
    return room, HARDEST_M_S2 / CLOSING_RATE + between + here.off_slot


def calm_within(room: float, closing: float, wish: float) -> float:
    """How long (s) it takes to use up what a wish (m/s) leaves of such room (m): a quadratic."""
    room -= wish / CLOSING_RATE
    if room <= 0.0:
        return 0.0
    # The root of a t² / 2 + closing t = room, in the form that does not cancel.
    calm = 2.0 * room / (closing + math.sqrt(closing * closing + 2.0 * HARDEST_M_S2 * room))
    return min(calm, LONGEST_S)
