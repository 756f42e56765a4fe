from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.kit.autopilot import address, asked
from vfguide.mavlink.adapter import SetpointStream
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4

HEADING, SPEED = 43_002, 43_000


def commands(messages: list[Any]) -> list[int]:
    return [getattr(message, "command", 0) for message in messages]


def test_arduplane_hears_all_at_first_and_after_a_reset_and_else_what_has_changed_alone():
    plane = ArduPlane(address())
    stream = SetpointStream(plane)

    def due(course: float, speed: float, now: float) -> list[int]:
        return commands(stream.due(plane.fly(asked(course, speed)), now))

    assert due(1.0, 20.0, 0.0) == [HEADING, SPEED]
    assert due(1.0, 20.02, 0.1) == [SPEED]
    assert due(1.001, 20.02, 0.2) == [HEADING]
    assert due(1.001, 20.02, 0.3) == []
    # Less than a centimetre a second is no change.
    assert due(1.001, 20.024, 0.4) == []
    stream.reset()
    assert due(1.001, 20.02, 0.41) == [HEADING, SPEED]


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


@given(steps=st.lists(st.floats(0.001, 0.4), min_size=1, max_size=50))
def test_px4_never_waits_longer_than_offboard_bears(steps):
    plane = Px4(address(px4_steering="position"))
    stream = SetpointStream(plane)
    now = sent = 0.0
    stream.due(plane.fly(asked(1.0, 20.0)), now)
    for step in steps:
        now += step
        if stream.due(plane.fly(asked(1.0, 20.0)), now):
            # The report after the keep-alive time brings it: a fifth of a second, and one step more.
            assert now - sent <= 0.2 + step + 1e-9
            sent = now
