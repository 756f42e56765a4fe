"""Lines and points on the ground that the console draws: paths, the fence, rally points."""

import math

import numpy as np

from vfguide.elementwise import FloatArray
from vfguide.lab.rehearsal.recorder import rally_points
from vfguide.lab.report.replay.data import ground_line
from vfguide.mission import Mission
from vfguide.mission.fence_check import fences_of
from vfguide.mission.flight_path import PathShape, path_of
from vfguide.mission.path_frame import frame_of

DRAWN_POINTS = 400
"""Points drawn of each path."""


def describe_ground(mission: Mission) -> dict[str, object]:
    """All paths by name, and outlines: edges of the fence, and rally points; ready for JSON."""
    rally = rally_points(mission)
    return {
        "paths": {
            name: ground_line(*drawn_path(mission, shape))
            for name, shape in mission.paths_by_name.items()
        },
        "outlines": [
            *({"kind": "fence", **ground_line(*edge)} for edge in fence_edges(mission)),
            *([{"kind": "rally", **ground_line(*rally)}] if rally[0].size else []),
        ],
    }


def drawn_path(mission: Mission, shape: PathShape) -> tuple[FloatArray, FloatArray]:
    """(north, east) of points along a path, m: once round it, or as far as the rehearsal flies along it."""
    path = path_of(shape)
    if math.isfinite(path.length):
        progress = path.outline(DRAWN_POINTS)
    else:
        reach_m = mission.leader.airspeed_m_s * mission.rehearsal.duration_s
        progress = np.linspace(0.0, reach_m, DRAWN_POINTS)
    places = path.at(progress)
    return places.north, places.east


def fence_edges(mission: Mission) -> list[tuple[FloatArray, FloatArray]]:
    """(north, east) of points along the edge of each area of the fence, m."""
    fences = fences_of(mission)
    if not fences:
        return []
    frame = frame_of(mission.model_dump())
    return [area.edge(frame) for fence in fences for area in fence.areas]
