import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from tests.kit.wire import framed as frame
from tests.kit.wire import heartbeat, position_report
from vfguide.lab.studies.latency import figures_of, formation
from vfguide.lab.studies.peers import has_position, has_setpoint
from vfguide.mission import check_mission


@pytest.mark.parametrize("autopilot", ["ardupilot", "px4"])
def test_measured_flight_has_no_errors(autopilot):
    mission = formation(50.0, autopilot)
    assert not [one for one in check_mission(mission) if one.severity == "error"]


def test_figures_of_a_hundred_and_of_none():
    figures = figures_of([number * 1e-3 for number in range(100, 0, -1)])
    assert figures == {"count": 100, "p50_ms": 50.0, "p99_ms": 99.0, "max_ms": 100.0}
    assert figures_of([]) == {"count": 0}


HEARTBEAT, POSITION = frame(heartbeat()), frame(position_report())
COURSE = frame(mavlink.MAVLink_command_int_message(1, 1, 0, 43002, 0, 0, 0, 90, 9, 0, 0, 0, 0))
SPEED = frame(mavlink.MAVLink_command_int_message(1, 1, 0, 43000, 0, 0, 0, 20, 0, 0, 0, 0, 0))
VELOCITY = frame(
    mavlink.MAVLink_set_position_target_local_ned_message(
        1, 1, 1, 1, 3527, 0, 0, 0, 15, 0, 0, 0, 0, 0, 0, 0
    )
)


def test_position_is_found_anywhere_in_a_datagram():
    assert has_position(HEARTBEAT + POSITION)
    assert not has_position(HEARTBEAT)
    assert not has_position(b"")


def test_setpoints_of_both_kinds_of_autopilot_are_found_and_a_speed_alone_is_none():
    assert has_setpoint(HEARTBEAT + COURSE + SPEED)
    assert has_setpoint(VELOCITY)
    assert not has_setpoint(HEARTBEAT + SPEED)


def test_bytes_that_are_no_frames_hold_nothing():
    assert not has_setpoint(b"\xfe\x09garbage" + COURSE)
    assert not has_setpoint(COURSE[:5])
