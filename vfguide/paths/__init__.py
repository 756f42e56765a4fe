"""The paths that leaders follow, and what a path of one's own is made of."""

from vfguide.guidance.path import Path, PathPlace, PathPoint
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Course, NotNegative, Number, Position, Positive
from vfguide.paths.chain import Curve
from vfguide.registry import paths

path = paths.register
"""`@path("name")` makes a class known as the path `path.type: name`."""

__all__ = [
    "Course",
    "Curve",
    "NotNegative",
    "Number",
    "Path",
    "PathPlace",
    "PathPoint",
    "PathShape",
    "Position",
    "Positive",
    "path",
]
