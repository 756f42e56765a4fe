"""How near followers keep to a leader without a companion, by what it sends."""

from collections.abc import Mapping

import vfguide
from tests.benchmarks.results import Cases, Value
from tests.kit.missions import shipped

HEARD = "rehearsal.leader_telemetry"
VARYING = {f"{HEARD}.delay_s": 0.275, f"{HEARD}.jitter_s": 0.225, "leader.least_delay_s": 0.05}
"""50 to 500 ms, of which the mission knows the 50."""

ROWS: tuple[tuple[str, float, str, Mapping[str, object]], ...] = (
    ("GLOBAL_POSITION_INT", 10.0, "", {}),
    ("GLOBAL_POSITION_INT", 1.0, "", {}),
    ("FOLLOW_TARGET", 10.0, "", {}),
    ("HIGH_LATENCY2", 1.0, "", {}),
    ("GLOBAL_POSITION_INT", 10.0, "varying", VARYING),
    ("GLOBAL_POSITION_INT", 1.0, "varying", VARYING),
    ("HIGH_LATENCY2", 1.0, "varying", VARYING),
    ("GLOBAL_POSITION_INT", 4.0, "found by TIMESYNC", {"leader.least_delay_s": None}),
    ("GLOBAL_POSITION_INT", 4.0, "30 % lost", {f"{HEARD}.loss": 0.3}),
    ("GLOBAL_POSITION_INT", 4.0, "SBAS receivers", {"rehearsal.sensors": "sbas"}),
    ("GLOBAL_POSITION_INT", 4.0, "declared as none", {"leader.least_delay_s": 0.0}),
)

LINE = {"type": "line", "course_deg": 45.0}
TIGHT = {
    "type": "circle",
    "centre": {"north_m": 150.0, "east_m": 0.0},
    "radius_m": 150.0,
    "direction": "clockwise",
}


def cases() -> Cases:
    """Fly behind each kind of leader, on three paths."""
    mission = shipped("foreign-leader")
    paths = {"wide": None, "tight": TIGHT, "line": LINE}
    for message, rate_hz, changed, changes in ROWS:
        figures = dict[str, Value]()
        for name, path in paths.items():
            settings = {
                f"{HEARD}.message": message,
                f"{HEARD}.rate_hz": rate_hz,
                **changes,
                **({} if path is None else {"path": path}),
            }
            formation = vfguide.fly(mission, settings=settings).summary.formation
            figures |= {f"{name}_m": formation.mean_error_m, f"{name}_p95_m": formation.p95_error_m}
        yield ", ".join(filter(None, (message, f"{rate_hz:g} Hz", changed))), figures
