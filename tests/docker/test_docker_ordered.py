"""Orders and a lost leader in containers: the console's container orders while companions are killed."""

from datetime import datetime
from math import hypot
from typing import Any

import pytest

from tests.docker.flown import Flown
from tests.docker.formation import VEHICLES, Formation
from tests.kit.missions import content_of, on_the_circle
from tests.kit.sockets import free_port
from vfguide.lab.report.figures import seen_from_leader

SPACING_M = 25.0

TRACKS = "-> tracking"
"""Written by a companion whose vehicle has come to its slot or path."""

MOVED_S = 28.0
"""After an order is given: its 6 s, and the move."""

BACK_S = 10.0
"""After a companion that was killed tracks again: until its vehicle is where it belongs."""

LED_S = 14.0
"""After a leader's companion is killed: until a deputy has drawn in and the next order is given."""

ENDS_S = 190.0
"""On busy cores companions start late, and an order takes half a minute to come out of its container."""

SLOT_M = 1.5
"""From the slot that was ordered, on cores that ten containers share."""

APART_M = 5.0

LEADS_S = 3.0
"""Within which a deputy has to lead."""


def order(formation: Formation, *words: str) -> str:
    """What the command in the console's container says, which has an operator's key."""
    return formation.inside("console", "order", *words)


def unix_time(text: str) -> float:
    """Of a time as Docker writes it, s."""
    return datetime.fromisoformat(text).timestamp()


def places(flown: Flown, leader: str, time_s: float) -> dict[str, tuple[float, float]]:
    """(forward, right) of every other vehicle in the course frame of one, m."""
    record = flown.record
    vehicles = {one.name: one for one in (record.leader, *record.followers)}
    row = int(record.time_s.searchsorted(time_s))
    found = {}
    for name, vehicle in vehicles.items():
        forward, right = seen_from_leader(vehicles[leader], vehicle)
        found[name] = (float(forward[row]), float(right[row]))
    return found


def ordered(formation: Formation) -> Flown:
    """An order, a follower's companion killed on the way; the leader's killed for good, another order."""
    formation.start()
    for name in VEHICLES:
        formation.await_word(name, TRACKS)
    seen: dict[str, Any] = {
        "first": order(formation, "line-abreast", "--spacing", f"{SPACING_M:g}")
    }
    given_s = formation.time_s
    # From within: what an operator kills through Docker is not started again.
    formation.inside("f3", "sh", "-c", "kill -KILL $(cat /proc/1/task/1/children)", check=False)
    formation.await_word("f3", TRACKS, times=2)
    formation.reach(max(given_s + MOVED_S, formation.time_s + BACK_S))
    seen["killed_s"] = formation.time_s
    formation.compose("kill", "leader")
    seen["gone_unix_s"] = unix_time(formation.inspect("leader")["State"]["FinishedAt"])
    formation.reach(seen["killed_s"] + LED_S)
    seen["second"] = order(formation, "trail", "--spacing", f"{SPACING_M:g}")
    return formation.finish(seen)


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    settings = {
        "COMPOSE_PROFILES": "demo,console",
        "CONSOLE_ORDERS": "yes",
        "CONSOLE_PORT": str(free_port()),
        "DURATION": f"{ENDS_S:g}",
    }
    mission = {**content_of(on_the_circle(), "json"), "deputies": ["f1", "f2"]}
    return {"ordered": (ordered, {"mission": mission, **settings})}


def test_an_order_from_a_container_is_flown_also_by_one_that_was_killed_meanwhile(flights, tell):
    flown = flights["ordered"]
    for name in VEHICLES:
        assert f"{name}: flies it" in flown.seen["first"]
    assert flown.logs["f3"].count("waiting -> ") >= 2
    found = places(flown, "leader", flown.seen["killed_s"])
    # f2 has the far place: on the right, where the mission has it, another is nearer.
    wanted = {"f1": -SPACING_M, "f3": SPACING_M, "f2": 2.0 * SPACING_M}
    off = {name: hypot(found[name][0], found[name][1] - right) for name, right in wanted.items()}
    tell(f"line abreast by an order in containers: at most {max(off.values()):.2f} m off")
    assert max(off.values()) < SLOT_M, found


def test_a_deputy_leads_in_containers_and_its_formation_takes_orders(flights, tell):
    flown = flights["ordered"]
    line = next(one for one in flown.logs["f1"].splitlines() if "in place of" in one)
    leads_s = unix_time(line.split()[0]) - flown.seen["gone_unix_s"]
    assert leads_s < LEADS_S, line
    assert "leader:" not in flown.seen["second"]
    for name in ("f1", "f2", "f3"):
        assert f"{name}: flies it" in flown.seen["second"]
    found = places(flown, "f1", ENDS_S - 1.0)
    away = [hypot(*found[name]) for name in ("f2", "f3")]
    tell(f"a deputy led {leads_s:.1f} s after its leader was gone; its trail: {away} m")
    assert away == pytest.approx([SPACING_M, 2.0 * SPACING_M], abs=SLOT_M)
    # One behind the other, whichever way the deputy is pointing on its displaced path.
    assert 2.0 * found["f2"][1] == pytest.approx(found["f3"][1], abs=SLOT_M)


def test_nobody_comes_near_in_containers_while_shapes_and_leaders_change(flights, tell):
    least_m = flights["ordered"].least_separation_m(*VEHICLES)
    tell(f"least separation through orders and a lost leader: {least_m:.1f} m")
    assert least_m > APART_M
