"""How a planned height goes over to another one."""

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.guidance.height import HeightTarget, held_height
from vfguide.guidance.height_change import (
    ACCELERATION,
    SHARE,
    ClimbLimits,
    HeightMotion,
    change_duration,
    changed_height,
    closing_rate,
    stopping_way,
    target_on_the_way,
)

LIMITS = ClimbLimits(climb=4.0, sink=3.0)

RATE_HZ = 20.0


def climbing(height: float, climb_rate: float) -> HeightTarget:
    return HeightTarget(height=height, climb_rate=climb_rate, ahead=height)


def flown(
    target: HeightTarget, limits: ClimbLimits, *, height: float, climb_rate: float, during_s: float
) -> list[HeightMotion]:
    """A change towards a target that climbs on, looked at 20 times a second."""
    found = [HeightMotion(time_s=0.0, height=height, climb_rate=climb_rate)]
    for number in range(1, round(during_s * RATE_HZ) + 1):
        time_s = number / RATE_HZ
        then = climbing(target.height + target.climb_rate * time_s, target.climb_rate)
        found.append(changed_height(found[-1], then, time_s, limits))
    return found


@pytest.mark.parametrize(("change", "fastest"), [(60.0, 2.0), (-60.0, -1.5)])
def test_a_change_is_flown_at_half_of_what_every_vehicle_climbs_and_descends_by(change, fastest):
    # 30 s at 2 m/s up, 40 s at 1.5 m/s down, and some to begin and to end.
    way = flown(held_height(100.0 + change), LIMITS, height=100.0, climb_rate=0.0, during_s=60.0)
    rates = [one.climb_rate for one in way]
    assert max(rates, key=abs) == pytest.approx(fastest)
    assert way[-1].is_at(held_height(100.0 + change))
    # It does not go past its end.
    assert all(min(0.0, change) <= one.height - 100.0 <= max(0.0, change) + 1e-6 for one in way)
    over_s = next(one.time_s for one in way if one.is_at(held_height(100.0 + change)))
    assert change_duration(change, LIMITS) == pytest.approx(over_s, abs=4.0)


@given(
    height=st.floats(-200.0, 200.0),
    climb_rate=st.floats(-2.0, 2.0),
    along=st.floats(-3.0, 4.0),
    climb=st.floats(1.0, 8.0),
    sink=st.floats(1.0, 8.0),
)
def test_the_climb_rate_changes_evenly_and_is_beyond_no_limit_that_the_path_keeps(
    height, climb_rate, along, climb, sink
):
    limits = ClimbLimits(climb=climb, sink=sink)
    way = flown(climbing(0.0, along), limits, height=height, climb_rate=climb_rate, during_s=30.0)
    for before, after in pairwise(way):
        assert abs(after.climb_rate - before.climb_rate) <= ACCELERATION / RATE_HZ + 1e-9
        lowest, highest = -max(sink, -along), max(climb, along)
        # One that begins beyond a limit comes back into it.
        assert after.climb_rate <= max(highest, before.climb_rate) + 1e-9
        assert after.climb_rate >= min(lowest, before.climb_rate) - 1e-9


def test_a_path_that_climbs_itself_is_caught_up_with():
    # 3 m/s of 4: at 3.5 m/s 10 m are caught up within 20 s and what it takes to get that fast, 21 m more.
    way = flown(climbing(10.0, 3.0), LIMITS, height=0.0, climb_rate=0.0, during_s=80.0)
    assert way[-1].is_at(climbing(10.0 + 3.0 * 80.0, 3.0))
    assert max(one.climb_rate for one in way) == pytest.approx(3.5, abs=0.01)


def test_a_path_that_climbs_at_the_limit_is_followed_at_the_limit():
    assert LIMITS.fastest(4.0) == (-SHARE * 3.0, 4.0)
    assert LIMITS.fastest(-3.0) == (-3.0, SHARE * 4.0)


def test_the_last_metres_are_closed_with_a_bounded_acceleration():
    # sqrt(2 * 0.4 * (5 - 0.3125)), where 0.3125 = 0.5 * 0.4 / 0.8²
    assert closing_rate(5.0) == pytest.approx(1.9365, abs=1e-4)
    assert closing_rate(-5.0) == -closing_rate(5.0)
    assert closing_rate(0.25) == pytest.approx(0.2)


def test_how_often_it_is_looked_at_changes_nothing():
    begin = HeightMotion(time_s=0.0, height=0.0, climb_rate=0.0)
    often = flown(held_height(60.0), LIMITS, height=0.0, climb_rate=0.0, during_s=12.0)[-1]
    once = changed_height(begin, held_height(60.0), 12.0, LIMITS)
    assert once.height == pytest.approx(often.height, abs=1e-6)
    assert changed_height(once, held_height(60.0), 11.0, LIMITS) is once


def test_a_setpoint_is_what_the_change_comes_to_when_it_takes_effect():
    before = flown(held_height(60.0), LIMITS, height=0.0, climb_rate=0.0, during_s=10.0)[-1]
    asked = target_on_the_way(before, held_height(60.0), 3.0, LIMITS)
    assert (asked.height, asked.climb_rate) == (before.height, pytest.approx(2.0))
    assert asked.ahead == pytest.approx(before.height + 6.0)


def test_nothing_takes_no_time():
    assert change_duration(0.0, ClimbLimits()) == 0.0
    assert math.isfinite(change_duration(10.0, LIMITS))


@pytest.mark.parametrize(("rate", "way"), [(2.0, 5.3125), (0.4, 0.5), (-1.0, -1.5625), (0.0, 0.0)])
def test_a_climb_comes_to_rest_on_the_way_that_its_rate_needs(rate, way):
    # Beyond 0.5 m/s the square of it over twice 0.4 m/s², and 0.3 m; below it over 0.8 1/s.
    assert stopping_way(rate) == pytest.approx(way)
    assert closing_rate(way) == pytest.approx(rate)
    begin = HeightMotion(time_s=0.0, height=100.0, climb_rate=rate)
    rest = held_height(100.0 + way)
    heights = [changed_height(begin, rest, 0.1 * step, LIMITS).height for step in range(200)]
    assert heights[-1] == pytest.approx(100.0 + way, abs=0.01)
    assert max(abs(height - 100.0) for height in heights) <= abs(way) + 0.02
