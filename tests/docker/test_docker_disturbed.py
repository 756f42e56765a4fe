"""One formation in containers that are cut off, hang, start again or lie, one after the other.

Times are those of the flight. Those who die, and who are lost for good, are seen in virtual time as well.
"""

import re
import secrets
import time
from concurrent.futures import ThreadPoolExecutor
from subprocess import PIPE, STDOUT, Popen
from typing import Any

from msgspec.structs import replace

from tests.docker.flown import Flown
from tests.docker.formation import Formation
from tests.docker.programs import run
from tests.kit.missions import content_of, on_the_circle
from vfguide.link.codec import decode, decode_envelope, encode

FOLLOWERS = ("f1", "f2", "f3")

IN_SLOT_M = 1.0

APART_M = 5.0
"""Least separation, also while somebody who has strayed comes back."""

DEAF_M = 5.0
"""How far a follower may be off that has not heard its leader for ten seconds, in the article's wind."""

CUT_GIVE_WAY_M = 40.0
"""How far others may leave their slots for one that is silent. In the article's wind, which swings, one that
holds its heading comes elsewhere than one that holds its course, and they keep clear of both: 17 and 26 m."""

GIVE_WAY_M = 4.0
"""The same for one that hangs and comes back to its slot."""

LINK = ("--cafile", "/var/lib/vfguide/trust/ca.pem", "-h", "broker", "-p", "8883")
LIE = "/dev/shm/lie"  # noqa: S108
STATE = "vfguide/circle-wind/leader/state"

SETTLED_S = 18.0
"""Companions take over some seconds after the start."""

FORGED_S = (14.0, 26.0)
IMPAIRED_S = (28.0, 48.0)
MEASURED_S = (56.0, 68.0)
CUT_S = (68.0, 78.0)
RESTARTED_S = 92.0
PAUSED_S = (110.0, 115.0)
ENDS_S = 150.0

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
    text = run("docker", "stats", "--no-stream", "--format", USAGE, *identifiers.values())
    found = {}
    for name, line in zip(identifiers, text.splitlines(), strict=True):
        share, size, *_ = line.split()
        number, unit = re.fullmatch(r"([0-9.]+)(\w+)", size).groups()
        found[name] = (float(share.rstrip("%")) / 100.0, float(number) * UNITS_MB[unit])
    return found


def client(formation: Formation, user: str, program: str, *options: str, check: bool = True) -> str:
    """Run a program of mosquitto's, with the rights of the container whose user it is."""
    command = 'exec "$0" -u "$VEHICLE" -P "$(cat /var/lib/vfguide/password/password)" "$@"'
    return str(formation.inside(user, "sh", "-c", command, program, *LINK, *options, check=check))


def forge(formation: Formation) -> dict[str, Any]:
    """As f3, tell the formation something of one's own; then, that the leader is a kilometre away."""
    heard = client(
        formation, "judge", "mosquitto_sub", "-t", STATE, "-C", "1", "-W", "60", "-F", "%x"
    )
    true = decode(decode_envelope(bytes.fromhex(heard.strip())).body)
    sequence = (true.sequence + 1000) % 2**32
    lie = encode(replace(true, latitude_deg=true.latitude_deg + 0.01, sequence=sequence))
    mark = secrets.token_hex(8)
    formation.reach(FORGED_S[0])
    with ThreadPoolExecutor() as pool:
        listening = pool.submit(
            client, formation, "judge", "mosquitto_sub", "-t", "vfguide/#", "-W", "6", "-F", "%t %x",
            check=False,
        )  # fmt: skip
        time.sleep(0.5)
        often = ("--repeat", "40", "--repeat-delay", "0.1")
        # The container's shell makes bytes of it: no option of a program can hold a zero.
        octal = "".join(f"\\{byte:03o}" for byte in lie)
        formation.inside("f3", "sh", "-c", f"printf '{octal}' > {LIE}")
        client(formation, "f3", "mosquitto_pub", "-t", "vfguide/circle-wind/f3/reply", "-m", mark)
        client(formation, "f3", "mosquitto_pub", "-t", STATE, "-f", LIE, *often)
        lines = listening.result().split("\n")
    return {
        "lies heard": sum(lie.hex() in line for line in lines),
        "own words heard": sum(mark.encode().hex() in line for line in lines),
        "states heard": sum(STATE in line for line in lines),
    }


def refused(formation: Formation) -> str:
    """What a companion says that has a wrong password, and an autopilot that is not there."""
    wrong = ("VEHICLE=f3", "VFGUIDE_LINK_PASSWORD=wrong", "INSECURE=--insecure", "STATE=/tmp")
    words = (*wrong, "MAVLINK=udpin://127.0.0.1:14999", "timeout", "60", "run-companion")
    command = ("docker", "exec", formation.container("judge"), "env", *words)
    said = ""
    with Popen(command, stdout=PIPE, stderr=STDOUT, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            said += line
            if "refused" in line:
                break
        process.kill()
    return said


def reached_from_f1(formation: Formation, inspected: dict[str, Any]) -> dict[str, dict[str, str]]:
    """Of which names f1 finds an address, and which autopilots answer it."""
    python = ("f1", "/opt/vfguide/bin/python", "-c")
    others = ("emulator-f2", "emulator-leader", "truth", "f2", "broker", "emulator-f1")
    networks = {
        service: inspected[service]["NetworkSettings"]["Networks"]
        for service in ("emulator-f1", "emulator-f2")
    }
    addresses = {
        service: next(one["IPAddress"] for name, one in found.items() if "mavlink" in name)
        for service, found in networks.items()
    }
    found = formation.inside(*python, ASK, *others)
    answers = formation.inside(*python, CALL, *addresses.values())
    said = (line.split()[1] for line in answers.splitlines())
    return {
        "finds": dict(line.split() for line in found.splitlines()),
        "hears": dict(zip(addresses, said, strict=True)),
    }


def troubled(formation: Formation) -> Flown:
    """One trouble after the other, with time to recover in between, and a look at the containers."""
    formation.start()
    with ThreadPoolExecutor() as pool:
        stranger = pool.submit(refused, formation)
        seen: dict[str, Any] = {"forged": forge(formation)}
        seen["refused"] = stranger.result()
    formation.reach(IMPAIRED_S[0])
    seen["impaired"] = formation.impair("broker", IMPAIRED_S[1], delay_s=0.2, loss=0.2)
    formation.reach(MEASURED_S[0])
    seen["inspected"] = {service: formation.inspect(service) for service in formation.services}
    samples = []
    while formation.time_s < MEASURED_S[1]:
        samples.append(usage(formation))
    seen["usage"] = samples
    formation.reach(CUT_S[0])
    formation.cut_off("f2")
    formation.reach(CUT_S[1])
    formation.let_back("f2")
    formation.reach(RESTARTED_S)
    run("docker", "restart", "--time", "1", formation.container("broker"))
    formation.reach(PAUSED_S[0])
    run("docker", "pause", formation.container("f1"))
    formation.reach(PAUSED_S[1])
    run("docker", "unpause", formation.container("f1"))
    formation.reach(ENDS_S)
    # Programs in containers are begun when nothing is judged any more: they take the processor.
    status = "cat /proc/[0-9]*/status | grep -E '^(Uid|CapEff|NoNewPrivs)'"
    seen["users"] = {
        service: formation.inside(service, "sh", "-c", status) for service in formation.services
    }
    write = "touch /opt/vfguide/x /x || true; ls -d /x /opt/vfguide/x || true"
    seen["written"] = formation.inside("f1", "sh", "-c", write)
    seen["f1"] = reached_from_f1(formation, seen["inspected"])
    return formation.finish(seen)


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    mission = content_of(on_the_circle(), "json")
    return {"troubled": (troubled, {"mission": mission, "DURATION": str(2.0 * ENDS_S)})}


def test_who_publishes_as_the_leader_is_heard_by_nobody(flights):
    flown = flights["troubled"]
    assert flown.seen["forged"]["lies heard"] == 0
    assert flown.seen["forged"]["own words heard"] >= 1
    assert flown.seen["forged"]["states heard"] >= 20
    assert flown.greatest(SETTLED_S, IMPAIRED_S[0], *FOLLOWERS) < IN_SLOT_M


def test_a_companion_with_the_wrong_password_is_told_so_and_joins_nobody(flights):
    said = flights["troubled"].seen["refused"]
    assert "refused: wrong user name or password" in said
    assert "waiting -> " not in said


def test_a_slow_and_lossy_link_costs_little(flights, tell):
    flown = flights["troubled"]
    errors = [flown.errors(name, *IMPAIRED_S) for name in FOLLOWERS]
    mean_m = sum(float(one.mean()) for one in errors) / len(errors)
    off_m = max(float(one.max()) for one in errors)
    tell(
        f"200 ms and 20 % loss: mean {mean_m:.2f} m, at most {off_m:.2f} m off; {flown.seen['impaired']}"
    )
    assert mean_m < 1.0
    assert off_m < 5.0
    assert flown.greatest(CUT_S[0] - 3.0, CUT_S[0], *FOLLOWERS) < IN_SLOT_M


def test_a_follower_that_is_cut_off_for_ten_seconds_stays_near_its_slot(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(*CUT_S, "f2")
    others_m = flown.greatest(CUT_S[0], RESTARTED_S, "f1", "f3")
    tell(f"cut off for 10 s: at most {off_m:.2f} m off, the others {others_m:.2f} m")
    assert "predicting" in flown.modes("f2")
    assert off_m < DEAF_M
    assert others_m < CUT_GIVE_WAY_M
    assert flown.greatest(RESTARTED_S - 3.0, RESTARTED_S, *FOLLOWERS) < IN_SLOT_M


def test_a_formation_flies_on_while_its_broker_starts_again(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(RESTARTED_S, PAUSED_S[0], *FOLLOWERS)
    tell(f"broker started again: at most {off_m:.2f} m off")
    assert off_m < 2.0
    assert flown.greatest(PAUSED_S[0] - 3.0, PAUSED_S[0], *FOLLOWERS) < IN_SLOT_M


def test_a_follower_whose_companion_hangs_for_five_seconds_comes_back(flights, tell):
    flown = flights["troubled"]
    off_m = flown.greatest(PAUSED_S[0], ENDS_S, "f1")
    others_m = flown.greatest(PAUSED_S[0], ENDS_S, "f2", "f3")
    tell(f"paused for 5 s: at most {off_m:.1f} m off, the others {others_m:.2f} m")
    assert others_m < GIVE_WAY_M
    assert flown.greatest(ENDS_S - 3.0, ENDS_S, *FOLLOWERS) < IN_SLOT_M


def test_aircraft_stay_apart_through_all_troubles(flights, tell):
    least_m = flights["troubled"].least_separation_m("leader", *FOLLOWERS)
    tell(f"least separation through all troubles: {least_m:.1f} m")
    assert least_m > APART_M


def test_all_containers_together_stay_within_their_budget(flights, tell):
    samples = flights["troubled"].seen["usage"]
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


def test_every_container_is_healthy(flights):
    inspected = flights["troubled"].seen["inspected"]
    health = {name: one["State"]["Health"]["Status"] for name, one in inspected.items()}
    assert health == dict.fromkeys(inspected, "healthy")


def test_no_container_runs_as_root_or_may_become_it(flights):
    for service, text in flights["troubled"].seen["users"].items():
        fields = [line.split() for line in text.splitlines()]
        users = {user for name, *rest in fields if name == "Uid:" for user in rest}
        capabilities = {rest[0] for name, *rest in fields if name == "CapEff:"}
        privileges = {rest[0] for name, *rest in fields if name == "NoNewPrivs:"}
        assert users == {"10001"}, service
        assert {int(mask, 16) for mask in capabilities} == {0}, service
        assert privileges == {"1"}, service


def test_no_container_can_write_into_its_system(flights):
    seen = flights["troubled"].seen
    assert seen["written"] == ""
    read_only = {one["HostConfig"]["ReadonlyRootfs"] for one in seen["inspected"].values()}
    assert read_only == {True}


def test_no_companion_reaches_the_autopilot_of_another(flights):
    seen = flights["troubled"].seen
    found = seen["f1"]["finds"]
    assert found.pop("broker") != "unknown"
    assert found.pop("emulator-f1") != "unknown"
    assert found.pop("f2") != "unknown"
    assert found == dict.fromkeys(("emulator-f2", "emulator-leader", "truth"), "unknown")
    assert seen["f1"]["hears"] == {"emulator-f1": "answers", "emulator-f2": "silent"}
