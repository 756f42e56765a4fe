"""Heights that the leader means and followers count from, and how one goes over to another."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.states import leader_at
from vfguide.guidance.height import (
    ACCELERATION,
    ENOUGH,
    SHARE,
    BesidePath,
    ClimbLimits,
    HeightDeviation,
    HeightMotion,
    HeightTarget,
    Neighbour,
    altimeter_difference,
    best_step,
    change_duration,
    changed_height,
    clearance,
    closing_rate,
    deepest,
    followed_height,
    height_between,
    height_deviation,
    heights_ahead,
    held_height,
    path_height,
    stopping_way,
    target_on_the_way,
)
from vfguide.guidance.separation import TIMES
from vfguide.paths.circle import Circle, Helix
from vfguide.paths.climb import Climb
from vfguide.paths.line import Line
from vfguide.state import Airframe, LeaderState

CLIMB = Line(north=0.0, east=0.0, course=0.0, climb=Climb(slope=0.1, end=math.inf))
NORTHBOUND = leader_at(time_s=10.0, north=1000.0, height=195.0, climb_rate=2.0)
"""On the climb: 95 m above the flying height of 100 m."""


def target(motion: LeaderState, ahead_s: float) -> HeightTarget:
    point = CLIMB.nearest_in_space(motion.north, motion.east, motion.course, 0.0)
    return path_height(
        BesidePath(path=CLIMB, point=point, motion=motion, flying=100.0, ahead_s=ahead_s)
    )


@pytest.mark.parametrize(
    ("changes", "climb_rate", "ahead"),
    [
        # 3 s at 2 m/s.
        ({}, 2.0, 201.0),
        # One that gets faster is further up by then: 20 * 3 + 0.5 * 2 * 9 = 69 m of way.
        ({"acceleration": 2.0}, 2.0, 201.9),
        # One that flies across its path does not climb.
        ({"course": math.pi / 2.0}, 0.0, 195.0),
    ],
)
def test_a_setpoint_leads_a_climb_by_the_delay(changes, climb_rate, ahead):
    found = target(replace(NORTHBOUND, **changes), 3.0)
    assert found.height == pytest.approx(195.0)
    assert found.climb_rate == pytest.approx(climb_rate, abs=1e-12)
    assert found.ahead == pytest.approx(ahead)


def test_a_leader_outside_a_helix_climbs_with_the_point_beside_it():
    circle = Circle(north=0.0, east=0.0, radius=100.0, direction=1)
    helix = Helix(circle=circle, climb=Climb(slope=0.1, end=1000.0))
    place = helix.at(300.0)
    share = 1.25  # 25 m outside of 100 m
    motion = replace(
        NORTHBOUND, north=share * place.north, east=share * place.east, course=place.course
    )
    point = helix.nearest_in_space(motion.north, motion.east, motion.course, place.height)
    beside = BesidePath(path=helix, point=point, motion=motion, flying=0.0, ahead_s=2.0)
    found = path_height(beside)
    # The point beside it runs at 20 / 1.25 m/s.
    assert found.climb_rate == pytest.approx(1.6)
    assert found.ahead == pytest.approx(place.height + 3.2)


def test_a_leader_that_flies_as_planned_has_no_deviation_nor_one_whose_height_is_not_known():
    found = height_deviation(None, NORTHBOUND, target(NORTHBOUND, 0.0), memory_s=5.0)
    assert (found.height, found.climb_rate) == (pytest.approx(0.0), pytest.approx(0.0))
    before = HeightDeviation(time_s=10.0, height=2.0)
    unknown = replace(NORTHBOUND, time_s=10.1, height=math.nan)
    assert height_deviation(before, unknown, held_height(100.0), memory_s=5.0) is before
    assert height_deviation(None, unknown, held_height(100.0), memory_s=5.0).height == 0.0


def deviations(heights: list[float], climb_rate: float) -> list[HeightDeviation]:
    """What is made of a leader that should fly level at 100 m, heard ten times a second."""
    found: list[HeightDeviation] = []
    for step, height in enumerate(heights):
        state = replace(NORTHBOUND, time_s=0.1 * step, height=height, climb_rate=climb_rate)
        before = found[-1] if found else None
        found.append(height_deviation(before, state, held_height(100.0), memory_s=5.0))
    return found


def leaves_at(climb_rate: float, seconds: float) -> HeightDeviation:
    """What is made of one that climbs, or descends, from its planned height."""
    heights = [100.0 + 0.1 * step * climb_rate for step in range(round(seconds * 10) + 1)]
    return deviations(heights, climb_rate)[-1]


def test_a_leader_that_climbs_beside_its_plan_is_followed_and_a_short_transient_hardly_is():
    found = leaves_at(1.0, 60.0)
    assert found.height == pytest.approx(60.0, abs=0.01)
    assert found.at(62.0) == pytest.approx(62.0, abs=0.01)
    # Half a metre within a second.
    assert leaves_at(0.5, 1.0).height < 0.2


@pytest.mark.parametrize("rate", [3.0, -3.0, -20.0, -300.0])
def test_a_climb_rate_that_is_stuck_shifts_no_follower(rate):
    found = deviations([100.0] * 600, rate)
    # A rate of 3 m/s, filtered twice by 5 s: 3 t²/10 exp(-t/5), at most 4.1 m, and after 60 s nothing.
    assert max(abs(one.height) for one in found) < (4.5 if abs(rate) <= 3.0 else 15.1)
    assert abs(found[-1].height) < 0.6
    assert abs(found[-1].climb_rate) < 0.15


@pytest.mark.parametrize(
    ("planned", "deviation", "height", "climb_rate", "ahead"),
    [
        pytest.param((110.0, 2.0, 114.0), (1.0, 0.5), 111.5, 2.5, 116.5, id="lastingly differs"),
        pytest.param((100.0, 0.0, 100.0), (-95.0, 0.0), 50.0, 0.0, 50.0, id="not to the ground"),
        pytest.param((30.0, 0.0, 30.0), (0.0, 0.0), 30.0, 0.0, 30.0, id="path leads lower"),
    ],
)
def test_followers_fly_the_plan_and_what_the_leader_lastingly_differs_from_it(
    planned, deviation, height, climb_rate, ahead
):
    plan = HeightTarget(**dict(zip(("height", "climb_rate", "ahead"), planned, strict=True)))
    off = HeightDeviation(time_s=5.0, height=deviation[0], climb_rate=deviation[1])
    found = followed_height(plan, off, flying=100.0, now_s=6.0, ahead_s=2.0)
    assert (found.height, found.climb_rate) == pytest.approx((height, climb_rate))
    assert found.ahead == pytest.approx(ahead)


UP, DOWN = 20.0, -20.0
STEPS = (0.0, UP, DOWN)


@pytest.mark.parametrize(
    ("differ", "before", "seconds", "known"),
    [
        # 2 (1 - exp(-1)) = 1.264 m, and 0.1 s late; the rate of 0.2 m/s is allowed.
        *((2.0, 0.0, 10, 1.264), (2.0, 0.0, 100, 2.0)),
        # Satellite altitudes that step move it slowly and not far.
        *((15.0, 0.0, 10, 3.0), (15.0, 0.0, 100, 10.0)),
        *((-15.0, 0.0, 10, -3.0), (-15.0, 0.0, 100, -10.0)),
        # What cannot be one above the sea counts as no difference: 2 exp(-1) = 0.736 m.
        *((differ, 0.0, 100, 0.0) for differ in (15.1, -47.0, 588.0, -math.inf)),
        *((differ, 2.0, 10, 0.736) for differ in (15.1, -47.0, 588.0, -math.inf)),
        # One that is not known differs as before.
        (math.nan, 1.5, 10, 1.5),
    ],
)
def test_altimeters_that_differ_are_followed_slowly_as_far_as_is_credible(
    differ, before, seconds, known
):
    for _ in range(seconds * 10):
        before = altimeter_difference(before, differ, 0.1)
    assert before == pytest.approx(known, abs=0.01)


def beside(distance: float, up: float, *, over: bool | None = None, soon: float = 0.0) -> Neighbour:
    """A vehicle some metres away in the plane and higher than the slot, that climbs by some metres soon."""
    return Neighbour(
        distance=distance,
        least=7.0,
        least_up=7.0,
        lowest=up + min(soon, 0.0),
        highest=up + max(soon, 0.0),
        over=(up < 0.0 if up else None) if over is None else over,
    )


def test_a_distance_in_space_counts_in_least_distances():
    # 4.2 m aside and 5.6 m below: 7 m.
    assert clearance(0.0, [beside(4.2, -5.6)]) == pytest.approx(1.0)
    assert clearance(0.0, [beside(4.2, -5.6), beside(3.5, 0.0)]) == pytest.approx(0.5)
    assert clearance(0.0, []) == ENOUGH
    # One that is climbing counts where it will be: 10 m above.
    assert clearance(UP, [beside(5.0, -2.0, soon=12.0)]) == pytest.approx(math.hypot(5, 10) / 7)


@pytest.mark.parametrize(
    ("steps", "over", "others", "best"),
    [
        # Beside one alone either way is open, and the first is taken.
        (STEPS, None, [], UP),
        ((0.0, DOWN, UP), None, [], DOWN),
        # 12 m above, and 9 m aside: 20 m would lead through that height, and end 8 m over it.
        (STEPS, None, [beside(9.0, 12.0)], DOWN),
        # 24 m above: 4 m under it.
        (STEPS, None, [beside(6.0, 24.0)], DOWN),
        # With others near above and below no height is better.
        (STEPS, None, [beside(3.0, 12.0), beside(3.0, -12.0)], 0.0),
        # Who is far away in the plane closes no height.
        (STEPS, None, [beside(15.0, 12.0)], UP),
        # Level now, 5 m aside, and 9 m higher in 3 s: it is the lower one's business to go down.
        (STEPS, None, [beside(5.0, 4.0, soon=9.0)], DOWN),
        # Of two that are as high one goes over the other and never both.
        (STEPS, True, [], UP),
        (STEPS, False, [], DOWN),
        # The way over is closed to the first: it stays, and does not follow the other one down.
        (STEPS, True, [beside(3.0, 12.0)], 0.0),
    ],
)
def test_nobody_steps_into_or_through_the_layer_of_another(steps, over, others, best):
    assert best_step(0.0, steps, [beside(3.0, 0.0, over=over), *others]) == best


# 7 m or 4 m below somebody, and 8 m above: 1.0 and 0.57 against 1.14 least distances.
@pytest.mark.parametrize(("above", "best"), [(27.0, UP), (24.0, DOWN)])
def test_a_step_is_kept_until_another_is_clearly_better(above, best):
    assert best_step(UP, (UP, DOWN), [beside(0.0, above), beside(0.0, -28.0)]) == best


@pytest.mark.parametrize(("height_m", "deepest_m"), [(100.0, 20.0), (40.0, 10.0), (-3.0, 0.0)])
def test_no_vehicle_descends_by_more_than_a_quarter_of_its_height(height_m, deepest_m):
    assert deepest(height_m) == pytest.approx(deepest_m)


NEIGHBOURS = st.lists(
    st.builds(
        beside,
        st.floats(0.0, 100.0),
        st.floats(-60.0, 60.0),
        over=st.none() | st.booleans(),
        soon=st.floats(-15.0, 15.0),
    ),
    max_size=6,
)


@given(NEIGHBOURS, st.sampled_from(STEPS))
def test_no_step_leaves_less_than_staying_does(neighbours, present):
    found = best_step(present, STEPS, neighbours)
    assert found == present or clearance(found, neighbours) > clearance(present, neighbours)


AIRCRAFT = Airframe(height_delay=2.0, climb_max=4.0, sink_max=3.0)


def test_a_step_that_has_just_begun_is_counted_on_to_become_as_fast_as_the_vehicle_climbs():
    heights = heights_ahead(100.0, 0.0, held_height(120.0), AIRCRAFT, begun_s=0.1)
    # 4 m/s after a lag of 1.2 s: 4 (2 - 1.2 (1 - exp(-2 / 1.2))) = 4.107 m in 2 s.
    assert heights[TIMES == 2.0] == pytest.approx([104.107], abs=1e-3)
    assert heights[0] == 100.0
    assert heights[-1] == 120.0
    down = heights_ahead(100.0, 0.0, held_height(80.0), AIRCRAFT, begun_s=0.1)
    assert down[TIMES == 2.0] == pytest.approx([100.0 - 4.107 * 3.0 / 4.0], abs=1e-3)
    assert down[-1] == pytest.approx(80.0)


def test_a_vehicle_that_does_not_climb_is_counted_on_to_stay_where_it_is():
    stuck = heights_ahead(100.0, 0.0, held_height(120.0), AIRCRAFT, begun_s=1.0)
    assert stuck == pytest.approx(np.full(len(TIMES), 100.0))
    # After 2.4 s it should climb by 4 (1 - exp(-2)) = 3.459 m/s, and climbs half as fast.
    slow = heights_ahead(100.0, 1.729, held_height(120.0), AIRCRAFT, begun_s=2.4)
    assert slow[-1] - slow[-2] == pytest.approx(0.5 * 2.0, abs=0.01)


def test_who_passes_the_height_of_another_has_no_height_between():
    heights = np.linspace(100.0, 116.0, len(TIMES))
    # A metre in half a second: from 105 m on it is above 104 m, by 1, 2, 3 m at the lower end of an interval.
    between = height_between(heights, 104.0, 104.0)
    assert list(between[:8]) == pytest.approx([3.0, 2.0, 1.0, 0.0, 0.0, 1.0, 2.0, 3.0])
    assert height_between(np.array([103.0, 105.0]), 104.0, 104.0) == pytest.approx([0.0])


LIMITS, RATE_HZ = ClimbLimits(climb=4.0, sink=3.0), 20.0


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


def test_a_path_that_climbs_at_the_limit_is_followed_at_the_limit_and_nothing_takes_no_time():
    assert LIMITS.fastest(4.0) == (-SHARE * 3.0, 4.0)
    assert LIMITS.fastest(-3.0) == (-3.0, SHARE * 4.0)
    assert change_duration(0.0, ClimbLimits()) == 0.0
    assert math.isfinite(change_duration(10.0, LIMITS))


def test_a_setpoint_is_what_the_change_comes_to_when_it_takes_effect():
    before = flown(held_height(60.0), LIMITS, height=0.0, climb_rate=0.0, during_s=10.0)[-1]
    asked = target_on_the_way(before, held_height(60.0), 3.0, LIMITS)
    assert (asked.height, asked.climb_rate) == (before.height, pytest.approx(2.0))
    assert asked.ahead == pytest.approx(before.height + 6.0)


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
