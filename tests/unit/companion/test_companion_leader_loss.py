from collections.abc import Callable
from typing import Any

import pytest

from vfguide.companion.supervisor import Mode

Make = Callable[..., Any]

SET_MODE, HEADING, SPEED = 176, 43_002, 43_000


@pytest.fixture
def until(leader_bytes: Make) -> Make:
    """A link on which the leader falls silent after some time, and speaks again after another."""

    def make(silent_s: float, back_s: float = 1e9) -> Callable[[float], list[bytes]]:
        def link(now: float) -> list[bytes]:
            return [leader_bytes(now)] if now <= silent_s or now >= back_s else []

        return link

    return make


def test_a_silent_leader_is_predicted_and_then_lost(flight: Make, until: Make) -> None:
    flown = flight(link=until(40.0))
    flown.run(60.0)
    assert flown.mode_at(40.55) is Mode.TRACKING
    assert flown.mode_at(40.65) is Mode.PREDICTING
    assert flown.mode_at(45.0) is Mode.PREDICTING
    assert flown.mode_at(45.05) is Mode.LOST
    changes = [text for time, text in flown.events if time > 40.0 and "->" in text]
    assert changes == ["tracking -> predicting", "predicting -> lost", "lost -> waiting"]


def test_while_predicting_it_flies_on_in_its_slot(flight: Make, until: Make, plan: Make) -> None:
    flown = flight(link=until(40.0))
    flown.run(45.0)
    truth = flown.autopilot.truth()
    north, east = plan().frame.to_local(truth.latitude_deg, truth.longitude_deg)
    # The leader would be at (900, 0), and the slot 20 m behind and 20 m left of it.
    assert (north, east) == (pytest.approx(880.0, abs=1.0), pytest.approx(-20.0, abs=1.0))
    assert flown.times(HEADING)[-1] == 45.0


def test_a_vehicle_whose_leader_is_lost_goes_back_to_its_autopilot(
    flight: Make, until: Make
) -> None:
    flown = flight(link=until(20.0))
    flown.run(25.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    flown.run(25.05)
    assert flown.autopilot.truth().mode == "LOITER"
    flown.run(60.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert flown.times(HEADING)[-1] == flown.times(SPEED)[-1] == 25.0


def test_px4_is_handed_back_to_its_hold(flight: Make, until: Make) -> None:
    flown = flight(kind="px4", link=until(20.0))
    flown.run(25.0)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "AUTO.LOITER"


def test_handing_back_is_tried_again_until_it_is_obeyed(flight: Make, until: Make) -> None:
    flown = flight(link=until(20.0))
    flown.run(25.0)
    flown.lose = frozenset({SET_MODE})
    flown.run(28.5)
    assert flown.mode_at(28.5) is Mode.LOST
    assert [time for time in flown.times(SET_MODE) if time > 20.0] == [25.05, 26.0, 27.0, 28.0]
    flown.lose = frozenset()
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert [time for time in flown.times(SET_MODE) if time > 28.5] == [29.0]


def test_once_handed_back_only_the_pilot_brings_guided_back(flight: Make, until: Make) -> None:
    flown = flight(link=until(20.0, 30.0))
    flown.run(40.0)
    assert flown.mode_at(40.0) is Mode.WAITING
    assert flown.autopilot.truth().mode == "LOITER"
    flown.pilot(15)
    flown.run(90.0)
    assert flown.mode_at(90.0) is Mode.TRACKING


def test_a_pilot_who_selects_guided_without_a_leader_gets_the_vehicle_back(
    flight: Make, until: Make
) -> None:
    flown = flight(link=until(20.0))
    flown.run(30.0)
    flown.pilot(15)
    flown.run(32.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert flown.times(HEADING)[-1] == 25.0


def test_a_leader_that_is_back_in_time_is_followed_again(flight: Make, until: Make) -> None:
    flown = flight(link=until(40.0, 44.0))
    flown.run(60.0)
    assert flown.mode_at(43.95) is Mode.PREDICTING
    assert flown.mode_at(44.0) is Mode.TRACKING
    assert flown.autopilot.truth().mode == "GUIDED"
    assert len(flown.times(SET_MODE)) == 1


def test_the_pilot_wins_over_a_lost_leader(flight: Make, until: Make) -> None:
    flown = flight(link=until(20.0))
    flown.run(22.0)
    flown.pilot(0)
    flown.run(40.0)
    assert flown.mode_at(40.0) is Mode.PILOT
    assert flown.autopilot.truth().mode == "MANUAL"
    assert [time for time in flown.times(SET_MODE) if time > 20.0] == []
