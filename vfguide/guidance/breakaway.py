"""How a formation without a leader comes apart: everyone turns away to the side of its own slot.

Vehicles on one side keep their distances: they turn by the same angle and fly at the same airspeed. Those
on the leader's track go straight on between the two groups.
"""

import math

from vfguide.elementwise import Number, like, where
from vfguide.guidance.formation import Slot

BREAKAWAY_ANGLE = math.radians(60.0)
"""Turn away from the leader's last course, rad."""

ON_TRACK_M = 5.0
"""A slot nearer than this to the leader's track is on neither side."""


def breakaway_course(leader_course: Number, slot: Slot[Number]) -> Number:
    """Course (rad) that leads a follower away from the others.

    Args:
        leader_course: the leader's last course, rad.
        slot: the follower's place in the formation.
    """
    turn = where(
        slot.right > 0.0, like(BREAKAWAY_ANGLE, slot.right), like(-BREAKAWAY_ANGLE, slot.right)
    )
    on_track = abs(slot.right) < ON_TRACK_M
    return leader_course + where(on_track, like(0.0, slot.right), turn)
