import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.companion import emulator, leader_bytes, new_flight
from tests.kit.missions import plan_of, shipped
from tests.kit.wire import parsed, spoken
from vfguide.companion.core import Companion
from vfguide.companion.mission_plan import adapter_of
from vfguide.companion.supervisor import Mode

MESSAGE_INTERVAL, HEADING = 511, 43_002


@pytest.fixture
def companion() -> Companion:
    """Of f1, with nothing around it."""
    return Companion(plan_of(), adapter_of(shipped("line-calm").vehicles["f1"]), engage=True)


def beat(*, custom_mode: int = 15) -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(1, 3, 129, custom_mode, 4, 3)


def position(boot_time_s: float) -> mavlink.MAVLink_global_position_int_message:
    # 20 m/s north; 89.93 degE7 to the metre.
    latitude = 473_977_420 + round(20.0 * 89.93 * boot_time_s)
    return mavlink.MAVLink_global_position_int_message(
        round(boot_time_s * 1e3), latitude, 85_455_940, 588_000, 100_000, 2000, 0, 0, 0
    )


def test_heartbeats_go_out_once_a_second():
    flown = new_flight(until_s=20.0)
    assert flown.times("HEARTBEAT") == [float(second) for second in range(21)]


def test_heartbeats_go_out_by_time_alone(companion):
    beats = [
        tenth / 10
        for tenth in range(51)
        for message in parsed(companion.poll(tenth / 10).to_autopilot)
        if message.get_type() == "HEARTBEAT"
    ]
    assert beats == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]


def test_a_heartbeat_is_an_onboard_computers(companion):
    (message,) = parsed(companion.poll(0.0).to_autopilot)
    assert (message.type, message.autopilot) == (18, 8)
    assert (message.get_srcSystem(), message.get_srcComponent()) == (2, 191)


def test_an_autopilot_that_was_never_heard_is_asked_for_nothing(companion):
    for second in range(5):
        messages = parsed(companion.poll(float(second)).to_autopilot)
        assert [message.get_type() for message in messages] == ["HEARTBEAT"]


def test_telemetry_is_asked_for_until_it_flows():
    flown = new_flight()
    flown.lose = frozenset({MESSAGE_INTERVAL})
    flown.run(5.5)
    # Position, airspeed, attitude and four messages of its health, each second from the first heartbeat on.
    assert flown.times(MESSAGE_INTERVAL) == [time for second in range(6) for time in [second] * 7]
    flown.lose = frozenset()
    flown.run(20.0)
    assert flown.times(MESSAGE_INTERVAL)[-1] <= 7.0


def test_telemetry_is_asked_for_again_after_a_reboot():
    flown = new_flight(until_s=20.0)
    assert flown.times(MESSAGE_INTERVAL)[-1] < 3.0
    flown.autopilot, flown.booted = emulator(), 20.0
    flown.run(30.0)
    later = [time for time in flown.times(MESSAGE_INTERVAL) if time > 20.0]
    assert later
    assert later[-1] <= 23.0


def test_telemetry_is_asked_for_again_when_it_has_stopped():
    flown = new_flight(until_s=10.0)
    flown.command(MESSAGE_INTERVAL, 33, -1)
    flown.run(20.0)
    assert [time for time in flown.times(MESSAGE_INTERVAL) if time > 10.0] == [12.0] * 7
    assert flown.times(HEADING)[-1] > 19.5


def test_without_telemetry_nothing_is_steered_by(companion):
    for step in range(41):
        companion.receive_link(leader_bytes(step / 20), step / 20)
        companion.receive_mavlink(spoken(beat(), position(step / 20)), step / 20)
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
        companion.receive_mavlink(spoken(beat(), position(step / 20)), step / 20)
    assert companion.receive_mavlink(spoken(position(0.5)), 0.52).to_autopilot == b""
    assert companion.receive_mavlink(spoken(position(0.45)), 0.53).to_autopilot == b""
    assert not companion.receive_mavlink(spoken(position(0.45)), 0.54).steered
    assert companion.receive_mavlink(spoken(position(0.55)), 0.55).steered


@pytest.mark.parametrize(
    ("command", "result", "text"),
    [
        (
            *(43_000, 4),
            (
                "autopilot answers MAV_CMD_GUIDED_CHANGE_SPEED: FAILED"
                " (not in GUIDED, or an airspeed outside AIRSPEED_MIN to AIRSPEED_MAX); be ready to take over"
            ),
        ),
        (
            *(43_002, 2),
            (
                "autopilot answers MAV_CMD_GUIDED_CHANGE_HEADING: DENIED"
                " (not in Guided Course, or a course that it does not take); be ready to take over"
            ),
        ),
        (
            *(176, 1),
            (
                "autopilot answers MAV_CMD_DO_SET_MODE: TEMPORARILY_REJECTED"
                " (it has no such mode or cannot fly it now; offboard wants setpoints first, at 2 Hz or more)"
                "; be ready to take over"
            ),
        ),
        (60_000, 2, "autopilot answers 60000: DENIED; be ready to take over"),
        (511, 200, "autopilot answers MAV_CMD_SET_MESSAGE_INTERVAL: 200"),
    ],
)
def test_a_refused_command_is_one_event_however_often_it_is_refused(
    companion, command, result, text
):
    refusal = spoken(mavlink.MAVLink_command_ack_message(command, result))
    events = [
        event
        for step in range(50)
        for event in companion.receive_mavlink(refusal, step / 10).events
    ]
    assert [(event.time_s, event.text) for event in events] == [(0.0, text)]


def test_each_kind_of_refusal_is_an_event(companion):
    refusals = [(43_000, 4), (43_000, 2), (43_002, 4), (43_000, 4)]
    data = spoken(*(mavlink.MAVLink_command_ack_message(*one) for one in refusals))
    assert len(companion.receive_mavlink(data, 0.0).events) == 3


def test_what_a_ground_station_was_refused_is_no_event(companion):
    data = spoken(mavlink.MAVLink_command_ack_message(43_000, 4, 0, 0, 255, 190))
    assert companion.receive_mavlink(data, 0.0).events == []


@pytest.mark.parametrize("result", [0, 5])
def test_an_accepted_command_is_no_event(companion, result):
    data = spoken(mavlink.MAVLink_command_ack_message(43_000, result))
    assert companion.receive_mavlink(data, 0.0).events == []


def test_what_the_autopilot_says_is_an_event(companion):
    data = spoken(mavlink.MAVLink_statustext_message(4, b"Battery low\x07"))
    (event,) = companion.receive_mavlink(data, 7.0).events
    assert (event.time_s, event.text) == (7.0, r"autopilot: Battery low\x07")


@pytest.mark.parametrize("severity", range(8))
def test_what_the_autopilot_says_is_worrying_from_a_warning_on(companion, severity):
    # MAV_SEVERITY: 0 is an emergency, 4 a warning, 5 a notice, 7 for debugging.
    data = spoken(mavlink.MAVLink_statustext_message(severity, b"Something"))
    (event,) = companion.receive_mavlink(data, 7.0).events
    assert event.warning is (severity <= 4)


@pytest.mark.parametrize(("interval_s", "asked"), [(0.069, False), (0.074, True)])
def test_telemetry_is_asked_for_again_below_seventy_percent_of_its_rate(
    companion, interval_s, asked
):
    # 20 Hz are asked for: 70 % of them are 14 Hz, every 71.4 ms
    numbers = []
    for step in range(60):
        now = step * interval_s
        out = companion.receive_mavlink(spoken(beat(), position(now)), now)
        if step > 20:
            numbers += [getattr(one, "command", None) for one in parsed(out.to_autopilot)]
    assert (MESSAGE_INTERVAL in numbers) is asked


def test_a_real_autopilot_that_refuses_is_reported_by_name():
    flown = new_flight(until_s=10.0)
    flown.pilot(12)
    # The heartbeat with the new mode is lost: setpoints go on and fail, which is said once each.
    flown.waiting = b""
    flown.run(13.0)
    assert [text for _, text in flown.events if "answers" in text] == [
        "autopilot answers MAV_CMD_GUIDED_CHANGE_HEADING: FAILED (not in GUIDED); be ready to take over",
        (
            "autopilot answers MAV_CMD_GUIDED_CHANGE_SPEED: FAILED"
            " (not in GUIDED, or an airspeed outside AIRSPEED_MIN to AIRSPEED_MAX); be ready to take over"
        ),
    ]
    assert flown.mode_at(13.0) is Mode.PILOT
