import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.kit.autopilot import address, asked, sent
from vfguide.mavlink.ardupilot import ArduPlane


def test_guided_is_the_only_mode_that_obeys_and_setpoints_need_not_arrive_before():
    plane = ArduPlane(address())
    assert [mode for mode in range(30) if plane.is_engaged(mode)] == [15]
    assert not plane.is_engaged(6 << 16)
    assert not plane.streams_before_engaging


def test_a_course_goes_as_course_over_ground_with_a_lateral_acceleration():
    heading, _ = sent(ArduPlane(address()).fly(asked(math.pi / 2, 20.0)))
    assert (heading.get_type(), heading.command) == ("COMMAND_INT", 43_002)
    assert (heading.param1, heading.param2, heading.param4) == (0.0, 90.0, 0.0)
    assert heading.param3 == pytest.approx(9.80665, abs=1e-6)


@pytest.mark.parametrize(("hold", "speed_type"), [("heading-hold", 0.0), ("course-hold", 1.0)])
def test_a_speed_is_of_the_kind_that_the_vehicle_holds_and_not_slewed(hold, speed_type):
    _, speed = sent(ArduPlane(address(hold)).fly(asked(0.0, 17.25)))
    assert (speed.get_type(), speed.command) == ("COMMAND_INT", 43_000)
    assert (speed.param1, speed.param2, speed.param3) == (speed_type, 17.25, 0.0)


def test_an_altitude_is_above_mean_sea_level_and_the_climb_rate_left_to_the_autopilot():
    (altitude,) = sent(ArduPlane(address()).hold_altitude(588.5))
    assert (altitude.get_type(), altitude.command) == ("COMMAND_INT", 43_001)
    assert (altitude.frame, altitude.z, altitude.param3) == (0, 588.5, 0.0)


@pytest.mark.parametrize(("act", "mode"), [("engage", 15.0), ("hand_back", 12.0)])
def test_modes_are_set_by_command_with_the_custom_mode_flag(act, mode):
    (command,) = sent(getattr(ArduPlane(address()), act)())
    assert command.get_type() == "COMMAND_LONG"
    assert (command.command, command.param1, command.param2, command.param3) == (176, 1, mode, 0)


@pytest.mark.parametrize(("rate_hz", "interval_us"), [(20.0, 50_000.0), (30.0, 33_333.0)])
def test_position_and_airspeed_are_asked_for_at_the_rate(rate_hz, interval_us):
    commands = sent(ArduPlane(address()).request_telemetry(rate_hz))
    assert {command.command for command in commands} == {511}
    # 74 is VFR_HUD, 33 GLOBAL_POSITION_INT; twice a second SYS_STATUS, GPS_RAW_INT, BATTERY_STATUS
    # (147) and EKF_STATUS_REPORT.
    intervals = {command.param1: command.param2 for command in commands}
    assert intervals == {74: interval_us, 33: interval_us} | dict.fromkeys((1, 24, 147, 193), 5e5)


def test_every_message_is_addressed_to_the_vehicle():
    plane = ArduPlane(address())
    messages = [
        *plane.fly(asked(1.0, 20.0)),
        *plane.hold_altitude(500.0),
        *plane.engage(),
        *plane.hand_back(),
        *plane.request_telemetry(20.0),
    ]
    assert len(messages) == 11
    for message in sent(messages):
        assert (message.target_system, message.target_component) == (7, 3)


def course_on_the_wire(course: float) -> float:
    heading, _ = sent(ArduPlane(address()).fly(asked(course, 20.0)))
    return heading.param2


@pytest.mark.parametrize(
    ("course", "degrees"),
    [
        (0.0, 0.0),
        (-0.0, 0.0),
        (-1e-9, 0.0),
        (-1e-17, 0.0),
        (2.0 * math.pi, 0.0),
        (2.0 * math.pi - 1e-9, 0.0),
        (-math.pi / 2, 270.0),
        (5.0 * math.pi, 180.0),
        (math.radians(359.9994), 359.999),
        (math.radians(359.9996), 0.0),
    ],
)
def test_a_course_is_counted_as_a_compass_does(course, degrees):
    assert course_on_the_wire(course) == pytest.approx(degrees, abs=3e-5)


@settings(deadline=None, derandomize=True, max_examples=400)
@example(course=-5e-324)
@example(course=math.nextafter(2.0 * math.pi, 0.0))
@example(course=math.radians(359.9995))
@given(course=st.floats(-1e4, 1e4) | st.floats(-1e-3, 1e-3) | st.floats(6.2831, 6.2832))
def test_no_course_leaves_the_compass_after_single_precision(course):
    degrees = course_on_the_wire(course)
    assert 0.0 <= degrees < 360.0
    off = math.remainder(math.radians(degrees) - course, 2.0 * math.pi)
    assert abs(math.degrees(off)) < 6e-4
