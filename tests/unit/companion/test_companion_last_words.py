"""What ground stations are told at each change of mode, and what a companion says when it stops."""

from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.companion.supervisor import Mode
from vfguide.mavlink.announcements import status_text

Make = Callable[..., Any]

HASTY = {"prediction_s": 3.0, "breakaway_s": 2.0}
LOITER = 12


def test_each_change_of_mode_is_told_to_ground_stations(flight: Make, until: Make) -> None:
    flown = flight(link=until(40.0, 50.0), patience=HASTY)
    flown.run(52.0)
    flown.pilot(LOITER)
    flown.run(54.0)
    told = flown.texts()
    assert [text for _, text in told] == [
        f"vfguide f1: {mode}"
        for mode in (
            *("joining", "tracking", "predicting", "breakaway", "lost"),
            *("waiting", "joining", "pilot"),
        )
    ]
    changes = [time for time, text in flown.events if "->" in text]
    assert [time for time, _ in told] == changes


def test_a_text_is_a_notice_of_at_most_fifty_characters() -> None:
    message = status_text("vfguide " + "é" * 60)
    assert message.severity == 5
    assert message.text == "vfguide " + "?" * 42


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_stopping_hands_back_what_is_steered(flight: Make, parsed: Make, kind: str) -> None:
    flown = flight(kind=kind)
    flown.run(20.0)
    assert flown.companion.snapshot.mode.steers
    out = flown.companion.stop(20.05)
    (message,) = parsed(out.to_autopilot)
    # MAV_CMD_DO_SET_MODE, custom mode enabled: LOITER, or main mode AUTO and sub mode LOITER.
    wanted = (1.0, 12.0, 0.0) if kind == "ardupilot" else (1.0, 4.0, 3.0)
    assert message.command == 176
    assert (message.param1, message.param2, message.param3) == wanted
    assert (message.target_system, message.get_srcSystem()) == (2, 2)
    assert [event.text for event in out.events] == ["stopping: handing back"]
    assert (out.to_link, out.steered) == ([], False)
    flown.autopilot.receive(out.to_autopilot)
    assert flown.autopilot.truth().mode == ("LOITER" if kind == "ardupilot" else "AUTO.LOITER")
    assert flown.companion.snapshot.mode is Mode.WAITING


def test_stopping_while_breaking_away_hands_back(flight: Make, until: Make) -> None:
    flown = flight(link=until(20.0), patience={"prediction_s": 3.0})
    flown.run(25.0)
    assert flown.mode_at(25.0) is Mode.BREAKAWAY
    flown.autopilot.receive(flown.companion.stop(25.05).to_autopilot)
    assert flown.autopilot.truth().mode == "LOITER"


@pytest.mark.parametrize("begins", ["waiting", "pilot", "lost"])
def test_stopping_says_nothing_where_nothing_is_steered(
    flight: Make, until: Make, begins: str
) -> None:
    flown = flight(engage=begins != "waiting", link=until(10.0), patience=HASTY)
    flown.run(8.0)
    if begins == "pilot":
        flown.pilot(LOITER)
    flown.run(20.0)
    assert flown.companion.snapshot.mode.value == begins
    out = flown.companion.stop(20.05)
    assert (out.to_autopilot, out.events) == (b"", [])


def test_after_stopping_nothing_is_engaged_any_more(flight: Make) -> None:
    flown = flight()
    flown.run(20.0)
    flown.waiting += flown.autopilot.receive(flown.companion.stop(20.0).to_autopilot)
    flown.run(30.0)
    assert flown.autopilot.truth().mode == "LOITER"
    assert flown.later(176, 20.0) == []


@pytest.mark.parametrize("kind", ["ardupilot", "px4"])
def test_last_words_are_repeated_until_the_autopilot_answers(flight: Make, kind: str) -> None:
    flown = flight(kind=kind)
    flown.run(20.0)
    lost = flown.companion.stop(20.05).to_autopilot
    assert not flown.companion.released
    again = flown.companion.stop(20.15)
    assert len(again.to_autopilot) == len(lost)
    assert again.events == []
    answer = flown.autopilot.receive(again.to_autopilot)
    assert flown.companion.receive_mavlink(answer, 20.2).to_autopilot == b""
    assert flown.companion.released
    assert flown.companion.stop(20.25).to_autopilot == b""


def test_the_answer_to_a_ground_station_is_no_answer_to_the_last_words(
    flight: Make, spoken: Make
) -> None:
    flown = flight()
    flown.run(20.0)
    assert flown.companion.stop(20.05).to_autopilot  # and nobody hears it
    # MAV_CMD_DO_SET_MODE, accepted: a ground station has selected some mode, perhaps GUIDED again.
    for_station = mavlink.MAVLink_command_ack_message(176, 0, 0, 0, 255, 190)
    flown.companion.receive_mavlink(spoken(for_station), 20.1)
    assert not flown.companion.released
    assert flown.companion.stop(20.15).to_autopilot
    for_companion = mavlink.MAVLink_command_ack_message(176, 0, 0, 0, 2, 191)
    flown.companion.receive_mavlink(spoken(for_companion), 20.2)
    assert flown.companion.released


def test_a_heartbeat_shows_that_the_vehicle_flies_by_itself(flight: Make) -> None:
    flown = flight()
    flown.run(20.0)
    flown.autopilot.receive(flown.companion.stop(20.05).to_autopilot)
    assert not flown.companion.released
    # A second of telemetry, in which one heartbeat is; nothing of it is guided by.
    out = flown.companion.receive_mavlink(flown.autopilot.advance(21.1), 21.1)
    assert flown.companion.released
    assert (out.to_autopilot, out.to_link) == (b"", [])


def test_whoever_steers_nothing_is_released_at_once(flight: Make) -> None:
    flown = flight(engage=False)
    flown.run(5.0)
    flown.companion.stop(5.05)
    assert flown.companion.released
