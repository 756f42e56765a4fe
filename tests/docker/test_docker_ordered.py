"""Lost companions in containers, and an order from the console's to a formation that a deputy leads."""

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

LED_S = 14.0
"""After a leader's companion is killed: until a deputy has drawn in and the order is given."""

MOVED_S = 28.0
"""After an order is given: its 6 s, and the move."""

MOST_S = 300.0
"""On busy cores companions start late, and an order takes half a minute to come out of its container."""

SLOT_M = 1.5
"""From the slot that was ordered, on cores that ten containers share."""

APART_M = 5.0

LEADS_S = 3.0
"""Within which a deputy has to lead."""


def unix_time(text: str) -> float:
    """Of a time as Docker writes it, s."""
    return datetime.fromisoformat(text).timestamp()


def ordered(formation: Formation) -> Flown:
    """A follower's companion is killed and starts again, the leader's is gone for good, an order is given."""
    formation.start()
    for name in VEHICLES:
        formation.await_word(name, TRACKS)
    # From within: what an operator kills through Docker is not started again.
    formation.inside("f3", "sh", "-c", "kill -KILL $(cat /proc/1/task/1/children)", check=False)
    formation.await_word("f3", TRACKS, times=2)
    formation.compose("kill", "leader")
    seen: dict[str, Any] = {
        "restarts": formation.inspect("f3")["RestartCount"],
        "gone_unix_s": unix_time(formation.inspect("leader")["State"]["FinishedAt"]),
    }
    formation.reach(formation.time_s + LED_S)
    # The command in this container has an operator's key.
    words = ("order", "trail", "--spacing", f"{SPACING_M:g}")
    seen["order"] = formation.inside("console", *words)
    seen["ends_s"] = formation.time_s + MOVED_S
    formation.reach(seen["ends_s"])
    return formation.finish(seen)


def docker_flights() -> dict[str, Any]:
    """What is to be flown for the tests of this module."""
    settings = {
        "COMPOSE_PROFILES": "demo,console",
        "CONSOLE_ORDERS": "yes",
        "CONSOLE_PORT": str(free_port()),
        "DURATION": f"{MOST_S:g}",
        # An order is timed in real time.
        "SPEEDUP": "1",
    }
    mission = {**content_of(on_the_circle(), "json"), "deputies": ["f1", "f2"]}
    return {"ordered": (ordered, {"mission": mission, **settings})}


def test_a_deputy_leads_in_containers_and_its_formation_flies_an_order_one_that_was_killed_too(
    flights, tell
):
    flown = flights["ordered"]
    assert flown.seen["restarts"] == 1
    assert flown.logs["f3"].count("waiting -> ") >= 2
    line = next(one for one in flown.logs["f1"].splitlines() if "in place of" in one)
    leads_s = unix_time(line.split()[0]) - flown.seen["gone_unix_s"]
    assert leads_s < LEADS_S, line
    assert "leader:" not in flown.seen["order"]
    for name in ("f1", "f2", "f3"):
        assert f"{name}: flies it" in flown.seen["order"]
    record = flown.record
    f1, *others = record.followers
    row = int(record.time_s.searchsorted(flown.seen["ends_s"] - 1.0))
    found = [tuple(float(one[row]) for one in seen_from_leader(f1, other)) for other in others]
    away = [hypot(*one) for one in found]
    tell(f"a deputy led {leads_s:.1f} s after its leader was gone; its trail: {away} m")
    assert away == pytest.approx([SPACING_M, 2.0 * SPACING_M], abs=SLOT_M)
    # One behind the other, whichever way the deputy is pointing on its displaced path.
    assert 2.0 * found[0][1] == pytest.approx(found[1][1], abs=SLOT_M)


def test_nobody_comes_near_in_containers_while_shapes_and_leaders_change(flights, tell):
    least_m = flights["ordered"].least_separation_m(*VEHICLES)
    tell(f"least separation through an order and a lost leader: {least_m:.1f} m")
    assert least_m > APART_M
