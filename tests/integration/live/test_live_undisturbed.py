"""A live flight that nothing happens to, as a user starts it."""

import asyncio
import json
import sys

import yaml

from tests.kit.missions import MISSIONS

MISSION = MISSIONS / "circle-wind.yaml"

ALLOWANCE_M = 0.1
"""By which a live flight may be worse than one in virtual time."""

DURATION_S = 64.0
"""Everyone has to be in the slots within 60 s; the errors that count are those of the second half."""

PATIENCE_S = 300.0


async def test_live_flight_is_as_good_as_the_mission_asks(broker_in, tmp_path, speedup):
    async with broker_in(tmp_path) as broker:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "vfguide", "fly", str(MISSION), "--live", "--json"),
            *("--speedup", f"{speedup:g}", "--duration", str(DURATION_S), "--link", broker.url),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        async with asyncio.timeout(PATIENCE_S):
            out, err = await process.communicate()
        status = process.returncode
    assert b"Traceback" not in err, err.decode()
    summary = json.loads(out)
    assert status == 0, summary["rejections"]
    assert summary["mode"] == "live"
    assert summary["accepted"] is True
    assert summary["duration_s"] == DURATION_S
    asked = yaml.safe_load(MISSION.read_text())["acceptance"]
    assert summary["formation"]["window_s"][0] == summary["duration_s"] / 2.0
    assert summary["formation"]["mean_error_m"] <= asked["mean_error_m"] + ALLOWANCE_M
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
