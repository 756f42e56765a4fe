"""The leader is lost, the vehicle handed back, and then the leader is heard again."""

import pytest

from tests.kit.companion import (
    HASTY,
    KINDS,
    SET_MODE,
    heard_until,
    leader_bytes,
    new_flight,
)
from vfguide.companion.supervisor import Mode


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_handed_back_is_the_pilots_to_give_again(kind):
    # Engaging by itself happens once in a flight: nobody tells a hand-back from a pilot's LOITER for sure.
    flown = new_flight(kind=kind, link=heard_until(20.0, 30.5), patience=HASTY, until_s=30.45)
    assert flown.mode_at(30.45) is Mode.LOST
    loiter = flown.autopilot_mode
    flown.run(50.0)
    assert flown.mode_at(30.55) is Mode.WAITING
    assert flown.autopilot_mode == loiter
    assert flown.later(SET_MODE, 26.5) == []
    assert flown.texts()[-1][1].endswith("steered")
    flown.pilot("GUIDED", until_s=55.0)
    assert flown.mode_at(55.0).steers


@pytest.mark.parametrize(
    ("back_s", "taken_s", "modes"),
    [
        (30.0, 27.0, ["MANUAL"]),
        (30.0, 27.0, ["RTL"]),
        # And back into the loiter before the leader is heard.
        (30.0, 27.0, ["MANUAL", "LOITER"]),
        # Just when the leader is back.
        (30.1, 30.3, ["MANUAL"]),
    ],
)
def test_a_pilot_who_took_over_meanwhile_is_not_overruled(back_s, taken_s, modes):
    flown = new_flight(link=heard_until(20.0, back_s), patience=HASTY, until_s=taken_s)
    assert flown.mode_at(taken_s) is (Mode.LOST if taken_s < back_s else Mode.WAITING)
    assert flown.autopilot_mode == "LOITER"
    for mode in modes:
        flown.pilot(mode, until_s=flown.now + 1.0)
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.PILOT
    assert flown.autopilot_mode == modes[-1]
    assert flown.later(SET_MODE, 26.0) == []


def test_the_pilot_may_bring_guided_back():
    flown = new_flight(link=heard_until(20.0, 30.0), patience=HASTY, until_s=27.0)
    flown.pilot("MANUAL", until_s=40.0)
    flown.pilot("GUIDED", until_s=90.0)
    assert flown.mode_at(90.0) is Mode.TRACKING


def test_what_the_operator_did_not_allow_is_not_engaged_again():
    flown = new_flight(engage=False, link=heard_until(20.0, 30.0), patience=HASTY, until_s=2.0)
    flown.pilot("GUIDED", until_s=29.0)
    assert flown.mode_at(29.0) is Mode.LOST
    assert flown.autopilot_mode == "LOITER"
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.WAITING
    assert flown.autopilot_mode == "LOITER"
    assert flown.later(SET_MODE, 26.0) == []


def test_words_that_are_old_when_they_arrive_do_not_end_the_loss():
    flown = new_flight(link=heard_until(20.0), patience=HASTY, until_s=29.95)
    flown.link = lambda now: [leader_bytes(now - 6.0)]
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.LOST
    assert flown.autopilot_mode == "LOITER"
