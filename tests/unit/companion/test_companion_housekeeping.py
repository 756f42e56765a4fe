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
from tests.kit.wire import heartbeat, northbound, parsed, spoken, types_of
from vfguide.companion.core import Companion
from vfguide.companion.supervisor import Mode


@pytest.fixture
def companion() -> Companion:
    return companion_of()


def follows(companion: Companion, steps: int) -> None:
    """Hear leader and autopilot 20 times a second."""
    for step in range(steps):
        companion.receive_link(leader_bytes(step / 20), step / 20)
        companion.receive_mavlink(spoken(heartbeat(), northbound(step / 20)), step / 20)


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
    flown.run(20.0, lose=frozenset())
    assert flown.times(MESSAGE_INTERVAL)[-1] <= 7.0


def test_heartbeats_go_out_once_a_second_and_telemetry_is_asked_for_again_where_it_has_stopped():
    flown = new_flight(until_s=10.0)
    assert flown.times("HEARTBEAT") == [float(second) for second in range(11)]
    assert flown.times(MESSAGE_INTERVAL)[-1] < 3.0
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.run(20.0)
    assert flown.later(MESSAGE_INTERVAL, 10.0) == [12.0] * 7
    assert flown.times(HEADING)[-1] > 19.5
    flown.reboot()
    flown.run(30.0)
    assert 20.0 < flown.times(MESSAGE_INTERVAL)[-1] <= 23.0


def test_without_telemetry_nothing_is_steered_by(companion):
    follows(companion, 41)
    assert companion.snapshot.mode.steers
    out = companion.poll(3.1)
    assert companion.snapshot.mode is Mode.WAITING
    assert out.events
    types = types_of(parsed(out.to_autopilot))
    assert "HEARTBEAT" in types
    assert "COMMAND_INT" not in types


def test_a_duplicate_position_is_not_steered_by_twice(companion):
    follows(companion, 11)
    assert companion.receive_mavlink(spoken(northbound(0.5)), 0.52).to_autopilot == b""
    assert companion.receive_mavlink(spoken(northbound(0.45)), 0.53).to_autopilot == b""
    assert not companion.receive_mavlink(spoken(northbound(0.45)), 0.54).steered
    assert companion.receive_mavlink(spoken(northbound(0.55)), 0.55).steered


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
    flown.run(13.0, waiting=b"")
    assert [text.split(" (")[0] for text in flown.told("answers")] == [
        "autopilot answers MAV_CMD_GUIDED_CHANGE_HEADING: FAILED",
        "autopilot answers MAV_CMD_GUIDED_CHANGE_SPEED: FAILED",
    ]
    assert flown.mode is Mode.PILOT


STREAM, UNSUPPORTED = "REQUEST_DATA_STREAM", 3


def without_intervals(*, answers: bool, streams: bool = True) -> Flight:
    """Fly with an autopilot that sends positions only where it is asked for streams."""
    flown = new_flight()

    def edited(message: MAVLink_message, _now: float) -> MAVLink_message | None:
        asked = streams and flown.times(STREAM)
        of_streams = message.get_type() in {"GLOBAL_POSITION_INT", "VFR_HUD"}
        return None if of_streams and not asked else message

    refused = {"answers": {MESSAGE_INTERVAL: UNSUPPORTED}}
    lost = {"lose": frozenset({MESSAGE_INTERVAL})}
    flown.run(14.0, edit=edited, **(refused if answers else lost))
    return flown


@pytest.mark.parametrize("answers", [True, False])
def test_an_autopilot_without_message_intervals_is_asked_for_streams_and_flown(answers):
    flown = without_intervals(answers=answers)
    assert flown.times(STREAM)[0] <= (2.5 if answers else 5.0)
    assert flown.mode.steers
    # Once positions come nothing is asked any more.
    assert flown.later(MESSAGE_INTERVAL, 8.0) == flown.later(STREAM, 8.0) == []
    assert not any("take over" in text for text in flown.told("INTERVAL"))


def test_where_streams_bring_nothing_either_the_parameters_are_named():
    (text,) = without_intervals(answers=True, streams=False).told("sends no positions")
    assert "set SRx_POSITION, SRx_EXTRA2 and SRx_EXTRA1" in text


def test_heartbeats_that_come_too_seldom_to_engage_by_are_told_of():
    beats = count()

    def seldom(message: MAVLink_message, _now: float) -> MAVLink_message | None:
        lost = message.get_type() == "HEARTBEAT" and next(beats) % 5 != 4
        return None if lost else message

    flown = new_flight(edit=seldom, until_s=25.0)
    assert flown.times(SET_MODE) == []
    (text,) = flown.told("too seldom")
    assert "a heartbeat comes every 5 s, too seldom to engage by: let one come each second" in text
