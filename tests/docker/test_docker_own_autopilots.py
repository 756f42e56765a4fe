"""Companions and a console in containers, autopilots that are not: the profiles `sitl` and `console`."""

import math
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.docker.console import look_at_console
from tests.docker.flown import Flown
from tests.docker.formation import Formation
from tests.kit.missions import content_of
from tests.kit.sockets import free_port
from vfguide.lab.rehearsal.recorder import TruthCollector
from vfguide.lab.report.figures import slot_error
from vfguide.mission import Mission, load_mission

FOLLOWERS = ("f1", "f2", "f3")

COMPANIONS = ("sitl-leader", *(f"sitl-{name}" for name in FOLLOWERS))

IN_SLOT_M = 1.0

TRIES = 180
"""A second each."""

SPEED = {"environment": {"SPEEDUP": "${SPEEDUP}"}}
"""Of companions that otherwise fly in real time."""

STUB = (
    *(sys.executable, "-m", "sitl_stub", "--system-id", "1", "--count", "4", "--airborne"),
    *("--mavlink", "udpout://127.0.0.1:14540", "--start", "47.397742,8.545594,588,270"),
    *("--truth-rate", "20", "--speedup"),
)
"""Four autopilots on this computer, who call the ports that the companions are published at."""

RECENT = 5 * 20 * 4
"""Lines of true states: five seconds of all four."""


def slot_errors(mission: Mission, truth: Path) -> dict[str, float]:
    """How far each follower was from its slot at most, lately, m, by what the autopilots themselves know."""
    judge = TruthCollector(mission)
    for line in truth.read_bytes().splitlines()[-RECENT:]:
        judge.datagram_received(line, None)
    if not judge.common_samples():
        return dict.fromkeys(FOLLOWERS, math.inf)
    record = judge.record(wall_s=0.0)
    return {
        one.name: float(slot_error(record.leader, one).distance_m.max()) for one in record.followers
    }


def own_autopilots(formation: Formation) -> Flown:
    """Fly until all are where they belong, for a while; how far off they were at last, and the console."""
    formation.overrule({"services": dict.fromkeys(COMPANIONS, SPEED)})
    formation.compose("up", "--detach")
    mission = load_mission(formation.directory / "mission.yaml")
    truth = formation.directory / "truth.jsonl"
    astray = dict.fromkeys(FOLLOWERS, math.inf)
    with subprocess.Popen([*STUB, str(formation.speedup), "--truth", str(truth)]) as stub:
        try:
            for _ in range(TRIES):
                time.sleep(1.0)
                assert stub.poll() is None, "the autopilots have ended"
                if truth.exists():
                    astray = slot_errors(mission, truth)
                if max(astray.values()) < IN_SLOT_M:
                    break
            console = look_at_console(formation)
        finally:
            stub.terminate()
    return formation.unjudged(COMPANIONS, {"astray": astray, "console": console})


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    settings = {
        "COMPOSE_PROFILES": "sitl,console",
        "CONSOLE_PORT": str(free_port()),
        "ENGAGE": "--engage",
    }
    return {"own": (own_autopilots, {"mission": content_of("circle-calm", "json"), **settings})}


def test_companions_in_containers_lead_autopilots_of_ones_own(flights):
    flown = flights["own"]
    astray = flown.seen["astray"]
    assert max(astray.values()) < IN_SLOT_M, (astray, flown.logs)
    for name in COMPANIONS:
        assert "tracking" in flown.modes(name), name


def test_the_printed_address_opens_the_page_and_no_other_does(flights):
    console = flights["own"].seen["console"]
    published = console.published
    port = published[0]["HostPort"]
    assert published == [{"HostIp": "127.0.0.1", "HostPort": port}]
    assert console.address == f"http://127.0.0.1:{port}"
    assert console.refusal == 403
    assert b"circle-calm" in console.page
    assert console.heard == {"leader", *FOLLOWERS}
