"""What is heard has been under way for a while: the pilot may have selected another mode since."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, Truth
from tests.kit.companion import heard_until, leader_bytes, new_flight
from tests.kit.wire import parsed, spoken

Make = Callable[..., Any]

SET_MODE = 176
HASTY = {"prediction_s": 3.0, "breakaway_s": 2.0}
RTL = {"ardupilot": (11, 0), "px4": (4, 5)}
MANUAL = {"ardupilot": (0, 0), "px4": (1, 0)}
KINDS = ["ardupilot", "px4"]


@pytest.fixture
def without_time() -> Callable[[Any], Any]:
    """Makes an autopilot one that does not answer for its time."""

    class Untimed:
        def __init__(self, autopilot: Autopilot) -> None:
            self._autopilot = autopilot

        def advance(self, now: float) -> bytes:
            return self._kept(self._autopilot.advance(now))

        def receive(self, data: bytes) -> bytes:
            return self._kept(self._autopilot.receive(data))

        def truth(self) -> Truth:
            return self._autopilot.truth()

        def _kept(self, data: bytes) -> bytes:
            return spoken(*(one for one in parsed(data) if one.get_type() != "TIMESYNC"))

    return Untimed


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("modes", [RTL, MANUAL])
@pytest.mark.parametrize("before_s", [0.1, 0.8, 1.8, 2.8])
def test_a_mode_selected_while_telemetry_is_late_is_not_engaged_over(kind, modes, before_s):
    flown = new_flight(kind=kind, link=lambda now: [leader_bytes(now)] if now >= 10.0 else [])
    flown.late_s = 3.0
    flown.run(10.0 - before_s)
    flown.pilot(*modes[kind])
    selected = flown.autopilot.truth().mode
    flown.run(20.0)
    assert flown.times(SET_MODE) == []
    assert flown.autopilot.truth().mode == selected


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("late_s", "before_s"), [(1.5, 0.1), (1.5, 0.9), (2.2, 0.5), (3.0, 0.5)])
def test_a_companion_that_stops_does_not_undo_a_mode_that_it_has_not_heard_of(
    kind, late_s, before_s
):
    flown = new_flight(kind=kind)
    flown.run(20.0)
    flown.late_s = late_s
    flown.run(29.2)
    flown.pilot(*RTL[kind])
    flown.run(29.2 + before_s)
    flown.companion.stop(flown.now)
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.companion.released


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("after_s", [5.2, 5.6, 6.0, 6.4, 6.8])
def test_a_lost_leader_does_not_undo_a_mode_that_was_not_heard_of(kind, after_s):
    flown = new_flight(kind=kind, link=heard_until(25.0), patience=HASTY)
    flown.run(20.0)
    flown.late_s = 3.0
    flown.run(25.0 + after_s)
    flown.pilot(*RTL[kind])
    flown.run(50.0)
    assert flown.later(SET_MODE, 20.0) == []


def test_the_pilot_hears_that_late_telemetry_keeps_the_companion_from_handing_back():
    flown = new_flight(link=heard_until(25.0), patience=HASTY)
    flown.run(20.0)
    flown.late_s = 3.0
    flown.run(50.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    late = [text for _, text in flown.texts() if "telemetry comes late" in text]
    assert late == [
        (
            "vfguide f1: telemetry comes late: the autopilot's mode is not changed by this companion;"
            " check the radio, or select a mode by hand"
        )
    ]
    # In time again, it is handed back.
    flown.late_s = 0.0
    flown.run(60.0)
    assert flown.autopilot.truth().mode == "LOITER"


@pytest.mark.parametrize("late_s", [0.2, 0.5])
def test_an_ordinary_radio_is_quick_enough(late_s):
    flown = new_flight(link=heard_until(25.0), patience=HASTY)
    flown.late_s = late_s
    flown.run(20.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "LOITER"


def test_an_autopilot_that_never_answers_for_its_time_is_engaged_and_handed_back(without_time):
    flown = new_flight(link=heard_until(25.0), patience=HASTY)
    flown.autopilot = without_time(flown.autopilot)
    flown.run(20.0)
    assert flown.autopilot.truth().mode == "GUIDED"
    flown.run(40.0)
    assert flown.autopilot.truth().mode == "LOITER"


def test_answers_that_stay_away_end_the_right_to_command_modes(without_time):
    flown = new_flight(link=heard_until(25.0), patience=HASTY)
    flown.run(20.0)
    flown.autopilot = without_time(flown.autopilot)
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot.truth().mode == "GUIDED"


def test_answers_to_questions_that_nobody_asked_date_nothing(without_time):
    flown = new_flight(link=heard_until(25.0), patience=HASTY)
    flown.run(20.0)
    flown.autopilot = without_time(flown.autopilot)
    flown.forge = lambda now: spoken(
        mavlink.MAVLink_timesync_message(round(now * 1e9), round(now * 1e9) + 1)
    )
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []


@pytest.mark.parametrize("kind", KINDS)
def test_what_waited_while_the_companion_stood_still_for_a_moment_shows_no_mode(kind):
    flown = new_flight(kind=kind)
    flown.run(0.6)
    flown.hang(1.05)
    flown.pilot(*MANUAL[kind])
    flown.hang(1.7)
    flown.run(10.0)
    assert flown.times(SET_MODE) == []
    assert flown.autopilot.truth().mode == "MANUAL"
