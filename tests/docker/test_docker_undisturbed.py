"""Formations in containers that nobody disturbs: figures, what they cost, who reaches whom."""

import json
import re
import time
from datetime import datetime
from typing import Any

import pytest

from tests.docker.flown import Flown
from tests.docker.formation import Formation
from tests.kit.missions import content_of, on_the_circle

FLIGHT_S = {"windy": 64.0, "direct": 48.0}
"""Everyone has to be in the slots within 60 s. Without a broker they start there: companions take over some
seconds later, and all are back for the second half."""

MEASURED_S = (20.0, 36.0)
"""When nobody rejoins any more, and the judge does not draw yet."""

MOST_CORES = 1.5
MOST_MB = 800.0

USAGE = "{{.CPUPerc}} {{.MemUsage}}"
UNITS_MB = {"B": 1e-6, "KiB": 1.024e-3, "MiB": 1.048576, "GiB": 1073.741824}

ASK = """
import socket, sys
from concurrent.futures import ThreadPoolExecutor

def find(host):
    try:
        return socket.getaddrinfo(host, 14540)[0][4][0]
    except OSError:
        return "unknown"

# All at once: it takes a while to find out that nobody has a name.
with ThreadPoolExecutor() as pool:
    for host, address in zip(sys.argv[1:], pool.map(find, sys.argv[1:])):
        print(host, address)
"""

CALL = """
import os, socket, sys
os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20.ardupilotmega import MAVLink
for host in sys.argv[1:]:
    mavlink = MAVLink(None, srcSystem=255, srcComponent=190)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as caller:
        caller.settimeout(3.0)
        try:
            caller.sendto(mavlink.heartbeat_encode(6, 8, 0, 0, 4).pack(mavlink), (host, 14540))
            caller.recv(4096)
            print(host, "answers")
        except OSError:
            print(host, "silent")
"""


def usage(formation: Formation) -> dict[str, tuple[float, float]]:
    """Cores and megabytes that each container takes, by service."""
    identifiers = {name: formation.container(name) for name in formation.services}
    text = formation.docker("stats", "--no-stream", "--format", USAGE, *identifiers.values())
    found = {}
    for name, line in zip(identifiers, text.splitlines(), strict=True):
        share, size, *_ = line.split()
        number, unit = re.fullmatch(r"([0-9.]+)(\w+)", size).groups()
        found[name] = (float(share.rstrip("%")) / 100.0, float(number) * UNITS_MB[unit])
    return found


def measured(formation: Formation) -> Flown:
    """Fly as a user does, and look at the containers meanwhile."""
    formation.begin_in_foreground()
    seen: dict[str, Any] = {"began_s": formation.began_s, "inspected": {}, "users": {}}
    formation.reach(MEASURED_S[0])
    begun, samples = time.monotonic(), []
    while time.monotonic() - begun < MEASURED_S[1] - MEASURED_S[0]:
        samples.append(usage(formation))
    seen["usage"] = samples
    for service in formation.services:
        seen["inspected"][service] = formation.inspect(service)
        seen["users"][service] = formation.inside(
            service, "sh", "-c", "cat /proc/[0-9]*/status | grep -E '^(Uid|CapEff|NoNewPrivs)'"
        )
    others = ("emulator-f2", "emulator-leader", "truth", "f2", "broker", "emulator-f1")
    seen["f1 finds"] = formation.inside("f1", "/opt/vfguide/bin/python", "-c", ASK, *others)
    addresses = {
        service: next(
            network["IPAddress"]
            for name, network in seen["inspected"][service]["NetworkSettings"]["Networks"].items()
            if "mavlink" in name
        )
        for service in ("emulator-f1", "emulator-f2")
    }
    answers = formation.inside("f1", "/opt/vfguide/bin/python", "-c", CALL, *addresses.values())
    seen["f1 hears"] = dict(
        zip(addresses, (line.split()[1] for line in answers.splitlines()), strict=True)
    )
    seen["written"] = formation.inside(
        "f1", "sh", "-c", "touch /opt/vfguide/x /x || true; ls -d /x /opt/vfguide/x || true"
    )
    return formation.finish_in_foreground(seen)


def plain(formation: Formation) -> Flown:
    """Fly and wait."""
    formation.start()
    return formation.finish()


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    duration = {name: str(flight_s) for name, flight_s in FLIGHT_S.items()}
    direct = content_of(on_the_circle(), "json")
    return {
        "windy": (
            measured,
            {"mission": content_of("circle-wind", "json"), "DURATION": duration["windy"]},
        ),
        "direct": (
            plain,
            {"mission": direct, "COMPOSE_PROFILES": "direct", "DURATION": duration["direct"]},
        ),
    }


@pytest.mark.parametrize("name", FLIGHT_S)
def test_a_formation_in_containers_keeps_the_missions_figures(flights, tell, name):
    flown = flights[name]
    tell(f"{name}: {json.dumps(flown.summary['formation'])}")
    assert flown.summary["accepted"], flown.summary["rejections"]
    assert flown.status == 0
    assert flown.summary["mode"] == "live"
    assert flown.summary["duration_s"] >= FLIGHT_S[name]
    assert flown.summary["latency"]


def test_the_judge_leaves_a_report(flights):
    names = {path.name for path in flights["windy"].directory.iterdir()}
    assert {"summary.json", "flight.npz", "report.html"} <= names


def test_all_containers_together_stay_within_their_budget(flights, tell):
    samples = flights["windy"].seen["usage"]
    tell(f"{'container':16} {'core':>6} {'MB':>6}   mean of {len(samples)} samples")
    mean = {
        service: tuple(sum(sample[service][n] for sample in samples) / len(samples) for n in (0, 1))
        for service in samples[0]
    }
    total_cores, total_mb = (sum(one[n] for one in mean.values()) for n in (0, 1))
    for service, (cores, megabytes) in {**mean, "all": (total_cores, total_mb)}.items():
        tell(f"{service:16} {cores:6.3f} {megabytes:6.1f}")
    assert total_cores < MOST_CORES
    assert total_mb < MOST_MB


def test_setpoints_begin_soon_after_the_containers(flights, tell):
    flown = flights["windy"]
    for vehicle in ("leader", "f1", "f2", "f3"):
        line = next(line for line in flown.logs[vehicle].splitlines() if "waiting -> " in line)
        first = datetime.fromisoformat(line.split()[0][:26] + "+00:00").timestamp()
        tell(f"{vehicle}: first setpoint {first - flown.seen['began_s']:.1f} s after `up`")


def test_every_container_is_healthy(flights):
    inspected = flights["windy"].seen["inspected"]
    health = {name: one["State"]["Health"]["Status"] for name, one in inspected.items()}
    assert health == dict.fromkeys(inspected, "healthy")


def test_no_container_runs_as_root_or_may_become_it(flights):
    for service, text in flights["windy"].seen["users"].items():
        fields = [line.split() for line in text.splitlines()]
        users = {user for name, *rest in fields if name == "Uid:" for user in rest}
        capabilities = {rest[0] for name, *rest in fields if name == "CapEff:"}
        privileges = {rest[0] for name, *rest in fields if name == "NoNewPrivs:"}
        assert users == {"10001"}, service
        assert {int(mask, 16) for mask in capabilities} == {0}, service
        assert privileges == {"1"}, service


def test_no_container_can_write_into_its_system(flights):
    seen = flights["windy"].seen
    assert seen["written"] == ""
    read_only = {one["HostConfig"]["ReadonlyRootfs"] for one in seen["inspected"].values()}
    assert read_only == {True}


def test_no_companion_reaches_the_autopilot_of_another(flights):
    seen = flights["windy"].seen
    found = dict(line.split() for line in seen["f1 finds"].splitlines())
    assert found.pop("broker") != "unknown"
    assert found.pop("emulator-f1") != "unknown"
    assert found.pop("f2") != "unknown"
    assert found == dict.fromkeys(("emulator-f2", "emulator-leader", "truth"), "unknown")
    assert seen["f1 hears"] == {"emulator-f1": "answers", "emulator-f2": "silent"}
