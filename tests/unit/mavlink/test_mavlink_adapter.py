from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.autopilot import address
from vfguide.mavlink.adapter import AutopilotSetpoint, SetpointStream, Vehicle
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4

Make = Callable[..., Any]


def asked(course: float, speed: float) -> AutopilotSetpoint:
    """Over 47 N 8 E, at 588 m."""
    return AutopilotSetpoint(
        course=course, speed=speed, altitude_amsl=588.0, latitude_deg=47.0, longitude_deg=8.0
    )


HEADING, SPEED = 43_002, 43_000


def commands(messages: list[Any]) -> list[int]:
    return [getattr(message, "command", 0) for message in messages]


def test_the_first_setpoint_is_sent_whole():
    plane = ArduPlane(address())
    assert commands(SetpointStream(plane).due(plane.fly(asked(1.0, 20.0)), 0.0)) == [HEADING, SPEED]


def test_arduplane_hears_what_has_changed_alone():
    plane = ArduPlane(address())
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert commands(stream.due(plane.fly(asked(1.0, 20.02)), 0.1)) == [SPEED]
    assert commands(stream.due(plane.fly(asked(1.001, 20.02)), 0.2)) == [HEADING]
    assert stream.due(plane.fly(asked(1.001, 20.02)), 0.3) == []


def test_px4_hears_the_speed_after_each_course_since_the_course_cancels_it():
    plane = Px4(address(px4_steering="position"))
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert commands(stream.due(plane.fly(asked(1.01, 20.0)), 0.05)) == [0, 178]


@pytest.mark.parametrize(
    ("kind", "steering", "keep_alive_s"),
    [
        (ArduPlane, "auto", 0.5),
        (Px4, "guided-course", 0.5),
        (Px4, "position", 0.2),
        (Px4, "velocity", 0.2),
    ],
)
def test_what_has_not_changed_is_repeated_at_the_keep_alive_rate(kind, steering, keep_alive_s):
    plane = kind(address(px4_steering=steering))
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert stream.due(plane.fly(asked(1.0, 20.0)), keep_alive_s - 0.01) == []
    assert len(stream.due(plane.fly(asked(1.0, 20.0)), keep_alive_s)) == 2


def test_less_than_a_centimetre_a_second_is_no_change():
    plane = ArduPlane(address())
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    assert stream.due(plane.fly(asked(1.0, 20.004)), 0.1) == []


def test_after_a_reset_everything_is_sent_anew():
    plane = ArduPlane(address())
    stream = SetpointStream(plane)
    stream.due(plane.fly(asked(1.0, 20.0)), 0.0)
    stream.reset()
    assert len(stream.due(plane.fly(asked(1.0, 20.0)), 0.01)) == 2


@given(steps=st.lists(st.floats(0.001, 0.4), min_size=1, max_size=50))
def test_px4_never_waits_longer_than_offboard_bears(steps):
    vehicle = Vehicle(
        system_id=7,
        component_id=1,
        hold="heading-hold",
        lateral_acceleration=9.8,
        px4_steering="position",
    )
    plane = Px4(vehicle)
    stream = SetpointStream(plane)
    now = sent = 0.0
    stream.due(plane.fly(asked(1.0, 20.0)), now)
    for step in steps:
        now += step
        if stream.due(plane.fly(asked(1.0, 20.0)), now):
            # The report after the keep-alive time brings it: a fifth of a second, and one step more.
            assert now - sent <= 0.2 + step + 1e-9
            sent = now
