from pymavlink.dialects.v20 import ardupilotmega as mavlink

from vfguide.mavlink.adapter import Vehicle, command_int, command_long
from vfguide.mavlink.announcements import Acknowledgements
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


def test_a_refusal_is_told_once_with_its_reason_and_again_after_a_while():
    watch = Acknowledgements()
    told = [watch.answered(answer(SPEED, FAILED), second / 10) for second in range(200)]
    assert [text for text in told if text] == [
        (
            "autopilot answers MAV_CMD_GUIDED_CHANGE_SPEED: FAILED"
            " (not in GUIDED, or an airspeed outside AIRSPEED_MIN to AIRSPEED_MAX); be ready to take over"
        )
    ]
    assert watch.answered(answer(SPEED, FAILED), 30.0)


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


def test_numbers_that_nobody_has_named_are_told_as_numbers():
    assert (
        Acknowledgements().answered(answer(60_000, 200), 0.0)
        == "autopilot answers 60000: 200; be ready to take over"
    )
