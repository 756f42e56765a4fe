"""Paths of leaders, and the parts for a path of one's own."""

from vfguide.guidance.path import Path, PathPlace, PathPoint
from vfguide.mission.flight_path import PathShape
from vfguide.mission.quantity import Course, NotNegative, Number, Position, Positive
from vfguide.paths.chain import Curve
from vfguide.registry import paths

path = paths.register
"""Decorator `@path("name")`: registers a class as the path `path.type: name`."""

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
