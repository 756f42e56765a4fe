"""The leader is lost, the vehicle handed back, and then the leader is heard again."""

import pytest

from tests.kit.companion import heard_until, leader_bytes, new_flight
from vfguide.companion.supervisor import Mode

SET_MODE = 176
GUIDED, LOITER, MANUAL, RTL = 15, 12, 0, 11

HASTY = {"prediction_s": 3.0, "breakaway_s": 2.0}
"""The leader is lost 5 s after it was heard last."""


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_what_was_handed_back_is_the_pilots_to_give_again(kind):
    # Engaging by itself happens once in a flight: nobody tells a hand-back from a pilot's LOITER for sure.
    flown = new_flight(kind=kind, link=heard_until(20.0, 30.5), patience=HASTY, until_s=30.45)
    assert flown.mode_at(30.45) is Mode.LOST
    loiter = flown.autopilot.truth().mode
    flown.run(50.0)
    assert flown.mode_at(30.55) is Mode.WAITING
    assert flown.autopilot.truth().mode == loiter
    assert flown.later(SET_MODE, 26.5) == []
    assert flown.texts()[-1][1].endswith("steered")
    flown.pilot(*((GUIDED,) if kind == "ardupilot" else (4, 19)))
    flown.run(55.0)
    assert flown.mode_at(55.0).steers


@pytest.mark.parametrize("mode", [MANUAL, RTL])
def test_a_pilot_who_took_over_meanwhile_is_not_overruled(mode):
    flown = new_flight(link=heard_until(20.0, 30.0), patience=HASTY, until_s=27.0)
    flown.pilot(mode)
    flown.run(28.0)
    taken = flown.autopilot.truth().mode
    assert taken != "LOITER"
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.PILOT
    assert flown.autopilot.truth().mode == taken
    assert flown.later(SET_MODE, 26.0) == []


def test_a_pilot_who_took_over_and_went_back_to_the_loiter_is_not_overruled():
    flown = new_flight(link=heard_until(20.0, 30.0), patience=HASTY, until_s=27.0)
    flown.pilot(MANUAL)
    flown.run(28.0)
    flown.pilot(LOITER)
    flown.run(60.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert flown.later(SET_MODE, 26.0) == []


def test_a_pilot_who_takes_over_just_when_the_leader_is_back_is_not_overruled():
    flown = new_flight(link=heard_until(20.0, 30.1), patience=HASTY, until_s=30.3)
    assert flown.mode_at(30.3) is Mode.WAITING
    assert flown.autopilot.truth().mode == "LOITER"
    flown.pilot(MANUAL)
    flown.run(60.0)
    assert flown.autopilot.truth().mode == "MANUAL"
    assert flown.later(SET_MODE, 26.0) == []


def test_the_pilot_may_bring_guided_back():
    flown = new_flight(link=heard_until(20.0, 30.0), patience=HASTY, until_s=27.0)
    flown.pilot(MANUAL)
    flown.run(40.0)
    flown.pilot(GUIDED)
    flown.run(90.0)
    assert flown.mode_at(90.0) is Mode.TRACKING


def test_what_the_operator_did_not_allow_is_not_engaged_again():
    flown = new_flight(engage=False, link=heard_until(20.0, 30.0), patience=HASTY, until_s=2.0)
    flown.pilot(GUIDED)
    flown.run(29.0)
    assert flown.mode_at(29.0) is Mode.LOST
    assert flown.autopilot.truth().mode == "LOITER"
    flown.run(60.0)
    assert flown.mode_at(60.0) is Mode.WAITING
    assert flown.autopilot.truth().mode == "LOITER"
    assert flown.later(SET_MODE, 26.0) == []


def test_words_that_are_old_when_they_arrive_do_not_end_the_loss():
    def link(now: float) -> list[bytes]:
        return [leader_bytes(now if now <= 20.0 else now - 6.0)]

    flown = new_flight(
        link=lambda now: link(now) if now <= 20.0 or now >= 30.0 else [],
        patience=HASTY,
        until_s=60.0,
    )
    assert flown.mode_at(60.0) is Mode.LOST
    assert flown.autopilot.truth().mode == "LOITER"
