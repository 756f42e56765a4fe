"""Companions in containers, and autopilots that are not: the profile `sitl`."""

import json
import math
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tests.docker.conftest import Flights, Flown, Formation

SLOTS_M = {"f1": math.hypot(20.0, 20.0), "f2": math.hypot(20.0, 20.0), "f3": 40.0}
"""From the leader."""

COMPANIONS = ("sitl-leader", *(f"sitl-{name}" for name in SLOTS_M))

IN_SLOT_M = 5.0
"""That all fly together is shown here, not how closely: one follower was seen to stay 2 to 3 m off."""

TRIES = 180
"""A second each."""

STUB = (
    *(sys.executable, "-m", "sitl_stub", "--system-id", "1", "--count", "4", "--airborne"),
    *("--mavlink", "udpout://127.0.0.1:14540", "--start", "47.397742,8.545594,588,270"),
)
"""Four autopilots on this computer, who call the ports that the companions are published at."""

LEAST_RECENT = 80
"""Lines of true states that tell where all are by now."""


def distances(truth: Path) -> dict[str, float]:
    """How far each follower is from its leader, m, by what the autopilots themselves know."""
    places = {}
    for line in truth.read_text().splitlines()[-LEAST_RECENT:]:
        state = json.loads(line)
        east_scale = math.cos(math.radians(state["latitude_deg"]))
        places[state["system_id"]] = (
            state["latitude_deg"] * 111_194.9,
            state["longitude_deg"] * 111_194.9 * east_scale,
        )
    if len(places) < 1 + len(SLOTS_M):
        return dict.fromkeys(SLOTS_M, math.inf)
    return {name: math.dist(places[1], places[2 + n]) for n, name in enumerate(SLOTS_M)}


def own_autopilots(formation: "Formation") -> "Flown":
    """Fly until all are where they belong, for a while; how far they were from that at last."""
    formation.compose("up", "--detach")
    truth = formation.directory / "truth.jsonl"
    astray = dict.fromkeys(SLOTS_M, math.inf)
    with subprocess.Popen([*STUB, "--truth", str(truth)]) as stub:
        try:
            for _ in range(TRIES):
                time.sleep(1.0)
                assert stub.poll() is None, "the autopilots have ended"
                now = distances(truth) if truth.exists() else astray
                astray = {name: abs(now[name] - SLOTS_M[name]) for name in SLOTS_M}
                if max(astray.values()) < IN_SLOT_M:
                    break
        finally:
            stub.terminate()
    return formation.unjudged(COMPANIONS, astray)


def docker_flights(missions: Callable[..., dict[str, Any]]) -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    settings = {"COMPOSE_PROFILES": "sitl", "ENGAGE": "--engage"}
    return {"own": (own_autopilots, {"mission": missions("circle-calm"), **settings})}


def test_companions_in_containers_lead_autopilots_of_ones_own(flights: "Flights") -> None:
    flown = flights["own"]
    assert max(flown.seen.values()) < IN_SLOT_M, (flown.seen, flown.logs)
    for name in COMPANIONS:
        assert "tracking" in flown.modes(name), name
