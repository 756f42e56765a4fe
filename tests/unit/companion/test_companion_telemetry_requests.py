"""Autopilots that cannot be asked for single messages, and heartbeats that come too seldom."""

from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import MESSAGE_INTERVAL, SET_MODE, Flight, new_flight
from tests.kit.wire import number_of, parsed, spoken
from vfguide.mavlink.announcements import Acknowledgements
from vfguide.mavlink.reports import CommandReport

STREAM, UNSUPPORTED = "REQUEST_DATA_STREAM", 3


def without_intervals(*, answers: bool, streams: bool = True) -> Flight:
    """Fly with an autopilot that sends positions only where it is asked for streams."""
    flown = new_flight()
    obey = flown.autopilot.receive

    def receive(data: bytes) -> bytes:
        said = b""
        for message in parsed(data):
            if number_of(message) != MESSAGE_INTERVAL:
                said += obey(bytes(message.get_msgbuf()))
            elif answers:
                said += spoken(mavlink.MAVLink_command_ack_message(MESSAGE_INTERVAL, UNSUPPORTED))
        return said

    def edited(message: MAVLink_message, _now: float) -> MAVLink_message | None:
        asked = streams and flown.times(STREAM)
        of_streams = message.get_type() in {"GLOBAL_POSITION_INT", "VFR_HUD"}
        return None if of_streams and not asked else message

    flown.autopilot.receive = receive  # type: ignore[method-assign]
    flown.edit = edited
    flown.run(14.0)
    return flown


@pytest.mark.parametrize("answers", [True, False])
def test_an_autopilot_without_message_intervals_is_asked_for_streams_and_flown(answers):
    flown = without_intervals(answers=answers)
    asked = flown.times(STREAM)
    assert asked[0] <= (2.5 if answers else 5.0)
    assert flown.mode_at(14.0).steers
    # Once positions come nothing is asked any more.
    assert flown.later(MESSAGE_INTERVAL, 8.0) == flown.later(STREAM, 8.0) == []
    assert not any("take over" in text for _, text in flown.events if "INTERVAL" in text)


def test_where_streams_bring_nothing_either_the_parameters_are_named():
    flown = without_intervals(answers=True, streams=False)
    (text,) = [text for _, text in flown.events if "sends no positions" in text]
    assert "set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1" in text


def test_heartbeats_that_come_too_seldom_to_engage_by_are_told_of():
    flown, beats = new_flight(), count()

    def seldom(message: MAVLink_message, _now: float) -> MAVLink_message | None:
        lost = message.get_type() == "HEARTBEAT" and next(beats) % 5 != 4
        return None if lost else message

    flown.edit = seldom
    flown.run(25.0)
    assert flown.times(SET_MODE) == []
    (text,) = [text for _, text in flown.events if "too seldom" in text]
    assert "a heartbeat comes every 5 s, too seldom to engage by: let one come each second" in text


@given(st.lists(st.tuples(st.integers(0, 65_535), st.integers(0, 255)), max_size=30))
def test_no_answer_to_a_question_makes_a_pilot_ready_to_take_over(answers):
    commands = Acknowledgements()
    for number, (command, result) in enumerate(answers):
        text = commands.answered(CommandReport(command=command, result=result), 20.0 * number)
        assert text is None or ("take over" in text) is (command not in {MESSAGE_INTERVAL, 512})
