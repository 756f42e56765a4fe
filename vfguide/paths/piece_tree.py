"""Which piece of a line is nearest to a vehicle, by place and by course."""

import math
from typing import Any

import numpy as np

from vfguide.elementwise import BoolArray, FloatArray
from vfguide.paths.pieces import LONGEST_BEND_M, Pieces, displacement

CHORD_TURN, LONGEST_CHORD_M = 0.2, 40.0
"""rad, m: pieces that turn by no more together, and are no longer, are looked for as one chord."""


class PieceTree:
    """Circles around pieces, around pairs of them, and so on up to all: the nearest piece in few steps.

    Between a vehicle and a piece counts (distance)² + (weight |u - v|)², u and v the directions of both: a
    branch that runs the other way is 2 weights further away.
    """

    def __init__(self, pieces: Pieces) -> None:
        """Build the circles."""
        ends = np.append(pieces.progress, pieces.total)
        sharp = np.abs(pieces.curvature + 0.5 * pieces.growth * pieces.length)
        turned = np.concatenate([[0.0], np.cumsum(sharp * pieces.length)])
        # A chord begins where the sum of turns or lengths passes another multiple; a long piece is one alone.
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
            [
                self._chords[0] + 0.5 * north,
                self._chords[1] + 0.5 * east,
                *self._chords[2:4],
            ]
        )
        self._levels = [circles(middles, 0.5 * chord, 1)]
        while self._levels[-1].shape[1] > 1:
            self._levels.append(circles(middles, 0.5 * chord, 1 << len(self._levels)))
        self._nodes = [list(map(tuple, level.T.tolist())) for level in self._levels]

    def closest(
        self, north: float, east: float, ahead: float, aside: float, weight: float
    ) -> float:
        """Progress (m) of about the nearest place, for a vehicle at a place (m) that flies (ahead, aside)."""
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
        """The same for many vehicles at once: all of them go down the tree together."""
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
    """North, east, ahead, aside, radius and spread (rows) of circles around so many circles each.

    Args:
        middles: north and east in m, ahead and aside of the directions, of the circles in their order: rows.
        radius: of them, m.
        count: of consecutive ones.
    """
    starts = np.arange(0, radius.size, count)
    group = np.arange(radius.size) // count
    around = np.add.reduceat(middles, starts, axis=1) / np.bincount(group)
    away = middles - around[:, group]
    reach = np.maximum.reduceat(np.hypot(away[0], away[1]) + radius, starts)
    spread = np.maximum.reduceat(np.hypot(away[2], away[3]), starts)
    return np.stack([*around, reach, spread])


def first_of_least(group: Any, size: FloatArray) -> Any:  # noqa: ANN401
    """Index of the least of each group, in the order of the groups 0, 1, …; each has one or more."""
    order = np.lexsort((size, group))
    first: BoolArray = np.ones(order.size, dtype=bool)
    first[1:] = np.diff(group[order]) > 0
    return order[first]
