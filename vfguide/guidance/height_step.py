"""Which height keeps a vehicle apart from all others, where no manoeuvre in the plane is enough.

The heights that it may go to are compared by the least distance in space that each leaves to any other
vehicle. Two that are as high and both step are told apart by a rule that both know: one of them goes over the
other. To go the other way gains nothing against a vehicle that steps by the same rule, and a height behind
another vehicle is reached only by passing that vehicle's own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

STEP_M = 20.0
"""Height that is climbed or descended where the plane is not enough."""

STEP_SHARE = 0.25
"""At most this of the height above the origin is descended."""

ENOUGH = 1.7
"""Least distances: more than this from all others makes no height better."""

BETTER = 0.25
"""Least distances that another height has to leave beyond the present one's to be gone to."""

CLEAR = 1.2
"""Least distances that a vehicle needs to go back to its own height: it may be nearer in its slot, hardly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Neighbour:
    """Another vehicle, or one possibility of what it does."""

    distance: float
    """In the plane, at the closest approach, m."""
    least: float
    """In the plane it is to be no less than this, m."""
    least_up: float
    """The height that is worth as much, m."""
    lowest: float
    """Height that it may have soon, m above the own guidance's."""
    highest: float
    """The same, m."""
    over: bool | None
    """Whether the own vehicle is above it, or is to go over it where they are as high; None: either way."""


def clearance(height: float, neighbours: Sequence[Neighbour]) -> float:
    """The least distance from any other vehicle that a height (m) leaves, in least distances."""
    return min((clearance_from(one, height) for one in neighbours), default=ENOUGH)


def clearance_from(one: Neighbour, height: float) -> float:
    """The distance from one other vehicle that a height (m) leaves, in least distances."""
    return min(math.hypot(one.distance / one.least, gap(one, height) / one.least_up), ENOUGH)


def gap(one: Neighbour, height: float) -> float:
    """Height (m) between a height (m) and another vehicle; 0 where it is passed on the way there."""
    above, below = height - one.highest, one.lowest - height
    if one.over is None:
        return max(above, below, 0.0)
    return max(above if one.over else below, 0.0)


def deepest(height: float) -> float:
    """By how many metres a vehicle at some height (m above the origin) descends at most."""
    return min(STEP_M, STEP_SHARE * max(height, 0.0))


def best_step(present: float, steps: Sequence[float], neighbours: Sequence[Neighbour]) -> float:
    """The step in height to fly, m: the present one, unless another one leaves clearly more distance.

    Args:
        present: step that is flown, m.
        steps: that may be flown, m; of those that leave as much the first one counts.
        neighbours: all that may come near.
    """
    left = {step: clearance(step, neighbours) for step in (*steps, present)}
    best = max(steps, key=left.__getitem__)
    return best if left[best] > left[present] + BETTER else present
