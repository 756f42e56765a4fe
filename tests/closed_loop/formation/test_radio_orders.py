"""Formations that take orders over one emulated radio: agreed, flown, lost, void."""

import pytest

from tests.kit.missions import in_place, replaced
from vfguide.lab.rehearsal.radio_flight import RadioFlight, fly_by_radio
from vfguide.lab.report.figures import seen_from_leader
from vfguide.link.order_codec import Verdict

NAMES = ("leader", "f1", "f2", "f3")
AT_S = 12.0


def by_radio(duration_s: float, **rehearsal: object) -> RadioFlight:
    """A flight of the mission `shapes` by radio, everybody in its slot at its beginning, with one order."""
    mission = in_place("shapes", duration_s=duration_s, rate_hz=10.0, **rehearsal)
    orders = [{"at_s": AT_S, "shape": "trail", "spacing_m": 20}]
    return fly_by_radio(replaced(mission, orders=orders))


def words(flown: RadioFlight, name: str) -> str:
    return "\n".join(event.text for event in flown.flight.events[name])


def test_a_shape_is_agreed_and_flown_over_a_radio_that_loses_a_tenth():
    """A companion that begins anew after the order hears it from the others, pieces and all."""
    lost = [{"vehicle": "f1", "at_s": 20.0, "for_s": 2.0}]
    flown = by_radio(50.0, radio={"loss": 0.1}, losses=lost)
    assert flown.verdicts[1] == dict.fromkeys(NAMES, Verdict.FLOWN)
    assert "order 1: all have agreed" in words(flown, "leader")
    assert words(flown, "f1").count("order 1 is flown from now on") == 2
    assert flown.air["in collisions"] == 0
    record = flown.flight.record
    ahead = sorted(float(seen_from_leader(record.leader, one)[0][-1]) for one in record.followers)
    assert ahead == pytest.approx([-60.0, -40.0, -20.0], abs=0.5)


def test_an_order_that_one_cannot_hear_is_void_and_all_fly_on_as_before():
    """From the second before it is given to its time the radio of f2 is out."""
    lost = [{"vehicle": "f2", "at_s": 1.5, "for_s": AT_S, "what": "link"}]
    flown = by_radio(16.0, radio={}, losses=lost)
    assert Verdict.FLOWN not in flown.verdicts[1].values()
    assert "order 1 is void: f2 does not answer; all fly on as before" in words(flown, "leader")
    assert not any("is flown from now on" in words(flown, name) for name in NAMES)
