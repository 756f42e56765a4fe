"""What ground stations are told at each change of mode, and what a companion says when it stops."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import HASTY, KINDS, SET_MODE, heard_until, new_flight
from tests.kit.wire import heartbeat, parsed, spoken
from vfguide.companion.supervisor import Mode

LOITER = 12


def test_each_change_of_mode_is_told_to_ground_stations():
    flown = new_flight(link=heard_until(40.0, 50.0), patience=HASTY, until_s=52.0)
    flown.pilot("LOITER", until_s=54.0)
    assert [text for _, text in flown.texts()] == [
        f"vfguide f1: {text}"
        for text in (
            "steering to its place; leave GUIDED to take over",
            "in its place, nothing to do",
            "leader not heard, steering by its path; leave GUIDED to take over",
            "leader lost, flying away from the others; leave GUIDED to take over",
            "leader lost, handing back to the autopilot; select GUIDED once it is heard",
            "LOITER, not steering; select GUIDED to be steered",
        )
    ]
    changes = [time for time, text in flown.events if "->" in text]
    assert [time for time, _ in flown.texts()][:6] == changes


@pytest.mark.parametrize("kind", KINDS)
def test_stopping_hands_back_what_is_steered(kind):
    flown = new_flight(kind=kind, until_s=20.0)
    assert flown.companion.snapshot.mode.steers
    flown.sent.clear()
    out = flown.companion.stop(20.0)
    assert [event.text for event in out.events] == ["stopping: handing back"]
    assert (out.to_link, out.steered) == ([], False)
    assert not flown.companion.released
    flown.run(20.95)
    # The next heartbeat shows which mode would be left.
    assert flown.times(SET_MODE) == []
    flown.run(22.0)
    (data,) = [data for time, data in flown.sent if time == 21.0]
    (message,) = [one for one in parsed(data) if getattr(one, "command", 0) == SET_MODE]
    # MAV_CMD_DO_SET_MODE, custom mode enabled: LOITER, or main mode AUTO and sub mode LOITER.
    wanted = (1.0, 12.0, 0.0) if kind == "ardupilot" else (1.0, 4.0, 3.0)
    assert (message.param1, message.param2, message.param3) == wanted
    assert (message.target_system, message.get_srcSystem()) == (2, 2)
    assert flown.times(SET_MODE) == [21.0]
    assert flown.autopilot_mode == "LOITER"
    assert flown.companion.snapshot.mode is Mode.WAITING
    assert flown.companion.released


def test_stopping_while_breaking_away_hands_back():
    flown = new_flight(link=heard_until(20.0), patience={"prediction_s": 3.0}, until_s=25.0)
    assert flown.mode_at(25.0) is Mode.BREAKAWAY
    flown.companion.stop(25.0)
    flown.run(26.0)
    assert flown.autopilot_mode == "LOITER"


@pytest.mark.parametrize("begins", ["waiting", "pilot", "lost"])
def test_stopping_says_nothing_where_nothing_is_steered_and_releases_at_once(begins):
    flown = new_flight(
        engage=begins != "waiting", link=heard_until(10.0), patience=HASTY, until_s=8.0
    )
    if begins == "pilot":
        flown.pilot("LOITER")
    flown.run(20.0)
    assert flown.companion.snapshot.mode.value == begins
    out = flown.companion.stop(20.05)
    assert (out.to_autopilot, out.events) == (b"", [])
    assert flown.companion.released


def test_last_words_are_said_three_times_and_no_more():
    flown = new_flight(until_s=20.0)
    flown.lose = frozenset({SET_MODE})
    flown.companion.stop(20.0)
    flown.run(26.0)
    assert flown.later(SET_MODE, 20.0) == [21.0, 22.0, 23.0]
    assert not flown.companion.released


@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
def test_last_words_are_not_said_into_the_pilots_mode(mode):
    flown = new_flight(until_s=20.4)
    # Its heartbeat is lost, and the companion is stopped: SIGTERM a moment after the pilot's hand.
    flown.pilot(mode)
    flown.waiting = b""
    flown.companion.stop(20.4)
    flown.run(30.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot_mode == mode
    assert flown.companion.released


@pytest.mark.parametrize("mode", ["RTL", "MANUAL"])
@pytest.mark.parametrize("every_steps", [1, 3, 10])
def test_forged_heartbeats_and_a_stop_do_not_undo_the_pilot(mode, every_steps):
    flown = new_flight(until_s=20.0)
    flown.pilot(mode, until_s=22.0)
    flown.forge = lambda now: b"" if round(now * 20) % every_steps else spoken(heartbeat())
    flown.run(25.0)
    flown.companion.stop(25.0)
    flown.run(32.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot_mode == mode


@pytest.mark.parametrize("stops", [False, True])
def test_forged_heartbeats_are_not_believed_by_a_companion_that_hears_nothing_else(stops):
    flown = new_flight(link=heard_until(20.0), patience=HASTY, until_s=20.0)
    flown.deaf = True
    flown.run(20.5)
    flown.pilot("RTL")
    flown.forge = lambda _now: spoken(heartbeat())
    flown.run(28.0)
    if stops:
        flown.companion.stop(28.0)
    flown.run(40.0)
    assert flown.later(SET_MODE, 20.0) == []
    assert flown.autopilot_mode == "RTL"


@pytest.mark.parametrize("target", [(0, 0), (255, 190), (2, 191)])
def test_an_answer_alone_releases_nothing(target):
    flown = new_flight(until_s=20.0)
    flown.companion.stop(20.0)
    # MAV_CMD_DO_SET_MODE, accepted: of anybody's command, and heartbeats still show GUIDED.
    answer = mavlink.MAVLink_command_ack_message(SET_MODE, 0, 0, 0, *target)
    flown.companion.receive_mavlink(spoken(answer), 20.1)
    assert not flown.companion.released
    out = flown.companion.receive_mavlink(spoken(heartbeat(LOITER)), 20.2)
    assert flown.companion.released
    assert out.to_link == []
