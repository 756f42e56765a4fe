"""Straight and bent pieces of paths, eased turns, and the search for the nearest piece.

A turn that aircraft can follow is an arc between two easements, along which the curvature rises and falls.
Along an easement the curvature grows as 3 u² - 2 u³, with no jump in its rate. The slot 50 m behind the
leader has the curvature in its speed, and the curvature's rate in its acceleration.
"""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Self

import msgspec
import numpy as np

from vfguide.elementwise import BoolArray, FloatArray

LONGEST_TURN = 0.05
"""Approximate largest turn of one piece of a bend, rad."""

LONGEST_BEND_M = 10.0
"""Largest length of one piece of a bend, m."""

GAUSS = (
    (0.5 - math.sqrt(0.15), 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.5 + math.sqrt(0.15), 5.0 / 18.0),
)
"""Nodes within [0, 1] and weights of the three-point Gauss-Legendre quadrature."""

EASED_IN = 10
"""Number of elements of an easement."""

LEAST_EASEMENT_M = 0.1
"""Smallest easement, m: without one, the curvature would be undefined where a turn begins."""

CHORD_TURN, LONGEST_CHORD_M = 0.2, 40.0
"""Largest turn (rad) and length (m) of pieces that the search joins into one chord."""


class Element(msgspec.Struct, frozen=True):
    """Part of a line with linearly changing curvature."""

    length: float
    """Length, m."""
    curvature: float = 0.0
    """Curvature at the beginning, 1/m, positive clockwise."""
    growth: float = 0.0
    """Rate of change of the curvature along the piece, 1/m²."""

    @property
    def turn(self) -> float:
        """Change of the course along the element, rad."""
        return self.length * (self.curvature + 0.5 * self.growth * self.length)

    def pieces(self) -> list["Element"]:
        """Return the element cut into pieces with a small turn each."""
        sharpest = max(abs(self.curvature), abs(self.curvature + self.growth * self.length))
        if sharpest == 0.0:
            return [self]
        longest = min(LONGEST_BEND_M, LONGEST_TURN / sharpest)
        count = max(1, math.ceil(self.length / longest))
        length = self.length / count
        return [
            Element(length, self.curvature + self.growth * length * index, self.growth)
            for index in range(count)
        ]


def displacement(course: Any, curvature: Any, growth: Any, run: Any) -> tuple[Any, Any]:  # noqa: ANN401
    """Return (north, east), m, after a distance (m) along a piece that begins on a course (rad)."""
    north = east = 0.0
    for place, weight in GAUSS:
        at = place * run
        direction = course + at * (curvature + 0.5 * growth * at)
        north = north + weight * np.cos(direction)
        east = east + weight * np.sin(direction)
    return run * north, run * east


class Pieces(msgspec.Struct, frozen=True, kw_only=True):
    """Beginning and shape of each piece of a chain: arrays of equal length."""

    progress: FloatArray
    """Distance along the chain, m."""
    north: FloatArray
    """North coordinate, m."""
    east: FloatArray
    """East coordinate, m."""
    course: FloatArray
    """Course, rad."""
    curvature: FloatArray
    """Curvature, 1/m, positive clockwise."""
    growth: FloatArray
    """Rate of the curvature along the piece, 1/m²."""
    length: FloatArray
    """Length, m, positive."""

    @classmethod
    def of(cls, north: float, east: float, course: float, elements: Sequence[Element]) -> Self:
        """Return elements one after the other from a position (m) and a course (rad)."""
        fine = [piece for one in elements if one.length > 0.0 for piece in one.pieces()]
        length = np.array([one.length for one in fine])
        curvature = np.array([one.curvature for one in fine])
        growth = np.array([one.growth for one in fine])
        turned = np.concatenate([[course], course + np.cumsum([one.turn for one in fine])])
        run_north, run_east = displacement(turned[:-1], curvature, growth, length)
        return cls(
            progress=np.concatenate([[0.0], np.cumsum(length)])[:-1],
            north=north + np.concatenate([[0.0], np.cumsum(run_north)])[:-1],
            east=east + np.concatenate([[0.0], np.cumsum(run_east)])[:-1],
            course=turned[:-1],
            curvature=curvature,
            growth=growth,
            length=length,
        )

    @property
    def total(self) -> float:
        """Total length, m."""
        return float(self.progress[-1] + self.length[-1])

    def end(self) -> tuple[float, float, float]:
        """Return (north, east, course) at the end of the last piece, m and rad."""
        course, bend = float(self.course[-1]), float(self.curvature[-1])
        growth, length = float(self.growth[-1]), float(self.length[-1])
        north, east = displacement(course, bend, growth, length)
        turned = course + length * (bend + 0.5 * growth * length)
        return float(self.north[-1] + north), float(self.east[-1] + east), turned


class Bend(msgspec.Struct, frozen=True):
    """Radius and easement of turns."""

    radius: float
    """Radius of the arc, m."""
    easement: float
    """Length over which the curvature rises, and falls, m."""


def easement(length: float, curvature: float) -> list[Element]:
    """Return elements of a length (m) along which the curvature grows from 0 to a value (1/m)."""
    step = length / EASED_IN
    shares = [one / EASED_IN for one in range(EASED_IN + 1)]
    bends = [curvature * share * share * (3.0 - 2.0 * share) for share in shares]
    return [Element(step, before, (after - before) / step) for before, after in pairwise(bends)]


def backward(elements: list[Element]) -> list[Element]:
    """Return the line flown from its end, and mirrored: its turns keep their sense."""
    return [
        Element(one.length, one.curvature + one.growth * one.length, -one.growth)
        for one in reversed(elements)
    ]


def eased_turn(angle: float, bend: Bend) -> list[Element]:
    """Return the elements of a turn by an angle (rad, positive clockwise).

    A turn too small for both easements has no arc: its radius is never below the bend's.
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
    """Return the distance (m) from a corner to the ends of its fillet, for a turn (rad)."""
    elements = eased_turn(angle, bend)
    if not elements:
        return 0.0
    north, east, _ = Pieces.of(0.0, 0.0, 0.0, elements).end()
    return math.hypot(north, east) / (2.0 * math.cos(angle / 2.0))


class CircleEntry(msgspec.Struct, frozen=True):
    """Transition from a straight line into a circle."""

    aside: float
    """Distance of the line from the centre, m: the radius plus the easement's shift of the arc."""
    before: float
    """Distance from the beginning of the easement to abeam of the centre, m."""
    elements: list[Element]
    """Elements of the easement."""


def circle_entry(bend: Bend, sense: float) -> CircleEntry:
    """Return the entry to a circle of a bend's radius; sense 1.0 is clockwise, -1.0 counter-clockwise."""
    length = max(bend.easement, LEAST_EASEMENT_M)
    elements = easement(length, sense / bend.radius)
    north, east, course = Pieces.of(0.0, 0.0, 0.0, elements).end()
    return CircleEntry(
        aside=abs(east) + bend.radius * math.cos(course),
        before=north - bend.radius * math.sin(abs(course)),
        elements=elements,
    )


def turn_back(bend: Bend) -> list[Element]:
    """Return elements back onto the same line: about 90° to the left, then 270° to the right.

    The first angle is below 90°, because easements make the first turn wider than the second.
    """

    def both(angle: float) -> list[Element]:
        return [*eased_turn(-angle, bend), *eased_turn(math.pi + angle, bend)]

    # The larger the first turn, the farther to its side the second one ends.
    least, most = math.radians(20.0), math.radians(160.0)
    for _ in range(60):
        middle = 0.5 * (least + most)
        _, east, _ = Pieces.of(0.0, 0.0, 0.0, both(middle)).end()
        least, most = (middle, most) if east > 0.0 else (least, middle)
    return both(least)


class PieceTree:
    """Tree of circles around pieces, pairs of pieces, and so on: finds the nearest piece in few steps.

    The squared distance between a vehicle and a piece is (distance)² + (weight |u - v|)², with their
    directions u and v: a branch with the opposite direction is 2 weights farther away.
    """

    def __init__(self, pieces: Pieces) -> None:
        """Build the circles."""
        ends = np.append(pieces.progress, pieces.total)
        sharp = np.abs(pieces.curvature + 0.5 * pieces.growth * pieces.length)
        turned = np.concatenate([[0.0], np.cumsum(sharp * pieces.length)])
        # A chord begins where the sum of turns or lengths passes a multiple; a long piece is its own chord.
        sums = np.maximum(turned / CHORD_TURN, ends / LONGEST_CHORD_M)[:-1]
        alone = pieces.length > LONGEST_BEND_M
        begins = np.diff(np.floor(sums), prepend=-1.0) > 0.0
        begins |= alone | np.append(True, alone[:-1])
        first = np.flatnonzero(begins)
        last = np.append(first[1:], pieces.length.size) - 1
        run = displacement(
            pieces.course[last], pieces.curvature[last], pieces.growth[last], pieces.length[last]
        )
        north = pieces.north[last] + run[0] - pieces.north[first]
        east = pieces.east[last] + run[1] - pieces.east[first]
        chord = np.hypot(north, east)
        self._chords = (
            pieces.north[first],
            pieces.east[first],
            north / chord,
            east / chord,
            chord,
            ends[first],
            ends[last + 1] - ends[first],
        )
        self._leaves = list(zip(*(one.tolist() for one in self._chords), strict=True))
        middles = np.stack(
            [self._chords[0] + 0.5 * north, self._chords[1] + 0.5 * east, *self._chords[2:4]]
        )
        self._levels = [circles(middles, 0.5 * chord, 1)]
        while self._levels[-1].shape[1] > 1:
            self._levels.append(circles(middles, 0.5 * chord, 1 << len(self._levels)))
        self._nodes = [list(map(tuple, level.T.tolist())) for level in self._levels]

    def closest(
        self, north: float, east: float, ahead: float, aside: float, weight: float
    ) -> float:
        """Return the approximate progress (m) nearest to a position (m) with direction (ahead, aside)."""
        best, found = math.inf, 0.0
        nodes, square = self._nodes, weight * weight
        waiting = [(0.0, len(nodes) - 1, 0)]
        while waiting:
            least, level, index = waiting.pop()
            if least >= best:
                continue
            if level == 0:
                at_north, at_east, to_n, to_e, chord, start, length = self._leaves[index]
                away_n, away_e = north - at_north, east - at_east
                run = min(max(away_n * to_n + away_e * to_e, 0.0), chord)
                away_n, away_e = away_n - run * to_n, away_e - run * to_e
                off = (ahead - to_n) ** 2 + (aside - to_e) ** 2
                size = away_n * away_n + away_e * away_e + square * off
                if size < best:
                    best, found = size, start + run * length / chord
                continue
            level -= 1
            children = []
            for child in range(2 * index, min(2 * index + 2, len(nodes[level]))):
                at_n, at_e, to_n, to_e, radius, spread = nodes[level][child]
                away = math.hypot(north - at_n, east - at_e) - radius
                off = math.hypot(ahead - to_n, aside - to_e) - spread
                least = (away * away if away > 0.0 else 0.0) + (
                    square * off * off if off > 0.0 else 0.0
                )
                if least < best:
                    children.append((least, level, child))
            children.sort(reverse=True)
            waiting += children
        return found

    def closest_all(
        self,
        north: FloatArray,
        east: FloatArray,
        ahead: FloatArray,
        aside: FloatArray,
        weight: float,
    ) -> FloatArray:
        """Return the nearest progress (m) of many vehicles at once: all descend the tree together."""
        query = np.arange(north.size)
        node = np.zeros(north.size, dtype=int)
        for level in range(len(self._levels) - 2, -1, -1):
            query, node = np.repeat(query, 2), np.repeat(2 * node, 2)
            node[1::2] += 1
            there = node < self._levels[level].shape[1]
            query, node = query[there], node[there]
            at_n, at_e, to_n, to_e, radius, spread = self._levels[level][:, node]
            away = np.hypot(north[query] - at_n, east[query] - at_e)
            off = np.hypot(ahead[query] - to_n, aside[query] - to_e)
            least = (
                np.maximum(away - radius, 0.0) ** 2 + (weight * np.maximum(off - spread, 0.0)) ** 2
            )
            most = np.full(north.size, math.inf)
            np.minimum.at(most, query, (away + radius) ** 2 + (weight * (off + spread)) ** 2)
            kept = least <= most[query]
            query, node = query[kept], node[kept]
        at_n, at_e, to_n, to_e, chord, start, length = (one[node] for one in self._chords)
        away_n, away_e = north[query] - at_n, east[query] - at_e
        run = np.clip(away_n * to_n + away_e * to_e, 0.0, chord)
        size = (
            (away_n - run * to_n) ** 2
            + (away_e - run * to_e) ** 2
            + weight**2 * ((ahead[query] - to_n) ** 2 + (aside[query] - to_e) ** 2)
        )
        first = first_of_least(query, size)
        return np.asarray((start + run * length / chord)[first])


def circles(middles: FloatArray, radius: FloatArray, count: int) -> FloatArray:
    """Return rows of north, east, ahead, aside, radius and spread of circles around `count` circles each.

    `middles` are rows of north and east in m, and ahead and aside of the directions, of consecutive circles.
    """
    starts = np.arange(0, radius.size, count)
    group = np.arange(radius.size) // count
    around = np.add.reduceat(middles, starts, axis=1) / np.bincount(group)
    away = middles - around[:, group]
    reach = np.maximum.reduceat(np.hypot(away[0], away[1]) + radius, starts)
    spread = np.maximum.reduceat(np.hypot(away[2], away[3]), starts)
    return np.stack([*around, reach, spread])


def first_of_least(group: Any, size: FloatArray) -> Any:  # noqa: ANN401
    """Return the index of the smallest of each group, for groups 0, 1, … with one or more members."""
    order = np.lexsort((size, group))
    first: BoolArray = np.ones(order.size, dtype=bool)
    first[1:] = np.diff(group[order]) > 0
    return order[first]
