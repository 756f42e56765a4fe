"""How well slots are held in space while the leader climbs at 3 m/s, on a line and on a helix.

    python tests/benchmarks/climbs.py

Through MAVLink bytes in lockstep, in the article's wind and in moderate turbulence; mean distance from the
slot in space over the second half of the flight, in which the leader climbs all the time.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

import yaml

from vfguide.flights import fly
from vfguide.mission.load import parse_mission

MISSION = Path("missions/climb-and-turn.yaml")

REQUIRED_M = 0.15
"""Mean distance from the slot in space."""

CLIMB_DEG = math.degrees(math.atan(0.15))
"""3 m/s at 20 m/s over ground."""

PATHS: dict[str, dict[str, Any]] = {
    "line": {"type": "line", "course_deg": 0.0, "gain": 0.015, "climb_deg": CLIMB_DEG},
    "helix": {
        "type": "helix",
        "centre": {"north_m": 200.0, "east_m": 0.0},
        "radius_m": 200.0,
        "gain": 0.015,
        "climb_deg": CLIMB_DEG,
        "end_height_m": 2000.0,
    },
}
WINDS: dict[str, dict[str, Any]] = {
    "article": {"type": "article"},
    "article, moderate turbulence": {"type": "article", "turbulence": "moderate"},
}


def main() -> int:
    """Fly all, print the table; 1 where one is not within what is required."""
    sys.stdout.write(
        "| path | wind | level, m | height, m | in space: mean, m |\n|---|---|---|---|---|\n"
    )
    good = True
    for path_name, path in PATHS.items():
        for wind_name, wind in WINDS.items():
            content = {**yaml.safe_load(MISSION.read_text()), "path": path, "wind": wind}
            content["rehearsal"]["duration_s"] = 200
            mission = parse_mission(json.dumps(content).encode(), file=str(MISSION)).mission
            summary = fly(mission).summary
            formation = summary.formation
            heights = [
                one.height_error_m.mean
                for one in summary.vehicles.values()
                if one.role == "follower"
            ]
            error = formation.mean_error_3d_m
            good &= error is not None and error <= REQUIRED_M
            sys.stdout.write(
                f"| {path_name} | {wind_name} | {formation.mean_error_m:.3f}"
                f" | {sum(heights) / len(heights):.3f} | {error:.3f} |\n"
            )
            sys.stdout.flush()
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
