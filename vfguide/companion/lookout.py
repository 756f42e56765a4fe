"""Who has to be looked at, and when again: a follower's cost is not to grow with the number of the others.

A barrier binds where the closing speed c that is asked for exceeds gamma (d - keep): never beyond

    reach = keep + c / gamma        c <= |wish| + |v_slot - v_other|

with the wish for the velocity relative to the slot's, which the field bounds by the distance from the slot.
Whoever is farther away cannot come within that reach, whatever both do, before some time has passed.
"""

import math
from dataclasses import dataclass

from vfguide.guidance.formation import FieldGains, SlotMotion, arc_tangent_field
from vfguide.guidance.separation import CLOSING_RATE, Obstacle
from vfguide.guidance.wind_triangle import compose
from vfguide.state import VehicleState

UNSURE_M_S = 3.0
"""On top of what is known of closing speeds: what one barrier takes off may turn a wish toward the next."""

HURRY_M_S = 75.0
"""How fast at most distance and reach may meet, besides the speeds that are known now: two that turn and
brake as hard as they can, together at 15 m/s², let the reach grow by 15 / gamma = 38 m/s, and come nearer by
half of 15 m/s² t², which is 15 m/s over two seconds; as much again for what nobody thought of."""

LONGEST_S = 2.0
"""Nobody is left unlooked at for longer."""

ROOM_M = 1.0
"""Farther than twice its distance from the slot and this no follower comes without looking round again."""


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
    avoiding: bool
    """Whether it keeps clear of somebody already, and may wish for anything."""

    @property
    def foreseen(self) -> float:
        """Distance from the slot (m) that bounds what it wishes for now."""
        return math.inf if self.avoiding else self.distance


def standpoint_of(
    state: VehicleState[float], motion: SlotMotion[float], distance: float, *, avoiding: bool
) -> Standpoint:
    """Of a follower whose slot moves like this, at this distance (m) from it."""
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
    distance = math.hypot(obstacle.north - here.north, obstacle.east - here.east)
    between = math.hypot(
        obstacle.velocity_north - here.slot_north, obstacle.velocity_east - here.slot_east
    )
    reach = obstacle.keep + (wish + between + UNSURE_M_S) / CLOSING_RATE
    closing = HURRY_M_S + between + here.off_slot
    return min(max(distance - reach, 0.0) / closing, LONGEST_S)
