"""A figure eight: the lemniscate of Bernoulli, whose curvature grows with the distance from its middle.

So it comes and goes evenly, and is greatest at the far ends, with a third of the half length as its radius.
"""

import math
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field

from vfguide.guidance.airframe import compose
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Course, Position, Positive
from vfguide.paths.chain import Chain, ChainedPath
from vfguide.paths.circle import Rotation, direction_of
from vfguide.paths.pieces import Pieces
from vfguide.registry import paths

PIECES = 960
"""Pieces of the whole curve: each turns by 0.02 rad or less."""


class FigureEightShape(PathShape):
    """A figure eight, flown from its middle toward the end that the course points to."""

    centre: Position = Position()
    """Where it crosses itself."""

    course_deg: Course = 0.0
    """Direction from its middle to the end that is flown round first, degrees clockwise from north."""

    half_length_m: Annotated[Positive, Field(ge=30.0, le=100e3)]
    """From its middle to either end, m. Altogether it is 0.71 times this wide, and its tightest turns have a
    third of this as their radius."""

    direction: Rotation = "clockwise"
    """Sense of rotation round that end, seen from above; the other end is flown round the other way."""

    @property
    def axis(self) -> float:
        """The course, rad."""
        return math.radians(self.course_deg)


@paths.register("figure-eight")
class FigureEight(ChainedPath):
    """A lemniscate, flown again and again."""

    Shape: ClassVar[type[FigureEightShape]] = FigureEightShape

    def __init__(self, shape: FigureEightShape) -> None:
        """The figure eight of a mission."""
        half, sense = shape.half_length_m, float(direction_of(shape.direction))
        angle = np.linspace(0.0, 2.0 * math.pi, PIECES + 1)
        side = np.cos(angle)
        speed = half / np.sqrt(1.0 + side * side)
        # By Simpson's rule; the middle of each step is looked at for it.
        middle = half / np.sqrt(1.0 + np.cos(angle[:-1] + 0.5 * np.diff(angle)) ** 2)
        length = (speed[:-1] + 4.0 * middle + speed[1:]) * np.diff(angle) / 6.0
        along = half * np.sin(angle) / (1.0 + side * side)
        # Out on the left of the axis and back on its right, where it is flown clockwise.
        north, east = compose(along, -sense * along * side, np.full_like(angle, shape.axis))
        curvature = sense * 3.0 * np.sin(angle) * speed / (half * half)
        self.chain = Chain(
            Pieces(
                progress=np.append(0.0, np.cumsum(length))[:-1],
                north=shape.centre.north_m + north[:-1],
                east=shape.centre.east_m + east[:-1],
                # The tangent turns three times as fast as the bearing from the middle.
                course=shape.axis + sense * (0.5 * math.pi - 3.0 * np.arctan(side[:-1])),
                curvature=curvature[:-1],
                growth=np.diff(curvature) / length,
                length=length,
            )
        )

    @classmethod
    def of(cls, shape: FigureEightShape) -> Self:
        """The figure eight of a mission."""
        return cls(shape)
