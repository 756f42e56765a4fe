import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.companion.distrust import AltitudeGate
from vfguide.companion.plan import FlightPlan
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.timing import SAME_CLOCK

Make = Callable[..., Any]


def judged(altitudes: list[float], interval_s: float = 1.0) -> list[bool]:
    """Which of these reports are believed."""
    gate = AltitudeGate()
    return [
        not math.isnan(gate.judge(altitude, number * interval_s))
        for number, altitude in enumerate(altitudes)
    ]


@given(st.lists(st.floats(-14.9, 14.9), min_size=1, max_size=50))
def test_what_an_aircraft_can_climb_is_believed(rates: list[float]) -> None:
    altitudes = [588.0]
    for rate in rates:
        altitudes.append(altitudes[-1] + rate)
    assert all(judged(altitudes))


@given(st.floats(26.0, 1000.0), st.sampled_from([-1.0, 1.0]))
def test_a_step_is_doubted_at_once(step: float, side: float) -> None:
    assert judged([588.0, 588.0, 588.0 + side * step]) == [True, True, False]


def test_steps_that_are_small_enough_one_by_one_do_not_add_up() -> None:
    # 12 m every tenth of a second; an aircraft dives or climbs by 1.5 m. 10.5 m are left over, then 21.
    altitudes = [588.0, 588.0, 588.0, 600.0, 612.0, 624.0, 636.0]
    assert judged(altitudes, interval_s=0.1) == [True, True, True, False, False, False, False]


def test_a_climb_at_ten_metres_a_second_is_believed_for_as_long_as_it_lasts() -> None:
    assert all(judged([588.0 + 1.0 * number for number in range(300)], interval_s=0.1))


def test_the_old_altitude_is_believed_again_after_two_seconds_of_agreement() -> None:
    # Doubted at 2 s and 3 s; back at 4 s, agreed with itself at 6 s.
    assert judged([588.0, 588.0, 688.0, 688.0, 588.0, 588.0, 588.0, 588.0]) == (
        [True] * 2 + [False] * 4 + [True] * 2
    )


def test_a_step_of_a_hundred_metres_that_stays_is_doubted_for_three_minutes() -> None:
    # 10 m and 0.5 m/s reach 100 m at 180 s after the last believed report, at 1 s.
    believed = judged([588.0] * 2 + [688.0] * 200)
    assert believed.index(True, 2) == 181


@pytest.mark.parametrize("step", [100.0, -100.0])
def test_a_neighbour_whose_altitude_steps_has_none(
    plan: Callable[..., FlightPlan], leader_bytes: Make, step: float
) -> None:
    receiver = StateReceiver(plan().frame, SAME_CLOCK)
    for number in range(20):
        time_s = number / 5
        altitude = 588.0 + (step if number >= 10 else 0.0)
        assert receiver.take(leader_bytes(time_s, altitude_amsl=altitude), time_s)
        assert receiver.newest is not None
        assert math.isnan(receiver.newest.altitude_amsl) is (number >= 10)
    assert [word.split(":")[0] for word in receiver.words()] == ["reports an altitude that steps"]
