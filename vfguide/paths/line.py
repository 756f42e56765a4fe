"""Straight line without ends."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator
from pydantic_core import PydanticCustomError

from vfguide.elementwise import FloatArray, Number, like
from vfguide.guidance.airframe import compose, resolve
from vfguide.guidance.path import Path, PathPlace, PathPoint
from vfguide.mission import quantity
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Course, Position
from vfguide.paths.climb import EASE_M, LEVEL, Climb, ClimbAngle, EndHeight, check_end, climb_of
from vfguide.registry import paths

SLOPE_FIELDS = ("slope", "intercept_m", "direction")


def point_of_slope(data: Mapping[str, object]) -> Position:
    """Return the point of y = a x + b at x = 0; the origin without an intercept."""
    intercept_m = data.get("intercept_m")
    return Position(east_m=intercept_m if isinstance(intercept_m, float) else 0.0)


def course_of_slope(data: Mapping[str, object]) -> float:
    """Return the course of y = a x + b, degrees: `forward` flies toward growing x (north)."""
    slope = data.get("slope")
    course_deg = math.degrees(math.atan(slope)) if isinstance(slope, float) else 0.0
    return course_deg + 180.0 if data.get("direction") == "backward" else course_deg % 360.0


class LineShape(PathShape):
    """A straight line without end, given by a point and a course, or as y = slope·x + intercept."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["course_deg"]}, {"required": ["slope"]}]}
    )

    slope: quantity.Number | None = None
    """Instead of `course_deg`: a of y = a·x + b with x north and y east. No line due east has it."""

    intercept_m: Annotated[quantity.Number, Field(ge=-100e3, le=100e3)] | None = None
    """Beside `slope`: b of y = a·x + b, metres east of the origin; 0 if absent."""

    direction: Literal["forward", "backward"] | None = None
    """Beside `slope`: `forward` (the default) flies toward north, `backward` toward south."""

    point: Position = Field(default_factory=point_of_slope)
    """A point of the line; the origin if absent. The flight starts beside it."""

    course_deg: Course = Field(default_factory=course_of_slope)
    """Course along the line, degrees clockwise from north."""

    approach_deg: Annotated[quantity.Number, Field(ge=1.0, le=90.0)] = 90.0
    """chi_inf of the article: angle to the line at which the field approaches it from far away, degrees."""

    climb_deg: ClimbAngle = 0.0
    """Angle at which it climbs over the ground from its point on, degrees; negative descends."""

    end_height_m: EndHeight | None = None
    """Beside `climb_deg`: height at which it levels off, m above the mission's flying height; negative is
    below. Never if absent."""

    @property
    def approach_angle(self) -> float:
        """chi_inf, rad."""
        return math.radians(self.approach_deg)

    @model_validator(mode="after")
    def _given_in_one_way(self) -> Self:
        given = self.model_fields_set
        if self.slope is not None and {"point", "course_deg"} & given:
            kind = "line_given_twice"
            message = "either slope and intercept_m, or point and course_deg, not both"
            raise PydanticCustomError(kind, message)
        if self.slope is None and "course_deg" not in given:
            kind = "line_without_course"
            message = "the line has no course"
            raise PydanticCustomError(kind, message)
        if self.slope is None and set(SLOPE_FIELDS) & given:
            kind = "line_without_slope"
            message = "intercept_m and direction say nothing without slope"
            raise PydanticCustomError(kind, message)
        check_end(self.climb_deg, self.end_height_m)
        return self


@paths.register("line")
@dataclass(frozen=True, slots=True, kw_only=True)
class Line(Path):
    """Straight line; progress counts from its point."""

    Shape: ClassVar[type[LineShape]] = LineShape

    north: float
    """North coordinate of a point on the line, m."""
    east: float
    """East coordinate of the same point, m."""
    course: float
    """Direction of travel chi_p, rad."""
    climb: Climb = LEVEL
    """Height by progress."""

    @classmethod
    def of(cls, shape: LineShape) -> Self:
        """Return the line of a mission."""
        point = shape.point
        return cls(
            north=point.north_m,
            east=point.east_m,
            course=math.radians(shape.course_deg),
            climb=climb_of(shape.climb_deg, shape.end_height_m),
        )

    @property
    def length(self) -> float:
        """Infinite: a line has no end."""
        return math.inf

    def nearest(
        self, north: Number, east: Number, course: Number | None = None
    ) -> PathPoint[Number]:
        """Return the point abeam of the vehicle; its error is a distance, unlike the article's e."""
        del course
        along, right = resolve(north - self.north, east - self.east, like(self.course, north))
        still = along * 0.0
        height, slope = self.climb.at(along)
        return PathPoint(still + self.course, right, still, along, height, slope)

    def at(self, progress: Number) -> PathPlace[Number]:
        """Return the line at a distance (m) from its point."""
        still = progress * 0.0
        north, east = compose(progress, still, still + self.course)
        height, slope = self.climb.at(progress)
        return PathPlace(
            self.north + north, self.east + east, still + self.course, still, height, slope
        )

    def outline(self, count: int) -> FloatArray:
        """Return progress 0; for a climbing line also its steepest place and the end of the climb."""
        del count
        run = self.climb.run
        if run == 0.0:
            return np.zeros(1)
        return np.array([0.0, 0.5 * (min(run, 1e6) + EASE_M), min(run, 1e6) + EASE_M])
