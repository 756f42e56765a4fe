"""A pilot who may have flown unseen has flown: the vehicle is not engaged by itself any more."""

import pytest
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import KINDS, SET_MODE, Flight, heard_from, new_flight


def by_hand(flown: Flight) -> None:
    """Flying by hand for a moment."""
    flown.pilot("MANUAL")
    flown.pilot("LOITER")


def deaf(flown: Flight, until_s: float) -> None:
    """Nothing is heard for a while in which the pilot flies."""
    flown.deaf = True
    flown.run((flown.now + until_s) / 2.0)
    by_hand(flown)
    flown.run(until_s)
    flown.deaf = False


def hung(flown: Flight, until_s: float) -> None:
    """The companion stands still for a while in which the pilot flies."""
    flown.hang((flown.now + until_s) / 2.0)
    by_hand(flown)
    flown.hang(until_s)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_request_that_nobody_has_answered_is_forgotten_by_one_that_did_not_watch(kind, away):
    flown = new_flight(kind=kind)
    flown.lose = frozenset({SET_MODE})
    flown.run(5.5)
    assert flown.times(SET_MODE)
    away(flown, 20.0)
    flown.lose = frozenset()
    flown.run(50.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("away", [deaf, hung])
def test_a_vehicle_that_waits_for_its_leader_is_not_engaged_after_it_was_not_watched(kind, away):
    flown = new_flight(kind=kind, link=heard_from(20.0), until_s=4.0)
    away(flown, 14.0)
    flown.run(40.0)
    assert flown.times(SET_MODE) == []
    reasons = [text for _, text in flown.texts() if "heartbeats were not heard" in text]
    assert len(reasons) == 1
    assert reasons[0].endswith("to be steered")


def off(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """Positions 5 km off between 4 and 15 s."""
    if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0:
        message.lat += 500_000
    return message


def lost(message: MAVLink_message, now: float) -> MAVLink_message | None:
    """No positions between 4 and 15 s."""
    return None if message.get_type() == "GLOBAL_POSITION_INT" and 4.0 < now <= 15.0 else message


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("edit", [off, lost])
def test_flying_by_hand_without_positions_spends_the_right_to_engage(kind, edit):
    flown = new_flight(kind=kind, link=heard_from(18.0))
    flown.edit = edit
    flown.run(8.0)
    flown.pilot("MANUAL", until_s=12.0)
    flown.pilot("LOITER", until_s=40.0)
    assert flown.times(SET_MODE) == []
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("kind", KINDS)
def test_one_lost_heartbeat_hides_no_flight(kind):
    flown = new_flight(kind=kind, link=heard_from(10.0), until_s=5.5)
    flown.deaf = True
    flown.run(6.5)
    flown.deaf = False
    flown.run(20.0)
    assert len(flown.times(SET_MODE)) == 1
