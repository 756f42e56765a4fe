"""The shapes of a formation: slots of any number of followers behind, beside or around their leader."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Literal, get_args

Shape = Literal[
    "vee",
    "echelon-left",
    "echelon-right",
    "line-abreast",
    "trail",
    "diamond",
    "finger-four",
]
"""What an order calls a shape."""

Offset = tuple[float, float]
"""(forward, right) of the leader, m."""

SHAPES: tuple[Shape, ...] = get_args(Shape)

DIAGONAL = math.sqrt(0.5)
"""How far a step of length 1 at 45 degrees goes back and aside."""


SAME_M = 0.3
"""Slots that differ by no more are the same: orders carry tenths of a metre."""


def shape_slots(shape: Shape, count: int, spacing: float) -> tuple[Offset, ...]:
    """Slots of a shape, the nearest to the leader first; the leader itself is at (0, 0).

    Args:
        shape: its name.
        count: of followers.
        spacing: between neighbours, m: no two aircraft of the shape are nearer.

    Returns:
        (forward, right) of each follower, m.

    Raises:
        ValueError: there is no such shape.
    """
    if shape not in SLOTS:
        raise ValueError(f"no shape is called {shape!r}: there are {', '.join(SHAPES)}")
    return tuple((spacing * forward, spacing * right) for forward, right in SLOTS[shape](count))


def named_shape(slots: Iterable[Offset]) -> tuple[Shape, float] | None:
    """The shape that slots are, and the distance between its neighbours (m); None where they are none.

    Args:
        slots: (forward, right) of each follower, m, in any order.
    """
    wanted = sorted(slots)
    reach = sum(math.hypot(*place) for place in wanted)
    if reach <= 0.0:
        return None
    for shape in SHAPES:
        spacing = reach / sum(math.hypot(*place) for place in shape_slots(shape, len(wanted), 1.0))
        left = list(shape_slots(shape, len(wanted), spacing))
        for place in wanted:
            near = [one for one in left if math.dist(one, place) <= SAME_M]
            if not near:
                break
            left.remove(near[0])
        else:
            return shape, spacing
    return None


def vee(count: int) -> list[Offset]:
    """Two arms at 45 degrees, right and left in turn."""
    return [_arm(number // 2 + 1, 1 if number % 2 == 0 else -1) for number in range(count)]


def echelon_left(count: int) -> list[Offset]:
    """One arm at 45 degrees to the left."""
    return [_arm(number + 1, -1) for number in range(count)]


def echelon_right(count: int) -> list[Offset]:
    """One arm at 45 degrees to the right."""
    return [_arm(number + 1, 1) for number in range(count)]


def line_abreast(count: int) -> list[Offset]:
    """Beside the leader, right and left in turn."""
    return [
        (0.0, float(number // 2 + 1) * (1 if number % 2 == 0 else -1)) for number in range(count)
    ]


def trail(count: int) -> list[Offset]:
    """One behind the other."""
    return [(-float(number + 1), 0.0) for number in range(count)]


def diamond(count: int) -> list[Offset]:
    """A square that stands on its corner, the leader at its front, filled from the front.

    Rows of 1, 2, ... m, ... 2, 1 places for the smallest m that has room; each row is filled from its middle.
    """
    side = math.isqrt(count) + 1
    places: list[Offset] = []
    for row in range(2 * side - 1):
        width = side - abs(row - side + 1)
        across = [(2.0 * place - (width - 1)) * DIAGONAL for place in range(width)]
        across.sort(key=lambda right: (abs(right), -right))
        places += [(-row * DIAGONAL, right) for right in across]
    return places[1 : count + 1]


def finger_four(count: int) -> list[Offset]:
    """Fours like the fingertips of a hand, one four behind the other."""
    four = [
        (0.0, 0.0),
        (-DIAGONAL, -DIAGONAL),
        (-DIAGONAL, DIAGONAL),
        (-2.0 * DIAGONAL, 2.0 * DIAGONAL),
    ]
    depth = 1.0 + 2.0 * DIAGONAL
    places = [
        (forward - depth * (number // 4), right)
        for number in range(count + 1)
        for forward, right in [four[number % 4]]
    ]
    return places[1:]


def _arm(steps: int, side: int) -> Offset:
    """(forward, right) after some steps back and to a side, 1 right and -1 left."""
    return -steps * DIAGONAL, side * steps * DIAGONAL


SLOTS: Mapping[str, Callable[[int], list[Offset]]] = {
    "vee": vee,
    "echelon-left": echelon_left,
    "echelon-right": echelon_right,
    "line-abreast": line_abreast,
    "trail": trail,
    "diamond": diamond,
    "finger-four": finger_four,
}
"""Slots for a spacing of 1."""
