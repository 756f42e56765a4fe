"""Autopilots that cannot be asked for single messages, and heartbeats that come too seldom."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import Flight, emulator, new_flight
from tests.kit.wire import number_of, packed, parsed, spoken
from vfguide.mavlink.announcements import Acknowledgements
from vfguide.mavlink.reports import CommandReport

INTERVAL, SET_MODE, STREAM = 511, 176, "REQUEST_DATA_STREAM"
UNSUPPORTED = 3


class WithoutIntervals:
    """An autopilot that sends positions only where it is asked for streams."""

    def __init__(self, *, answers: bool, streams: bool = True) -> None:
        self._autopilot = emulator()
        self._answers, self._streams = answers, streams
        self._asked = False

    def receive(self, data: bytes) -> bytes:
        said = b""
        for message in parsed(data):
            self._asked = self._asked or (self._streams and message.get_type() == STREAM)
            if number_of(message) == INTERVAL:
                ack = mavlink.MAVLink_command_ack_message(INTERVAL, UNSUPPORTED)
                said += spoken(ack) if self._answers else b""
            else:
                said += self._autopilot.receive(bytes(message.get_msgbuf()))
        return said

    def advance(self, now: float) -> bytes:
        said = parsed(self._autopilot.advance(now))
        kinds = {"GLOBAL_POSITION_INT", "VFR_HUD"}
        kept = [one for one in said if self._asked or one.get_type() not in kinds]
        return b"".join(bytes(one.get_msgbuf()) for one in kept)


def flown_by(autopilot: WithoutIntervals, until_s: float) -> Flight:
    flown = new_flight()
    flown.autopilot = autopilot  # type: ignore[assignment]
    flown.run(until_s)
    return flown


@pytest.mark.parametrize("answers", [True, False])
def test_an_autopilot_without_message_intervals_is_asked_for_streams_and_flown(answers):
    flown = flown_by(WithoutIntervals(answers=answers), 14.0)
    asked = flown.times(STREAM)
    assert asked[0] <= (2.5 if answers else 5.0)
    assert flown.mode_at(14.0).steers
    # Once positions come nothing is asked any more.
    assert flown.later(INTERVAL, 8.0) == flown.later(STREAM, 8.0) == []
    assert not any("take over" in text for _, text in flown.events if "INTERVAL" in text)


def test_where_streams_bring_nothing_either_the_parameters_are_named():
    flown = flown_by(WithoutIntervals(answers=True, streams=False), 14.0)
    (text,) = [text for _, text in flown.events if "sends no positions" in text]
    assert "set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1" in text


def test_heartbeats_that_come_too_seldom_to_engage_by_are_told_of():
    flown = new_flight()
    bare = flown.autopilot.advance
    beats = [0]

    def seldom(now: float) -> bytes:
        out = b""
        for one in parsed(bare(now)):
            beats[0] += one.get_type() == "HEARTBEAT"
            if one.get_type() != "HEARTBEAT" or beats[0] % 5 == 0:
                out += bytes(one.get_msgbuf())
        return out

    class Radio:
        advance = staticmethod(seldom)
        receive = staticmethod(flown.autopilot.receive)

    flown.autopilot = Radio()  # type: ignore[assignment]
    flown.run(25.0)
    assert flown.times(SET_MODE) == []
    (text,) = [text for _, text in flown.events if "too seldom" in text]
    assert "a heartbeat comes every 5 s, too seldom to engage by: let one come each second" in text


@given(st.lists(st.tuples(st.integers(0, 65_535), st.integers(0, 255)), max_size=30))
def test_no_answer_to_a_question_makes_a_pilot_ready_to_take_over(answers):
    commands = Acknowledgements()
    for number, (command, result) in enumerate(answers):
        text = commands.answered(CommandReport(command=command, result=result), 20.0 * number)
        assert text is None or ("take over" in text) is (command not in {INTERVAL, 512})
    assert packed() == b""
