"""Heartbeats, requests for telemetry, and what becomes of the autopilot's answers and words."""

from itertools import count

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message

from tests.kit.companion import (
    HEADING,
    MESSAGE_INTERVAL,
    SET_MODE,
    Flight,
    companion_of,
    leader_bytes,
    new_flight,
)
from tests.kit.wire import heartbeat, northbound, parsed, spoken
from vfguide.companion.core import Companion
from vfguide.companion.supervisor import Mode


@pytest.fixture
def companion() -> Companion:
    """Of f1, with nothing around it."""
    return companion_of()


def test_before_an_autopilot_is_heard_heartbeats_go_out_by_time_and_nothing_is_asked_for(companion):
    sent = [(n / 10, one) for n in range(51) for one in parsed(companion.poll(n / 10).to_autopilot)]
    assert [time for time, _ in sent] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert {one.get_type() for _, one in sent} == {"HEARTBEAT"}
    # Of a computer on board.
    assert {(one.type, one.autopilot) for _, one in sent} == {(18, 8)}
    assert {(one.get_srcSystem(), one.get_srcComponent()) for _, one in sent} == {(2, 191)}


def test_telemetry_is_asked_for_until_it_flows():
    flown = new_flight(lose=frozenset({MESSAGE_INTERVAL}), until_s=5.5)
    # Position, airspeed, attitude and four messages of its health, each second from the first heartbeat on.
    assert flown.times(MESSAGE_INTERVAL) == [time for second in range(6) for time in [second] * 7]
    flown.lose = frozenset()
    flown.run(20.0)
    assert flown.times(MESSAGE_INTERVAL)[-1] <= 7.0


def test_heartbeats_go_out_once_a_second_and_telemetry_is_asked_for_again_after_a_reboot():
    flown = new_flight(until_s=20.0)
    assert flown.times("HEARTBEAT") == [float(second) for second in range(21)]
    assert flown.times(MESSAGE_INTERVAL)[-1] < 3.0
    flown.reboot()
    flown.run(30.0)
    later = flown.later(MESSAGE_INTERVAL, 20.0)
    assert later
    assert later[-1] <= 23.0


def test_telemetry_is_asked_for_again_when_it_has_stopped():
    flown = new_flight(until_s=10.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.run(20.0)
    assert flown.later(MESSAGE_INTERVAL, 10.0) == [12.0] * 7
    assert flown.times(HEADING)[-1] > 19.5


def test_without_telemetry_nothing_is_steered_by(companion):
    for step in range(41):
        companion.receive_link(leader_bytes(step / 20), step / 20)
        companion.receive_mavlink(spoken(heartbeat(), northbound(step / 20)), step / 20)
    assert companion.snapshot.mode.steers
    out = companion.poll(3.1)
    assert companion.snapshot.mode is Mode.WAITING
    assert out.events
    types = {message.get_type() for message in parsed(out.to_autopilot)}
    assert "HEARTBEAT" in types
    assert "COMMAND_INT" not in types


def test_a_duplicate_position_is_not_steered_by_twice(companion):
    for step in range(11):
        companion.receive_link(leader_bytes(step / 20), step / 20)
        companion.receive_mavlink(spoken(heartbeat(), northbound(step / 20)), step / 20)
    assert companion.receive_mavlink(spoken(northbound(0.5)), 0.52).to_autopilot == b""
    assert companion.receive_mavlink(spoken(northbound(0.45)), 0.53).to_autopilot == b""
    assert not companion.receive_mavlink(spoken(northbound(0.45)), 0.54).steered
    assert companion.receive_mavlink(spoken(northbound(0.55)), 0.55).steered


def test_each_kind_of_refusal_is_one_event_however_often_it_comes(companion):
    refusals = [(43_000, 4), (43_000, 2), (43_002, 4), (43_000, 4)]
    data = spoken(*(mavlink.MAVLink_command_ack_message(*one) for one in refusals))
    heard = [companion.receive_mavlink(data, step / 10).events for step in range(50)]
    assert [event.time_s for events in heard for event in events] == [0.0] * 3


@pytest.mark.parametrize("answer", [(0,), (5,), (4, 0, 0, 255, 190)])
def test_what_is_accepted_or_was_refused_to_a_ground_station_is_no_event(companion, answer):
    data = spoken(mavlink.MAVLink_command_ack_message(43_000, *answer))
    assert companion.receive_mavlink(data, 0.0).events == []


@pytest.mark.parametrize("severity", range(8))
def test_what_the_autopilot_says_is_an_event_and_worrying_from_a_warning_on(companion, severity):
    # MAV_SEVERITY: 0 is an emergency, 4 a warning, 5 a notice, 7 for debugging.
    data = spoken(mavlink.MAVLink_statustext_message(severity, b"Battery low\x07"))
    (event,) = companion.receive_mavlink(data, 7.0).events
    assert (event.time_s, event.text) == (7.0, r"autopilot: Battery low\x07")
    assert event.warning is (severity <= 4)


@pytest.mark.parametrize(("interval_s", "asked"), [(0.069, False), (0.074, True)])
def test_telemetry_is_asked_for_again_below_seventy_percent_of_its_rate(
    companion, interval_s, asked
):
    # 20 Hz are asked for: 70 % of them are 14 Hz, every 71.4 ms
    numbers = []
    for step in range(60):
        now = step * interval_s
        out = companion.receive_mavlink(spoken(heartbeat(), northbound(now)), now)
        if step > 20:
            numbers += [getattr(one, "command", None) for one in parsed(out.to_autopilot)]
    assert (MESSAGE_INTERVAL in numbers) is asked


def test_a_real_autopilot_that_refuses_is_reported_by_name():
    flown = new_flight(until_s=10.0)
    flown.pilot("LOITER")
    # The heartbeat with the new mode is lost: setpoints go on and fail, which is said once each.
    flown.waiting = b""
    flown.run(13.0)
    answers = [text.split(" (")[0] for _, text in flown.events if "answers" in text]
    assert answers == [
        "autopilot answers MAV_CMD_GUIDED_CHANGE_HEADING: FAILED",
        "autopilot answers MAV_CMD_GUIDED_CHANGE_SPEED: FAILED",
    ]
    assert flown.mode_at(13.0) is Mode.PILOT


STREAM, UNSUPPORTED = "REQUEST_DATA_STREAM", 3


def without_intervals(*, answers: bool, streams: bool = True) -> Flight:
    """Fly with an autopilot that sends positions only where it is asked for streams."""
    flown = new_flight()

    def edited(message: MAVLink_message, _now: float) -> MAVLink_message | None:
        asked = streams and flown.times(STREAM)
        of_streams = message.get_type() in {"GLOBAL_POSITION_INT", "VFR_HUD"}
        return None if of_streams and not asked else message

    flown.edit = edited
    if answers:
        flown.answers = {MESSAGE_INTERVAL: UNSUPPORTED}
    else:
        flown.lose = frozenset({MESSAGE_INTERVAL})
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
