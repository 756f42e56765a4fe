"""A mission that leaves it to be found out whether its vehicles slip is flown as one that says so."""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from vfguide.lab.rehearsal.lockstep import fly_lockstep
from vfguide.lab.report.metrics import summarise
from vfguide.mission import Mission, load_mission

MISSION = Path(__file__).parents[3] / "missions" / "ardupilot-sitl.yaml"

Fly = Callable[..., tuple[float, list[str]]]


@pytest.fixture(scope="module")
def fly() -> Fly:
    """Flies leader and f1 for 80 s round the circle; f1's mean error of the second half, and what was said.

    The emulator turns a share of what its bank says. Alpha is the autopilot's to tell: 1.03 1/s times it.
    """

    @cache
    def flown(share: float, *, slips: bool | str) -> tuple[float, list[str]]:
        content: dict[str, Any] = load_mission(MISSION).model_dump(exclude_unset=True)
        content["followers"] = content["followers"][:1]
        content["acceptance"] = {}
        content["rehearsal"]["duration_s"] = 80.0
        content["rehearsal"]["emulator"]["turn_efficiency"] = share
        content["vehicles"] = {name: content["vehicles"][name] for name in ("leader", "f1")}
        for vehicle in content["vehicles"].values():
            vehicle.update({"slips": slips, "response": "auto", "speed_hold": "total-energy"})
        record = fly_lockstep(Mission.model_validate(content)).record
        said = [event.text for event in record.events if "what its bank says" in event.text]
        return summarise(record).formation.mean_error_m, said

    return flown


def test_one_that_slips_is_flown_as_near_as_where_the_mission_says_so(fly: Fly) -> None:
    declared, silent = fly(0.745, slips=True)
    found, said = fly(0.745, slips="auto")
    assert silent == []
    assert len(said) == 2
    assert all("flown as a vehicle that slips" in text for text in said)
    assert found < 1.1 * declared + 0.02


def test_one_that_does_not_slip_loses_nothing(fly: Fly) -> None:
    declared, _ = fly(1.0, slips=False)
    found, said = fly(1.0, slips="auto")
    assert len(said) == 2
    assert all("it does not slip" in text for text in said)
    assert found < 1.1 * declared + 0.02


def test_a_share_that_is_not_the_usual_one_is_flown_by(fly: Fly) -> None:
    _, said = fly(0.6, slips="auto")
    assert all(text.startswith("it turns 0.6") for text in said)
