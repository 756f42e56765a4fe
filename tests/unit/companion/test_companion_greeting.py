"""Where it takes long to be heard, a companion waits for the others before it joins them."""

import pytest

from tests.kit.companion import new_flight
from tests.kit.missions import shipped
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of, flight_plan

GREETING_S = 8.0


def greeting(*, heard_s: dict[str, float]) -> float:
    """When f1 is steered first, s, if each of the others is heard from a time on."""
    one = new_flight()
    mission = shipped("line-calm")
    plan = flight_plan(mission, "f1")
    one.companion = Companion(
        plan, adapter_of(mission.vehicles["f1"]), engage=True, greeting_s=GREETING_S
    )
    for tenth in range(200):
        now = 0.1 * tenth
        one.run(now)
        if one.modes and one.modes[-1][1].steers:
            break
        for name, from_s in heard_s.items():
            if now >= from_s:
                one.companion.receive_neighbour(name, next(iter(one.link(now))), now)
    return one.now


def test_it_joins_at_once_where_all_are_heard():
    assert greeting(heard_s={"f2": 0.0, "f3": 0.0}) < 4.0


def test_it_waits_for_one_that_is_heard_late():
    assert greeting(heard_s={"f2": 0.0, "f3": 5.0}) == pytest.approx(6.0, abs=1.1)


def test_it_joins_without_one_that_is_never_heard():
    """Heartbeats, to which modes are commanded, come once a second."""
    assert greeting(heard_s={"f2": 0.0}) == pytest.approx(GREETING_S + 1.0, abs=1.1)
