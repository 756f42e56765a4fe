"""The leader gives way: no slot may need an airspeed that its follower does not have."""

from collections.abc import Sequence
from dataclasses import dataclass

from vfguide.elementwise import Number, clip, greater_of, hypot
from vfguide.guidance.formation import Slot, slot_velocity
from vfguide.guidance.wind_triangle import compose
from vfguide.state import Airframe, VehicleState

MARGIN = 1.0
"""m/s that a follower keeps between what its slot needs and the ends of its airspeed range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotLimits:
    """A slot, and the airspeed range of the vehicle that holds it."""

    slot: Slot[float]
    """The slot."""
    airspeed_min: float
    """m/s."""
    airspeed_max: float
    """m/s."""


def slot_airspeed(state: VehicleState[Number], turn_rate: Number, slot: Slot[Number]) -> Number:
    """Airspeed (m/s) that holding a slot takes: |slot velocity - wind|, the leader turning at turn_rate."""
    along, right = slot_velocity(state.ground_speed, turn_rate, slot)
    north, east = compose(along, right, state.course)
    return hypot(north - state.wind_north, east - state.wind_east)


def airspeed_that_gives_way(
    cruise: float,
    state: VehicleState[Number],
    turn_rate: Number,
    followers: Sequence[SlotLimits],
    airframe: Airframe,
) -> Number:
    """The leader's airspeed (m/s): its cruise, moved by what the worst-off slots lack on either side.

    A slot's airspeed moves with the leader's nearly one to one, so the deficit that a slot would have at
    cruise is what the leader adds, and an excess is what it takes off.

    Args:
        cruise: airspeed of the mission, m/s.
        state: navigated state of the leader.
        turn_rate: of the path, rad/s.
        followers: slots and their vehicles' airspeed ranges.
        airframe: the leader's own.
    """
    deficit = state.airspeed * 0.0
    excess = state.airspeed * 0.0
    for follower in followers:
        still = state.airspeed * 0.0
        slot = Slot(
            forward=still + follower.slot.forward,
            right=still + follower.slot.right,
            forward_rate=follower.slot.forward_rate,
            right_rate=follower.slot.right_rate,
        )
        needed = slot_airspeed(state, turn_rate, slot) + (cruise - state.airspeed)
        deficit = greater_of(deficit, follower.airspeed_min + MARGIN - needed)
        excess = greater_of(excess, needed - (follower.airspeed_max - MARGIN))
    return clip(cruise + deficit - excess, airframe.airspeed_min, airframe.airspeed_max)
