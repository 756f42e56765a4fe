import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.adapter import Vehicle, command_int, command_long
from vfguide.mavlink.announcements import NOTICE, Acknowledgements, status_texts
from vfguide.mavlink.reports import CommandReport

VEHICLE = Vehicle(system_id=7, component_id=1, hold="heading-hold", lateral_acceleration=9.8)
SPEED, HEADING = 43_000, 43_002
ACCEPTED, DENIED, FAILED = 0, 2, 4


def answer(command: int, result: int) -> CommandReport:
    return CommandReport(command=command, result=result)


def test_an_accepted_command_is_no_news_and_what_is_no_command_waits_for_no_answer():
    watch = Acknowledgements()
    watch.sent([command_int(VEHICLE, SPEED)], 0.0)
    watch.sent([mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)], 0.0)
    assert watch.answered(answer(SPEED, ACCEPTED), 0.1) is None
    assert watch.overdue(60.0) == []


BEYOND = "not in GUIDED, or an airspeed outside AIRSPEED_MIN to AIRSPEED_MAX"
NO_COURSE = "not in Guided Course, or a course that it does not take"
NO_MODE = (
    "it has no such mode or cannot fly it now; offboard wants setpoints first, at 2 Hz or more"
)
READY = "; be ready to take over"


@pytest.mark.parametrize(
    ("command", "result", "text"),
    [
        (SPEED, FAILED, f"MAV_CMD_GUIDED_CHANGE_SPEED: FAILED ({BEYOND}){READY}"),
        (HEADING, FAILED, f"MAV_CMD_GUIDED_CHANGE_HEADING: FAILED (not in GUIDED){READY}"),
        (HEADING, DENIED, f"MAV_CMD_GUIDED_CHANGE_HEADING: DENIED ({NO_COURSE}){READY}"),
        (176, 1, f"MAV_CMD_DO_SET_MODE: TEMPORARILY_REJECTED ({NO_MODE}){READY}"),
        # Numbers that nobody has named are told as numbers.
        (60_000, DENIED, f"60000: DENIED{READY}"),
        (60_000, 200, f"60000: 200{READY}"),
        # A question is no reason to take over.
        (511, 200, "MAV_CMD_SET_MESSAGE_INTERVAL: 200"),
    ],
)
def test_a_refusal_is_told_once_with_its_reason_and_again_after_a_while(command, result, text):
    watch = Acknowledgements()
    told = [watch.answered(answer(command, result), second / 10) for second in range(200)]
    assert [one for one in told if one] == [f"autopilot answers {text}"]
    assert watch.answered(answer(command, result), 30.0)


@given(st.lists(st.tuples(st.integers(0, 65_535), st.integers(0, 255)), max_size=30))
def test_no_answer_to_a_question_makes_a_pilot_ready_to_take_over(answers):
    watch = Acknowledgements()
    for number, (command, result) in enumerate(answers):
        text = watch.answered(answer(command, result), 20.0 * number)
        assert text is None or ("take over" in text) is (command not in {511, 512})


def test_each_kind_of_refusal_is_told():
    watch = Acknowledgements()
    for command, result in ((SPEED, FAILED), (SPEED, DENIED), (HEADING, FAILED)):
        assert watch.answered(answer(command, result), 0.0)


def test_a_command_that_is_never_answered_is_told_once():
    watch = Acknowledgements()
    for tenth in range(100):
        watch.sent([command_long(VEHICLE, SPEED)], tenth / 10)
    assert watch.overdue(2.9) == []
    assert watch.overdue(3.1) == [
        (
            "autopilot does not answer MAV_CMD_GUIDED_CHANGE_SPEED for 3 s:"
            " check the companion's uplink, and whether its firmware has it"
        )
    ]
    assert watch.overdue(9.0) == []
    watch.answered(answer(SPEED, ACCEPTED), 10.0)
    watch.sent([command_long(VEHICLE, SPEED)], 11.0)
    assert len(watch.overdue(15.0)) == 1


@pytest.mark.parametrize("length", [51, 99, 100, 101, 150, 249])
def test_a_long_text_arrives_whole_and_its_end_shows(length):
    text = "".join(chr(65 + index % 26) for index in range(length))
    messages = status_texts(text, NOTICE, 7)
    assert "".join(message.text for message in messages) == text
    assert {message.id for message in messages} == {7}
    assert [message.chunk_seq for message in messages] == list(range(len(messages)))
    # Ground stations know the last part by its being less than 50 characters long.
    sizes = [len(message.text) for message in messages]
    assert sizes[:-1] == [50] * (len(sizes) - 1)
    assert sizes[-1] < 50


def test_a_short_text_is_one_message_and_one_without_an_end_is_cut():
    (message,) = status_texts("vfguide f1: é", NOTICE, 7)
    assert (message.severity, message.text, message.id) == (5, "vfguide f1: ?", 0)
    messages = status_texts("x" * 1000, NOTICE, 7)
    assert [len(message.text) for message in messages] == [50, 50, 50, 50, 50, 49]
