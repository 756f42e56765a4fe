"""The slot's field learns what keeps pushing a follower off its slot, and nothing else."""

import math
from statistics import mean

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.following import distance, follow, keeper, northward
from tests.kit.states import Plant, choices, leader_at, vehicle_at
from vfguide.guidance.formation import (
    GREATEST_M,
    TURNING_RAD_S,
    FormationError,
    Offset,
    Slot,
    SlotMotion,
    aimed_error,
    learning_growth,
    nearness,
    no_offset,
    update_offset,
)
from vfguide.state import Airframe, LeaderState

PERIOD = 0.05
COURSE_HOLD = Airframe(hold="course-hold")
BEHIND = Slot(forward=-20.0, right=0.0)
LEARNS = 1.5
"""s, of the integral."""


def off(along: float, cross: float) -> FormationError:
    return FormationError(
        along_track=along, cross_track=cross, along_track_rate=0.3, cross_track_rate=-0.2
    )


def moving(course: float = 0.0, turn_rate: float = 0.0) -> SlotMotion:
    straight = SlotMotion(north=0, east=0, course=course, speed=20.0, turn_rate=0, acceleration=0)
    return replace(straight, turn_rate=turn_rate)


STRAIGHT = moving()


def learned(before: Offset, error: FormationError, motion: SlotMotion = STRAIGHT) -> Offset:
    """What is known after half a second of an error."""
    return update_offset(before, error, LEARNS, motion, period=0.5, held=False)


def ahead_by_course(metres: float, mean: float = 0.0) -> Offset:
    """An offset ahead that is as large as this where the course is north."""
    first, second = no_offset().harmonics
    known = (replace(first, ahead_cosine=metres), second)
    return replace(no_offset(), ahead=mean, harmonics=known)


def test_a_field_that_aims_beyond_its_slot_sees_the_sum_of_error_and_offset():
    # at 5 cm all of the error is learned from: 0.03/1.5 and 0.04/1.5 m/s
    beyond = replace(no_offset(), ahead=0.5, right=-0.25)
    aimed = aimed_error(off(0.03, 0.04), beyond, LEARNS, STRAIGHT)
    assert aimed.along_track == pytest.approx(0.53)
    assert aimed.cross_track == pytest.approx(-0.21)
    assert aimed.along_track_rate == pytest.approx(0.3 + 0.02, abs=1e-6)
    assert aimed.cross_track_rate == pytest.approx(-0.2 + 0.04 / 1.5, abs=1e-6)


@pytest.mark.parametrize(
    ("along", "cross", "share"), [(0.0, 0.0, 1.0), (1.2, 1.6, 0.5), (-4.0, 0.0, 1.0 / 17.0)]
)
def test_nearness_is_one_in_the_slot_a_half_at_two_metres_and_little_far_away(along, cross, share):
    assert nearness(off(along, cross)) == pytest.approx(share)


def test_the_offset_grows_by_the_error_over_the_time_and_stops_at_its_bound():
    after = learned(no_offset(), off(0.03, -0.03))
    assert (after.ahead, after.right) == pytest.approx((0.01, -0.01), abs=1e-6)
    full = replace(no_offset(), ahead=GREATEST_M, right=-GREATEST_M)
    assert learned(full, off(1.0, -1.0)) == full
    # What is learned beyond the bound of all parts winds nothing up.
    full, turning = ahead_by_course(2.0, mean=4.0), moving(course=0.0, turn_rate=40.0)
    assert learned(full, off(0.5, 0.0), turning) == full
    assert learned(full, off(-0.5, 0.0), turning).ahead < full.ahead


def test_in_a_turn_each_harmonic_learns_in_its_own_phase_as_fast_as_the_mean():
    # at 40 rad/s harmonics are learned fully: 0.5 s . 0.03/1.5 m/s = 0.01 m, times the cosine and the sine
    # of 30 and of 60 degrees
    turning = moving(course=math.pi / 6.0, turn_rate=40.0)
    after = learned(no_offset(), off(0.03, -0.03), turning)
    first, second = after.harmonics
    assert (first.ahead_cosine, first.ahead_sine) == pytest.approx((0.00866, 0.005), abs=1e-5)
    assert (second.ahead_cosine, second.ahead_sine) == pytest.approx((0.005, 0.00866), abs=1e-5)
    assert (first.right_cosine, second.right_sine) == pytest.approx((-0.00866, -0.00866), abs=1e-5)


def test_on_a_straight_no_harmonic_is_learned_and_none_counts():
    after = learned(no_offset(), off(0.03, -0.03))
    assert after.harmonics == no_offset().harmonics
    aimed = aimed_error(off(0.0, 0.0), ahead_by_course(2.0), LEARNS, STRAIGHT)
    assert aimed == off(0.0, 0.0)


def test_at_the_turn_rate_at_which_they_count_by_half_harmonics_are_seen_by_half_and_move():
    # 2 cos(60 degrees) m . 1/2 ahead; it moves at -2 sin(60 degrees) . 0.04 . 1/2 m/s
    turning = moving(course=math.pi / 3.0, turn_rate=TURNING_RAD_S)
    aimed = aimed_error(off(0.0, 0.0), ahead_by_course(2.0), LEARNS, turning)
    assert aimed.along_track == pytest.approx(0.5)
    assert aimed.along_track_rate == pytest.approx(0.3 - 0.034641, abs=1e-6)
    assert learning_growth(TURNING_RAD_S, 50.0) == pytest.approx(2.0)


@settings(max_examples=50)
@given(parts=st.lists(st.floats(-GREATEST_M, GREATEST_M), min_size=10, max_size=10))
def test_all_parts_together_aim_no_farther_than_the_bound(parts):
    names = ("ahead_cosine", "ahead_sine", "right_cosine", "right_sine")
    harmonics = tuple(
        replace(one, **dict(zip(names, parts[begin : begin + 4], strict=True)))
        for one, begin in zip(no_offset().harmonics, (2, 6), strict=True)
    )
    known = replace(no_offset(), ahead=parts[0], right=parts[1], harmonics=harmonics)
    aimed = aimed_error(off(0.0, 0.0), known, LEARNS, moving(course=1.0, turn_rate=0.2))
    assert max(abs(aimed.along_track), abs(aimed.cross_track)) <= GREATEST_M


def test_nothing_is_learned_at_a_limit_or_without_a_time_to_learn_in():
    before = replace(no_offset(), ahead=0.2, right=0.1)
    for learns_s, held in ((LEARNS, True), (0.0, False)):
        after = update_offset(before, off(0.5, 0.5), learns_s, STRAIGHT, period=0.5, held=held)
        assert after == before
    assert aimed_error(off(0.5, 0.5), no_offset(), 0.0, STRAIGHT) == off(0.5, 0.5)


# 0.05 rad . 1.2 1/s = 0.06 rad/s: chi~ = 0.06 . 0.525/3 = 0.0105 rad, y_E = -tan(2 chi~)/0.2 = -0.105 m;
# 0.5 m/s . 0.8 1/s = 0.4 m/s², less x_E/50: V~ = 0.07 m/s, x_E = tan(pi/16 . 0.07)/0.2 = 0.0687 m;
# and 3 % more for the lead of half a period that the holds do not have
@pytest.mark.parametrize(("integral_s", "left"), [(0.0, (0.0687, -0.105)), (LEARNS, (0.0, 0.0))])
def test_biased_holds_leave_a_lasting_error_that_an_integral_removes(integral_s, left):
    follower = keeper("slot", choices(), BEHIND, COURSE_HOLD, integral_s=integral_s)
    flyer = Plant(north=-20.0)
    # For a minute the holds are 0.05 rad and 0.5 m/s off.
    error = follow(follower, flyer, northward, 60.0, biased=lambda _: (0.05, -0.5))[-1].error
    assert (error.along_track, error.cross_track) == pytest.approx(left, rel=0.05, abs=1e-4)


def round_100_m(time_s: float) -> LeaderState:
    """A leader on a circle of 100 m, north at first."""
    course = math.remainder(0.2 * time_s, 2.0 * math.pi)
    north, east = 100.0 * math.sin(course), 100.0 * (1.0 - math.cos(course))
    return leader_at(time_s=time_s, north=north, east=east, course=course, turn_rate=0.2)


def as_the_wind(plant: Plant) -> tuple[float, float]:
    """How far a speed hold is off in each direction."""
    return 0.0, 0.5 * math.cos(plant.course) + 0.3 * math.sin(2.0 * plant.course)


def error_on_a_circle() -> float:
    """Mean distance from the slot in the second half of five minutes round a circle."""
    follower = keeper("slot", choices(), BEHIND, COURSE_HOLD, integral_s=3.0)
    steps = follow(follower, Plant(north=-20.0), round_100_m, 300.0, biased=as_the_wind)
    return mean(distance(one) for one in steps[3000:])


def test_what_comes_back_with_every_turn_is_learned_by_harmonics_and_hardly_by_the_mean(
    monkeypatch,
):
    with_harmonics = error_on_a_circle()
    monkeypatch.setattr("vfguide.guidance.formation.HARMONICS", ())
    mean_alone = error_on_a_circle()
    assert mean_alone > 0.03
    assert with_harmonics < mean_alone / 5.0


def test_a_follower_that_flies_something_else_learns_nothing():
    def speeds(*, held: bool) -> list[float]:
        learns = keeper("slot", choices(), BEHIND, COURSE_HOLD, integral_s=LEARNS)
        here, leader = vehicle_at(-20.05, 0.05), leader_at()
        steps = (learns.step(here, leader, period=PERIOD, held=held) for _ in range(2))
        return [float(step.setpoint.speed) for step in steps]

    first, second = speeds(held=True)
    assert second == first
    assert speeds(held=False)[1] > first
