"""The paths a leader can be sent along, as a mission file describes them.

Local frame: x north, y east (m). Courses are degrees clockwise from north.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import ConfigDict, Field, ValidationInfo, field_validator, model_validator
from pydantic_core import PydanticCustomError

from vfguide.mission.quantity import Course, Gain, NotNegative, Number, Position, Positive, Section

FieldGain = Annotated[Gain, Field(le=10.0)]
Radius = Annotated[Number, Field(ge=1.0, le=100e3)]

SLOPE_FIELDS = ("slope", "intercept_m", "direction")


def _point_of_slope(data: Mapping[str, object]) -> Position:
    """The point of y = a x + b at x = 0; the origin when no intercept is given."""
    intercept_m = data.get("intercept_m")
    return Position(east_m=intercept_m if isinstance(intercept_m, float) else 0.0)


def _course_of_slope(data: Mapping[str, object]) -> float:
    """The course of y = a x + b: `forward` flies toward growing x (north), `backward` the other."""
    slope = data.get("slope")
    course_deg = math.degrees(math.atan(slope)) if isinstance(slope, float) else 0.0
    return course_deg + 180.0 if data.get("direction") == "backward" else course_deg % 360.0


class LinePath(Section):
    """A straight line without end, given by a point and a course, or as y = slope·x + intercept."""

    model_config = ConfigDict(
        json_schema_extra={"anyOf": [{"required": ["course_deg"]}, {"required": ["slope"]}]}
    )

    type: Literal["line"]
    """`line`."""

    slope: Number | None = None
    """Instead of `course_deg`: a of y = a·x + b with x north and y east. No line due east has it."""

    intercept_m: Annotated[Number, Field(ge=-100e3, le=100e3)] | None = None
    """Beside `slope`: b of y = a·x + b, metres east of the origin; 0 if absent."""

    direction: Literal["forward", "backward"] | None = None
    """Beside `slope`: `forward` (the default) flies toward north, `backward` toward south."""

    point: Position = Field(default_factory=_point_of_slope)
    """A point of the line; the origin if absent. The flight starts beside it."""

    course_deg: Course = Field(default_factory=_course_of_slope)
    """Course along the line, degrees clockwise from north."""

    gain: FieldGain = 0.03
    """k of the article: how sharply the field turns onto the line, 1/m."""

    approach_deg: Annotated[Number, Field(ge=1.0, le=90.0)] = 90.0
    """chi_inf of the article: angle to the line at which the field approaches it from far away, degrees."""

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
        return self


class CirclePath(Section):
    """A circle flown round and round."""

    type: Literal["circle"]
    """`circle`."""

    centre: Position
    """Centre of the circle."""

    radius_m: Radius
    """Radius, m."""

    direction: Literal["clockwise", "counterclockwise"] = "clockwise"
    """Sense of rotation seen from above."""

    gain: FieldGain = 0.03
    """k of the article: how sharply the field turns onto the circle, 1/m."""


USUAL_EASEMENT_M = 100.0


def usual_easement(data: Mapping[str, object]) -> float:
    """The easement of a racetrack that names none, m."""
    lengths = (data.get("leg_m"), data.get("radius_m"))
    return min([USUAL_EASEMENT_M, *(one for one in lengths if isinstance(one, float))])


class RacetrackPath(Section):
    """Two parallel legs joined by two half circles, flown round and round.

    The first leg has the centre on its right when flown clockwise, on its left otherwise.
    """

    type: Literal["racetrack"]
    """`racetrack`."""

    centre: Position
    """Middle of the racetrack."""

    course_deg: Course
    """Course of the first leg, degrees clockwise from north."""

    leg_m: Annotated[Positive, Field(le=100e3)]
    """Length of each straight leg, m."""

    radius_m: Radius
    """Radius of the half circles, m; the legs are twice as far apart."""

    direction: Literal["clockwise", "counterclockwise"] = "clockwise"
    """Sense of rotation seen from above."""

    easement_m: Annotated[NotNegative, Field(le=100e3)] = Field(default_factory=usual_easement)
    """Length over which the curvature changes between leg and half circle, m; 0 for none, and if absent
    100 m or as much as leg and radius leave room for."""

    gain: FieldGain = 0.03
    """k of the article: how sharply the field turns onto the path, 1/m."""

    @field_validator("easement_m")
    @classmethod
    def _easement_fits(cls, easement_m: float, info: ValidationInfo) -> float:
        longest = min(info.data.get("leg_m", math.inf), info.data.get("radius_m", math.inf))
        if easement_m > longest:
            kind = "easement_m"
            message = "is longer than the leg or the radius; {longest} m is the most"
            raise PydanticCustomError(kind, message, {"longest": f"{longest:g}"})
        return easement_m


FlightPath = Annotated[LinePath | CirclePath | RacetrackPath, Field(discriminator="type")]
