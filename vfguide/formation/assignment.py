"""Who goes to which slot: so that the sum of the squares of all ways is least.

Interchangeable vehicles that go straight to slots assigned like that, all by one time law, never come
nearer to each other than the least distance of slots over the square root of two (Turpin, Michael, Kumar,
"CAPT: Concurrent assignment and planning of trajectories for multiple robots", International Journal of
Robotics Research 33(1), 2014, theorem 4.3). The leader is not interchangeable: it stays where it is.
"""

from collections.abc import Mapping, Sequence

from vfguide.extras import require
from vfguide.formation.shapes import Offset


def assigned(begin: Mapping[str, Offset], places: Sequence[Offset]) -> dict[str, Offset]:
    """The place of each follower.

    Args:
        begin: where each follower is now, (forward, right) of the leader, m.
        places: as many, in any order.

    Returns:
        the place of each, by name.

    Raises:
        ValueError: there are not as many places as followers.
        VfguideError: SciPy is not installed.
    """
    if len(begin) != len(places):
        raise ValueError(f"{len(places)} places for {len(begin)} followers")
    if not begin:
        return {}
    require("scipy")
    from scipy.optimize import linear_sum_assignment

    ways = [
        [(north - ahead) ** 2 + (east - right) ** 2 for ahead, right in places]
        for north, east in begin.values()
    ]
    _, columns = linear_sum_assignment(ways)
    return {name: places[column] for name, column in zip(begin, columns, strict=True)}
