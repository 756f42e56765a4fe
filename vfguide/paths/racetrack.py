"""Racetrack of two straight legs joined by half circles, and figure eight: the lemniscate of Bernoulli.

The lemniscate's curvature is proportional to the distance from its middle. It changes evenly, and is largest
at the far ends, with a third of the half length as its radius.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from vfguide.elementwise import FloatArray, Number, atan2, clip, cos, like, sin, where
from vfguide.guidance.airframe import compose, resolve
from vfguide.guidance.path import Direction, Path, PathPlace, PathPoint
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Course, NotNegative, Position, Positive
from vfguide.paths.chain import Chain, ChainedPath
from vfguide.paths.circle import Radius, Rotation, around, direction_of
from vfguide.paths.pieces import Pieces
from vfguide.registry import paths

USUAL_EASEMENT_M = 100.0

LEAST_EASEMENT = 1e-3
"""Smallest easement, m: without one, the curvature would be undefined at the end of a leg."""


def usual_easement(data: Mapping[str, object]) -> float:
    """Return the default easement of a racetrack, m."""
    lengths = (data.get("leg_m"), data.get("radius_m"))
    return min([USUAL_EASEMENT_M, *(one for one in lengths if isinstance(one, float))])


class RacetrackShape(PathShape):
    """Two parallel legs joined by two half circles, flown round and round.

    The first leg has the centre on its right when flown clockwise, on its left otherwise.
    """

    centre: Position
    """Middle of the racetrack."""

    course_deg: Course
    """Course of the first leg, degrees clockwise from north."""

    leg_m: Annotated[Positive, Field(le=100e3)]
    """Length of each straight leg, m."""

    radius_m: Radius
    """Radius of the half circles, m; the legs are twice as far apart."""

    direction: Rotation = "clockwise"
    """Sense of rotation seen from above."""

    easement_m: Annotated[NotNegative, Field(le=100e3)] = Field(default_factory=usual_easement)
    """Length over which the curvature changes between leg and half circle, m; 0 for none, and if absent
    100 m or as much as leg and radius leave room for."""

    @field_validator("easement_m")
    @classmethod
    def _easement_fits(cls, easement_m: float, info: ValidationInfo) -> float:
        longest = min(info.data.get("leg_m", math.inf), info.data.get("radius_m", math.inf))
        if easement_m > longest:
            kind = "easement_m"
            message = "is longer than the leg or the radius; {longest} m is the most"
            raise PydanticCustomError(kind, message, {"longest": f"{longest:g}"})
        return easement_m


@paths.register("racetrack")
@dataclass(frozen=True, slots=True, kw_only=True)
class Racetrack(Path):
    """Two straight legs joined by half circles, with easements.

    Where leg and half circle meet the curvature jumps, and with it the motion of every slot. A rigid slot 40
    m behind a leader that starts to turn at 0.13 rad/s would instantly move sideways at 5 m/s. An easement
    spreads the jump: the curvature grows linearly along it, as on a railway, and the half circle moves inward
    by about easement²/(24 radius).

    Progress is that of the figure without easements, from the beginning of the first leg.
    """

    Shape: ClassVar[type[RacetrackShape]] = RacetrackShape

    north: float
    """North coordinate of the centre, m."""
    east: float
    """East coordinate of the centre, m."""
    course: float
    """Course of the first leg, rad; the second leg is opposite."""
    leg: float
    """Length of each leg, m, positive."""
    radius: float
    """Radius of the half circles, m; the legs are two radii apart."""
    direction: Direction
    """1 where the half circles turn clockwise."""
    easement: float = 0.0
    """Length over which the curvature changes, m, half of it on the leg; at most leg and radius."""

    @classmethod
    def of(cls, shape: RacetrackShape) -> Self:
        """Return the racetrack of a mission."""
        return cls(
            north=shape.centre.north_m,
            east=shape.centre.east_m,
            course=math.radians(shape.course_deg),
            leg=shape.leg_m,
            radius=shape.radius_m,
            direction=direction_of(shape.direction),
            easement=shape.easement_m,
        )

    @property
    def length(self) -> float:
        """Length of one round without easements, m."""
        return 2.0 * (self.leg + self.half_circle)

    @property
    def half_circle(self) -> float:
        """Length of a half circle, m."""
        return math.pi * self.radius

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the point on the leg abeam of the vehicle, or on the half circle on its bearing."""
        del course
        along, right = resolve(north - self.north, east - self.east, like(self.course, north))
        beyond = along - clip(along, -self.leg / 2.0, self.leg / 2.0)
        tangent, error = around(beyond, right, self.radius, self.direction)
        # Distance flown since the nearest end of a leg; negative on the leg, before its end or after.
        on_leg = clip(abs(along) - self.leg / 2.0, -self.leg, 0.0)
        run = on_leg + self.radius * (math.pi / 2.0 - atan2(abs(right), abs(beyond)))
        entering = where(along * right * self.direction < 0.0, like(1.0, along), like(-1.0, along))
        lead, shift, curvature = self._eased(run)
        return PathPoint(
            tangent + self.course + lead * entering * self.direction,
            error - shift * self.direction,
            curvature * self.direction,
            self._progress(along, beyond, right * self.direction),
        )

    def _progress(self, along: Number, beyond: Number, inward: Number) -> Number:
        """Return the progress (m) of a position; `inward` grows from the first leg to the second."""
        far = self.leg + self.radius * atan2(beyond, -inward)
        near = 2.0 * self.leg + self.half_circle + self.radius * atan2(-beyond, inward)
        second = 1.5 * self.leg + self.half_circle - along
        on_leg = where(inward <= 0.0, along + self.leg / 2.0, second)
        return where(beyond > 0.0, far, where(beyond < 0.0, near, on_leg))

    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the racetrack abeam of a progress (m) along the figure without easements."""
        left = progress % self.length
        first = clip(left, 0.0, self.leg)
        far = clip(left - self.leg, 0.0, self.half_circle) / self.radius
        second = clip(left - self.leg - self.half_circle, 0.0, self.leg)
        near = clip(left - 2.0 * self.leg - self.half_circle, 0.0, self.half_circle) / self.radius
        along = first - second - self.leg / 2.0 + self.radius * (sin(far) - sin(near))
        inward = -self.radius * (cos(far) + 1.0 - cos(near))
        north, east = compose(along, inward * self.direction, like(self.course, along))
        north, east = self.north + north, self.east + east
        point = self.nearest(north, east)
        error, tangent = point.cross_track_error, self.course + self.direction * (far + near)
        return PathPlace(
            north + error * sin(tangent), east - error * cos(tangent), point.course, point.curvature
        )

    def outline(self, count: int) -> FloatArray:
        """Return as many places on each leg as on each half circle, so that a short turn is not missed."""
        ends = np.cumsum([0.0, self.leg, self.half_circle, self.leg, self.half_circle])
        return np.asarray(np.interp(np.linspace(0.0, 4.0, count), np.arange(5.0), ends))

    def _eased(self, run: Number) -> tuple[Number, Number, Number]:
        """Return (tangent turn, inward shift, curvature) of the easement at a distance from the leg's end.

        The curvature rises linearly from 0 to that of the half circle. Tangent and shift are its first and
        second integrals, minus those of the jump that it replaces.
        """
        half = max(self.easement, LEAST_EASEMENT) / 2.0
        # sharpest half² / 6 with sharpest = 1 / (radius - full_shift): else the error jumps midway.
        full_shift = (self.radius - math.sqrt(self.radius**2 - half * half / 1.5)) / 2.0
        sharpest = 1.0 / (self.radius - full_shift)
        inside = clip(run, -half, half)
        to_edge = half - abs(inside)
        growth = sharpest * to_edge * to_edge / (4.0 * half)
        bump = growth * to_edge / 3.0
        shift = where(inside < 0.0, bump, full_shift - bump)
        return growth, shift, sharpest * (inside + half) / (2.0 * half)


PIECES = 960
"""Number of pieces of the whole curve: each turns by 0.02 rad or less."""


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
        """Course, rad."""
        return math.radians(self.course_deg)


@paths.register("figure-eight")
class FigureEight(ChainedPath):
    """Lemniscate, flown again and again."""

    Shape: ClassVar[type[FigureEightShape]] = FigureEightShape

    def __init__(self, shape: FigureEightShape) -> None:
        """Create the figure eight of a mission."""
        half, sense = shape.half_length_m, float(direction_of(shape.direction))
        angle = np.linspace(0.0, 2.0 * math.pi, PIECES + 1)
        side = np.cos(angle)
        speed = half / np.sqrt(1.0 + side * side)
        # Simpson's rule, with the middle of each step.
        middle = half / np.sqrt(1.0 + np.cos(angle[:-1] + 0.5 * np.diff(angle)) ** 2)
        length = (speed[:-1] + 4.0 * middle + speed[1:]) * np.diff(angle) / 6.0
        along = half * np.sin(angle) / (1.0 + side * side)
        # Clockwise: out on the left of the axis, back on its right.
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
        """Return the figure eight of a mission."""
        return cls(shape)
