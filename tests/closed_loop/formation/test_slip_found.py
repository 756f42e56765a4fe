"""A mission that leaves it to be found out whether its vehicles slip is flown as one that says so."""

from typing import Any

import numpy as np

from tests.kit.flight import fly
from tests.kit.missions import content_of
from vfguide.mission import Mission

LEARNED_S = 60.0
"""By then slip and response have been found, and what that changes is over."""


def slipping(share: float, *, slips: bool | str) -> tuple[float, list[str]]:
    """Flies leader and f1 for 80 s round the circle; f1's mean error of the last 20 s, and what was said.

    The emulator turns a share of what its bank says. Alpha is the autopilot's to tell: 1.03 1/s times it.
    """
    content: dict[str, Any] = content_of("ardupilot-sitl")
    content["followers"] = content["followers"][:1]
    content["acceptance"] = {}
    content["rehearsal"] |= {"duration_s": 80.0, "rate_hz": 12.5}
    content["rehearsal"]["emulator"]["turn_efficiency"] = share
    content["vehicles"] = {name: content["vehicles"][name] for name in ("leader", "f1")}
    for vehicle in content["vehicles"].values():
        vehicle.update({"slips": slips, "response": "auto", "speed_hold": "total-energy"})
    flown = fly(Mission.model_validate(content))
    said = [event.text for event in flown.record.events if "what its bank says" in event.text]
    learned = flown.record.time_s >= LEARNED_S
    return float(np.mean(flown.errors()[-1][learned])), said


def test_one_that_slips_is_flown_as_near_as_where_the_mission_says_so():
    declared, silent = slipping(0.745, slips=True)
    found, said = slipping(0.745, slips="auto")
    assert silent == []
    assert len(said) == 2
    assert all("flown as a vehicle that slips" in text for text in said)
    assert found < 1.1 * declared + 0.05


def test_one_that_does_not_slip_loses_nothing():
    declared, _ = slipping(1.0, slips=False)
    found, said = slipping(1.0, slips="auto")
    assert len(said) == 2
    assert all("it does not slip" in text for text in said)
    assert found < 1.1 * declared + 0.05


def test_a_share_that_is_not_the_usual_one_is_flown_by():
    _, said = slipping(0.6, slips="auto")
    assert all(text.startswith("it turns 0.6") for text in said)
