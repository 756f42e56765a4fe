"""An autopilot that can only be engaged while setpoints arrive, and one that needs none."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from vfguide.companion.supervisor import Mode

Make = Callable[..., Any]

SET_MODE, CHANGE_SPEED, HEADING = 176, 178, 43_002
VELOCITY = "SET_POSITION_TARGET_LOCAL_NED"
ALTITUDE_CONTROL, OFFBOARD, AUTO, LOITER = 2, 6, 4, 3


def test_px4_hears_setpoints_before_it_is_asked_for_offboard(flight: Make) -> None:
    flown = flight(kind="px4")
    flown.run(40.0)
    setpoints = flown.times(VELOCITY)
    assert flown.times(SET_MODE)
    assert setpoints[0] < flown.times(SET_MODE)[0]
    assert flown.autopilot.truth().mode == "OFFBOARD"
    assert flown.mode_at(40.0) is Mode.TRACKING
    # A speed goes with every setpoint by which it is steered, and with no other.
    steered = [time for time in setpoints if flown.mode_at(time).steers]
    assert flown.times(CHANGE_SPEED) == steered


def test_px4_hears_setpoints_from_a_companion_that_may_not_engage(flight: Make) -> None:
    flown = flight(kind="px4", engage=False)
    flown.run(10.0)
    assert flown.later(VELOCITY, 5.0) == [pytest.approx(5.05 + 0.05 * k) for k in range(100)]
    assert flown.times(CHANGE_SPEED) == flown.times(SET_MODE) == []
    assert flown.autopilot.truth().mode == "AUTO.LOITER"


def test_the_pilot_can_select_offboard_for_a_companion_that_may_not_engage(flight: Make) -> None:
    flown = flight(kind="px4", engage=False)
    flown.run(10.0)
    flown.pilot(OFFBOARD)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    flown.run(50.0)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    assert flown.mode_at(50.0) is Mode.TRACKING
    assert flown.times(SET_MODE) == []


@pytest.mark.parametrize("mode", [(ALTITUDE_CONTROL, 0), (AUTO, LOITER)])
def test_px4_that_the_pilot_took_hears_the_stream_and_nothing_that_it_would_obey(
    flight: Make, mode: tuple[int, int]
) -> None:
    flown = flight(kind="px4")
    flown.run(10.0)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    flown.pilot(*mode)
    flown.run(20.0)
    assert flown.mode_at(20.0) is Mode.PILOT
    stream = flown.later(VELOCITY, 10.0)
    assert max(later - earlier for earlier, later in pairwise(stream)) <= 0.25 + 1e-6
    assert stream[-1] > 19.75
    assert flown.later(CHANGE_SPEED, 10.0) == flown.later(SET_MODE, 10.0) == []
    assert flown.autopilot.truth().mode == ("ALTCTL" if mode[0] == 2 else "AUTO.LOITER")


@pytest.mark.parametrize("vehicle", ["f1", "leader"])
def test_the_pilot_of_px4_can_select_offboard_again(flight: Make, vehicle: str) -> None:
    flown = flight(vehicle, kind="px4")
    flown.run(10.0)
    flown.pilot(AUTO, LOITER)
    flown.run(15.0)
    flown.pilot(OFFBOARD)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    flown.run(70.0)
    assert flown.autopilot.truth().mode == "OFFBOARD"
    assert flown.mode_at(70.0) is Mode.TRACKING


def test_px4_that_was_given_back_for_lack_of_a_leader_hears_no_stream(
    flight: Make, until: Make
) -> None:
    patience = {"prediction_s": 2.0, "breakaway_s": 2.0}
    flown = flight(kind="px4", link=until(10.0), patience=patience)
    flown.run(20.0)
    assert flown.mode_at(20.0) is Mode.LOST
    assert flown.later(VELOCITY, 10.0)
    assert flown.later(VELOCITY, 14.5) == []


def test_arduplane_hears_no_setpoints_while_it_is_not_engaged(flight: Make) -> None:
    waiting = flight(engage=False)
    waiting.run(10.0)
    assert waiting.times(HEADING) == waiting.times(VELOCITY) == []
    taken = flight()
    taken.run(10.0)
    taken.pilot(12)
    taken.run(20.0)
    assert taken.times(HEADING)
    assert taken.later(HEADING, 10.0) == taken.times(VELOCITY) == []
