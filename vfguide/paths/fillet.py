"""Turns that aircraft can follow: an arc between two easements, along which the curvature comes and goes.

Along an easement the curvature grows as 3 u² - 2 u³, so that it begins and ends evenly: the motion of a slot
50 m behind the leader has the curvature in its speed, and its rate in its acceleration.
"""

import math
from dataclasses import dataclass
from itertools import pairwise

from vfguide.paths.pieces import Element, Pieces

EASED_IN = 10
"""Elements of an easement."""

LEAST_EASEMENT_M = 0.1
"""Without any, the curvature would have no value where a turn begins."""


@dataclass(frozen=True, slots=True)
class Bend:
    """How turns are flown."""

    radius: float
    """Of the arc, m."""
    easement: float
    """Length over which the curvature comes, and goes, m."""


def easement(length: float, curvature: float) -> list[Element]:
    """Elements of a length (m) along which the curvature grows from nothing (1/m, positive clockwise)."""
    step = length / EASED_IN
    shares = [one / EASED_IN for one in range(EASED_IN + 1)]
    bends = [curvature * share * share * (3.0 - 2.0 * share) for share in shares]
    return [Element(step, before, (after - before) / step) for before, after in pairwise(bends)]


def backward(elements: list[Element]) -> list[Element]:
    """The same line from its end to its beginning, and mirrored: its turns have the same sense."""
    return [
        Element(one.length, one.curvature + one.growth * one.length, -one.growth)
        for one in reversed(elements)
    ]


def eased_turn(angle: float, bend: Bend) -> list[Element]:
    """Elements of a turn by an angle (rad, positive clockwise).

    One too small for both easements has no arc: it is wider than the radius, and never narrower.
    """
    if angle == 0.0:
        return []
    length = max(bend.easement, LEAST_EASEMENT_M)
    arc = abs(angle) - length / bend.radius
    curvature = math.copysign(1.0 / bend.radius if arc > 0.0 else abs(angle) / length, angle)
    first = easement(length, curvature)
    middle = [Element(arc * bend.radius, curvature)] if arc > 0.0 else []
    return [*first, *middle, *backward(first)]


def tangent_length(angle: float, bend: Bend) -> float:
    """How far before the corner a fillet of this turn (rad) begins, and behind it ends, m."""
    elements = eased_turn(angle, bend)
    if not elements:
        return 0.0
    north, east, _ = Pieces.of(0.0, 0.0, 0.0, elements).end()
    return math.hypot(north, east) / (2.0 * math.cos(angle / 2.0))


@dataclass(frozen=True, slots=True)
class CircleEntry:
    """How a straight line goes over into a circle."""

    aside: float
    """Distance of the line from the centre, m: more than the radius, by what the easement shifts the arc."""
    before: float
    """m: the easement begins so far before the line is abeam of the centre."""
    elements: list[Element]
    """The easement."""


def circle_entry(bend: Bend, sense: float) -> CircleEntry:
    """Onto a circle of the radius of a bend, clockwise where the sense is 1.0, else -1.0."""
    length = max(bend.easement, LEAST_EASEMENT_M)
    elements = easement(length, sense / bend.radius)
    north, east, course = Pieces.of(0.0, 0.0, 0.0, elements).end()
    return CircleEntry(
        aside=abs(east) + bend.radius * math.cos(course),
        before=north - bend.radius * math.sin(abs(course)),
        elements=elements,
    )


def turn_back(bend: Bend) -> list[Element]:
    """Elements back onto the same line the other way: about 90° to the left, then 270° to the right.

    A little less than 90°, as easements make the first turn wider than the second.
    """

    def both(angle: float) -> list[Element]:
        return [*eased_turn(-angle, bend), *eased_turn(math.pi + angle, bend)]

    # The further the first turn, the further to its side the second one ends.
    least, most = math.radians(20.0), math.radians(160.0)
    for _ in range(60):
        middle = 0.5 * (least + most)
        _, east, _ = Pieces.of(0.0, 0.0, 0.0, both(middle)).end()
        least, most = (middle, most) if east > 0.0 else (least, middle)
    return both(least)
