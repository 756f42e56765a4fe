"""Which slot somebody who joins a formation is given: one that the present formation leaves free.

An arrangement tells where everybody flies, not which shape that is. It is found by the places: those of the
mission, at any spacing and whoever flies in which of them, or those of a shape by name. Where the present
slots are neither, as after an order of slots by name, who joins is given its slot in the mission.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

from vfguide.formation.shapes import SAME_M, SHAPES, Offset, shape_slots
from vfguide.formation.transition import JOIN_M

STEP_M = 0.1
"""Slots are ordered to this, spacings are taken to it."""


def joined_places(
    joining: Sequence[str], present: Mapping[str, Offset], home: Mapping[str, Offset]
) -> dict[str, Offset]:
    """Where each vehicle that joins is to fly, (forward, right) of the leader, m.

    Args:
        joining: names of the vehicles.
        present: where those fly that are in the formation, by name.
        home: where all fly in the mission, by name.
    """
    own = {name: home[name] for name in joining}
    taken = list(present.values())
    if not joining or not taken:
        return own
    scales = fitting_scales(taken, list(home.values()))
    if scales:
        scale = min(scales, key=lambda one: abs(one - 1.0))
        free = without(taken, (_times(scale, place) for place in home.values()))
        return _given({name: _times(scale, place) for name, place in own.items()}, free)
    for count in sorted({len(taken) + len(joining), len(home)}):
        for free in free_places(taken, count):
            if len(free) >= len(joining):
                return _given(own, free)
    return own


def free_places(taken: Sequence[Offset], count: int) -> Iterator[list[Offset]]:
    """What each shape of so many followers leaves free that the places fit into that are taken, m.

    Of several spacings that are possible the least counts that leaves room to join.
    """
    for shape in SHAPES:
        scales = fitting_scales(taken, shape_slots(shape, count, 1.0))
        if scales:
            wide = [scale for scale in scales if scale >= JOIN_M - STEP_M]
            spacing = round(min(wide, default=max(scales)) / STEP_M) * STEP_M
            yield without(taken, shape_slots(shape, count, spacing))


def fitting_scales(taken: Sequence[Offset], places: Sequence[Offset]) -> list[float]:
    """By what places may be multiplied for those that are taken to be among them.

    Args:
        taken: (forward, right) of the leader, m.
        places: (forward, right) of the leader, in any unit.
    """
    reach = max(math.hypot(*place) for place in taken)
    sizes = {math.hypot(*place) for place in places} - {0.0}
    left = len(places) - len(taken)
    return [
        reach / size
        for size in sizes
        if reach > 0.0
        and len(without(taken, (_times(reach / size, one) for one in places))) == left
    ]


def without(taken: Iterable[Offset], places: Iterable[Offset]) -> list[Offset]:
    """Places that nobody has, in their order."""
    left = list(places)
    for place in taken:
        near = [one for one in left if math.dist(one, place) <= SAME_M]
        if near:
            left.remove(min(near, key=lambda one: math.dist(one, place)))
    return left


def _given(wanted: Mapping[str, Offset], free: Sequence[Offset]) -> dict[str, Offset]:
    """A free place for each: the one that it wants, else the first that is left."""
    found, left = dict[str, Offset](), list(free)
    for name, place in wanted.items():
        same = [one for one in left if math.dist(one, place) <= SAME_M]
        if same:
            found[name] = same[0]
            left.remove(same[0])
    for name in wanted:
        if name not in found:
            found[name] = left.pop(0)
    return {name: found[name] for name in wanted}


def _times(scale: float, place: Offset) -> Offset:
    return scale * place[0], scale * place[1]
