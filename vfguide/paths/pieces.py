"""Pieces of lines over the ground whose curvature changes evenly: straights, arcs and clothoids."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from vfguide.elementwise import FloatArray

LONGEST_TURN = 0.05
"""rad: a piece of a bend turns by no more than about this."""

LONGEST_BEND_M = 10.0
"""Of one piece of a bend."""

GAUSS = (
    (0.5 - math.sqrt(0.15), 5.0 / 18.0),
    (0.5, 8.0 / 18.0),
    (0.5 + math.sqrt(0.15), 5.0 / 18.0),
)
"""Places within [0, 1] and weights of the Gauss-Legendre quadrature of three points."""


@dataclass(frozen=True, slots=True)
class Element:
    """A part of a line whose curvature changes evenly along it."""

    length: float
    """m."""
    curvature: float = 0.0
    """At its beginning, 1/m, positive clockwise."""
    growth: float = 0.0
    """Of the curvature, 1/m²."""

    @property
    def turn(self) -> float:
        """By which the course changes along it, rad."""
        return self.length * (self.curvature + 0.5 * self.growth * self.length)

    def pieces(self) -> list["Element"]:
        """The same in pieces that turn by little each."""
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
    """(north, east) in m of a distance (m) along a piece that begins on a course (rad)."""
    north = east = 0.0
    for place, weight in GAUSS:
        at = place * run
        direction = course + at * (curvature + 0.5 * growth * at)
        north = north + weight * np.cos(direction)
        east = east + weight * np.sin(direction)
    return run * north, run * east


@dataclass(frozen=True, slots=True, kw_only=True)
class Pieces:
    """Where each piece of a chain begins, and how it runs on: arrays of one length."""

    progress: FloatArray
    """m."""
    north: FloatArray
    """m."""
    east: FloatArray
    """m."""
    course: FloatArray
    """rad."""
    curvature: FloatArray
    """1/m."""
    growth: FloatArray
    """1/m²."""
    length: FloatArray
    """m, positive."""

    @classmethod
    def of(cls, north: float, east: float, course: float, elements: Sequence[Element]) -> Self:
        """Elements one after the other from a place (m) and a course (rad)."""
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
        """Length of all, m."""
        return float(self.progress[-1] + self.length[-1])

    def end(self) -> tuple[float, float, float]:
        """(north, east, course) where the last piece ends, m and rad."""
        course, bend = float(self.course[-1]), float(self.curvature[-1])
        growth, length = float(self.growth[-1]), float(self.length[-1])
        north, east = displacement(course, bend, growth, length)
        turned = course + length * (bend + 0.5 * growth * length)
        return float(self.north[-1] + north), float(self.east[-1] + east), turned
