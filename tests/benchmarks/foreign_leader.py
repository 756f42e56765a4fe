"""How near followers keep to a leader without a companion, by what it sends. The table of docs/any-leader.md.

Run with `.venv/bin/python -m tests.benchmarks.foreign_leader`; some seconds for each flight.
"""

from collections.abc import Mapping

import vfguide
from tests.kit.figures import row
from tests.kit.missions import shipped

HEARD = "rehearsal.leader_telemetry"
VARYING = {f"{HEARD}.delay_s": 0.275, f"{HEARD}.jitter_s": 0.225, "leader.least_delay_s": 0.05}
"""50 to 500 ms, of which the mission knows the 50."""

ROWS: tuple[tuple[str, float, Mapping[str, object]], ...] = (
    ("GLOBAL_POSITION_INT", 10.0, {}),
    ("GLOBAL_POSITION_INT", 5.0, {}),
    ("GLOBAL_POSITION_INT", 4.0, {}),
    ("GLOBAL_POSITION_INT", 1.0, {}),
    ("GLOBAL_POSITION_INT_COV", 5.0, {}),
    ("FOLLOW_TARGET", 10.0, {}),
    ("HIGH_LATENCY2", 1.0, {}),
    ("GLOBAL_POSITION_INT", 10.0, VARYING),
    ("GLOBAL_POSITION_INT", 5.0, VARYING),
    ("GLOBAL_POSITION_INT", 1.0, VARYING),
    ("FOLLOW_TARGET", 10.0, VARYING),
    ("HIGH_LATENCY2", 1.0, VARYING),
    ("GLOBAL_POSITION_INT", 4.0, {"leader.least_delay_s": None}),
    ("GLOBAL_POSITION_INT", 4.0, {**VARYING, "leader.least_delay_s": None}),
    ("GLOBAL_POSITION_INT", 4.0, {f"{HEARD}.loss": 0.3}),
    ("GLOBAL_POSITION_INT", 4.0, {"rehearsal.sensors": "sbas"}),
    ("GLOBAL_POSITION_INT", 1.0, {"rehearsal.sensors": "sbas"}),
    ("GLOBAL_POSITION_INT", 4.0, {"leader.least_delay_s": 0.0}),
)

LINE = {"type": "line", "course_deg": 45.0}
TIGHT = {
    "type": "circle",
    "centre": {"north_m": 150.0, "east_m": 0.0},
    "radius_m": 150.0,
    "direction": "clockwise",
}


def main() -> None:
    """Fly and print."""
    mission = shipped("foreign-leader")
    paths = {"circle 250": None, "circle 150": TIGHT, "line": LINE}
    for message, rate_hz, changes in ROWS:
        figures = []
        for path in paths.values():
            settings = {
                f"{HEARD}.message": message,
                f"{HEARD}.rate_hz": rate_hz,
                **changes,
                **({} if path is None else {"path": path}),
            }
            formation = vfguide.fly(mission, settings=settings).summary.formation
            figures.append(f"{formation.mean_error_m:.2f} ({formation.p95_error_m:.2f})")
        told = ", ".join(f"{field.rpartition('.')[2]} {value}" for field, value in changes.items())
        row(message, f"{rate_hz:g}", told, *figures)


if __name__ == "__main__":
    main()
