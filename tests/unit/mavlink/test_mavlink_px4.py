import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.mavlink.adapter import Vehicle
from vfguide.mavlink.codec import Codec
from vfguide.mavlink.px4 import Px4
from vfguide.state import Hold

Make = Callable[..., Any]


def sent(parsed: Make, messages: list[Any]) -> list[Any]:
    """The messages as the other side reads them."""
    received: list[Any] = parsed(Codec(7, 3).encode(messages))
    return received


@pytest.mark.parametrize(
    ("custom_mode", "engaged"),
    [
        (6 << 16, True),
        (6 << 16 | 3 << 24, True),
        (4 << 16 | 3 << 24, False),
        (4 << 16 | 6 << 24, False),
        (7 << 16, False),
        (6, False),
        (15, False),
        (0, False),
        (0x0106 << 16, True),
        (2**32 - 1, False),
    ],
)
def test_offboard_is_told_by_the_main_mode_alone(
    address: Make, custom_mode: int, engaged: bool
) -> None:
    assert Px4(address()).is_engaged(custom_mode) is engaged


def test_setpoints_have_to_arrive_before_offboard(address: Make) -> None:
    assert Px4(address()).streams_before_engaging


def test_a_course_goes_as_a_velocity_and_nothing_else(address: Make, parsed: Make) -> None:
    setpoint, _ = sent(parsed, Px4(address()).fly(math.radians(150.0), 20.0))
    assert setpoint.get_type() == "SET_POSITION_TARGET_LOCAL_NED"
    # Bits 0-2 position, 6-8 acceleration, 10 yaw, 11 yaw rate: 7 + 448 + 1024 + 2048.
    assert setpoint.type_mask == 3527
    assert setpoint.coordinate_frame == 1
    assert setpoint.vx == pytest.approx(-17.320508, abs=1e-5)
    assert setpoint.vy == pytest.approx(10.0, abs=1e-5)
    assert setpoint.vz == 0.0


def test_staying_ready_is_the_velocity_alone(address: Make, parsed: Make) -> None:
    plane = Px4(address())
    (setpoint,) = sent(parsed, plane.stay_ready(math.radians(150.0), 20.0))
    steering, _ = sent(parsed, plane.fly(math.radians(150.0), 20.0))
    assert setpoint.to_dict() == steering.to_dict()


@pytest.mark.parametrize(("hold", "speed_type"), [("heading-hold", 0.0), ("course-hold", 1.0)])
def test_a_speed_goes_by_command_and_leaves_the_throttle_alone(
    address: Make, parsed: Make, hold: Hold, speed_type: float
) -> None:
    _, speed = sent(parsed, Px4(address(hold)).fly(0.0, 17.25))
    assert speed.get_type() == "COMMAND_LONG"
    assert speed.command == 178
    assert (speed.param1, speed.param2, speed.param3) == (speed_type, 17.25, -1.0)


@pytest.mark.parametrize(
    ("act", "main_mode", "sub_mode"), [("engage", 6.0, 0.0), ("hand_back", 4.0, 3.0)]
)
def test_modes_are_set_by_main_and_sub_mode(
    address: Make, parsed: Make, act: str, main_mode: float, sub_mode: float
) -> None:
    (command,) = sent(parsed, getattr(Px4(address()), act)())
    assert command.get_type() == "COMMAND_LONG"
    assert command.command == 176
    assert (command.param1, command.param2, command.param3) == (1.0, main_mode, sub_mode)


def test_the_altitude_is_left_to_the_autopilot(address: Make) -> None:
    assert Px4(address()).hold_altitude(588.0) == []


def test_every_message_is_addressed_to_the_vehicle(address: Make, parsed: Make) -> None:
    plane = Px4(address())
    messages = [
        *plane.fly(1.0, 20.0),
        *plane.stay_ready(1.0, 20.0),
        *plane.engage(),
        *plane.hand_back(),
        *plane.request_telemetry(20.0),
    ]
    assert len(messages) == 7
    for message in sent(parsed, messages):
        assert (message.target_system, message.target_component) == (7, 3)


@settings(deadline=None, derandomize=True)
@given(course=st.floats(-1e4, 1e4), speed=st.floats(1.0, 100.0))
def test_the_velocity_points_along_any_course(parsed: Make, course: float, speed: float) -> None:
    vehicle = Vehicle(system_id=7, component_id=1, hold="heading-hold", lateral_acceleration=9.8)
    setpoint, _ = sent(parsed, Px4(vehicle).fly(course, speed))
    off = math.remainder(math.atan2(setpoint.vy, setpoint.vx) - course, 2.0 * math.pi)
    assert abs(off) < 1e-6
    assert math.hypot(setpoint.vx, setpoint.vy) == pytest.approx(speed, rel=1e-6)
