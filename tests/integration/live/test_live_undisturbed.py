"""A live flight that nothing happens to, as a user starts it."""

import json

from tests.kit.missions import shipped
from tests.kit.programs import vfguide

MISSION = "circle-wind"

ALLOWANCE_M = 0.1
"""By which a live flight may be worse than one in virtual time."""

DURATION_S = 64.0
"""Everyone has to be in the slots within 60 s; the errors that count are those of the second half."""


async def test_live_flight_is_as_good_as_the_mission_asks(speedup):
    flown = await vfguide(
        *("fly", MISSION, "--live", "--json", "--speedup", f"{speedup:g}"),
        *("--duration", DURATION_S),
    )
    summary = json.loads(flown.out)
    assert flown.status == 0, summary["rejections"]
    assert summary["mode"] == "live"
    # Whoever watches hears them in their own time, however fast that passes.
    *_, shown = [line for line in flown.err.splitlines() if line.startswith("flying")]
    assert shown.count(" tracking ") == 4
    assert summary["accepted"] is True
    assert summary["duration_s"] == DURATION_S
    assert summary["formation"]["window_s"][0] == summary["duration_s"] / 2.0
    assert (
        summary["formation"]["mean_error_m"]
        <= shipped(MISSION).acceptance.mean_error_m + ALLOWANCE_M
    )
    assert summary["formation"]["min_separation_m"] >= 5.0
    for vehicle in summary["vehicles"].values():
        assert vehicle["course_setpoint_variation_rad_s"] > 0.0
    latency = summary["latency"]
    assert set(latency["vehicles"]) == set(summary["vehicles"])
    for figure in ("response_ms", "leader_age_ms"):
        assert 0.0 < latency[figure]["p50"] <= latency[figure]["p99"] <= latency[figure]["max"]
    # Companions and emulators of four vehicles, and the judge.
    assert len(latency["processes"]) == 9
    assert all(one["cpu_share"] > 0.0 for one in latency["processes"].values())
