"""Slots: where they are, how they move, and the errors of those who hold them."""

import math
from collections.abc import Callable

import pytest

from vfguide.elementwise import wrap_angle
from vfguide.guidance.formation import (
    Slot,
    SlotMotion,
    arc_tangent_field,
    article_motion,
    extrapolate_by_rates,
    formation_error,
    slot_motion,
    slot_position,
    slot_velocity,
)
from vfguide.state import LeaderState, VehicleState

Leaders = Callable[..., LeaderState[float]]
Vehicles = Callable[..., VehicleState[float]]
SLOTS = [
    Slot(forward=-20.0, right=-20.0),
    Slot(forward=-20.0, right=20.0),
    Slot(forward=-40.0, right=0.0),
    Slot(forward=15.0, right=5.0),
]


@pytest.mark.parametrize(
    ("course_deg", "north", "east"),
    [(0.0, 80.0, 210.0), (90.0, 90.0, 180.0), (180.0, 120.0, 190.0), (270.0, 110.0, 220.0)],
)
def test_a_slot_turns_with_the_leaders_course(
    leader: Leaders, course_deg: float, north: float, east: float
) -> None:
    # 20 m behind and 10 m right of a leader at (100, 200): flying east, behind is west and right is south
    state = leader(north=100.0, east=200.0, course=math.radians(course_deg))
    place = slot_position(state, Slot(forward=-20.0, right=10.0))
    assert place == pytest.approx((north, east))


def circling(leader: Leaders, time: float) -> LeaderState[float]:
    """A leader on a circle of 150 m about the origin, clockwise at 20 m/s."""
    bearing = 20.0 / 150.0 * time
    return leader(
        north=150.0 * math.cos(bearing),
        east=150.0 * math.sin(bearing),
        course=bearing + math.pi / 2.0,
        turn_rate=20.0 / 150.0,
    )


@pytest.mark.parametrize("slot", SLOTS)
def test_a_slots_velocity_is_that_of_a_rigid_figure(leader: Leaders, slot: Slot[float]) -> None:
    time, step = 3.0, 1e-4
    state = circling(leader, time)
    after = slot_position(circling(leader, time + step), slot)
    before = slot_position(circling(leader, time - step), slot)
    north, east = (after[0] - before[0]) / (2.0 * step), (after[1] - before[1]) / (2.0 * step)
    along, right = slot_velocity(20.0, state.turn_rate, slot)
    assert along == pytest.approx(north * math.cos(state.course) + east * math.sin(state.course))
    assert right == pytest.approx(east * math.cos(state.course) - north * math.sin(state.course))
    motion = slot_motion(state, slot)
    assert motion.speed == pytest.approx(math.hypot(north, east))
    assert wrap_angle(motion.course - math.atan2(east, north)) == pytest.approx(0.0, abs=1e-7)
    # a rigid figure turns as one, at a steady pace
    assert motion.turn_rate == pytest.approx(20.0 / 150.0)
    assert motion.acceleration == pytest.approx(0.0, abs=1e-12)


def test_the_outer_slot_is_faster_and_the_rear_one_slips_outward() -> None:
    # 0.1 rad/s to the right, 20 m left: 20 + 2 m/s; 20 m behind: 2 m/s to the left
    assert slot_velocity(20.0, 0.1, Slot(forward=-20.0, right=-20.0)) == pytest.approx((22.0, -2.0))


def weaving(leader: Leaders, time: float) -> LeaderState[float]:
    """A leader whose speed and turn rate change, at the origin at any time."""
    return leader(
        course=0.5 + 0.05 * time + 0.2 * math.sin(0.5 * time),
        ground_speed=20.0 + 3.0 * math.sin(0.4 * time),
        acceleration=1.2 * math.cos(0.4 * time),
        turn_rate=0.05 + 0.1 * math.cos(0.5 * time),
        turn_acceleration=-0.05 * math.sin(0.5 * time),
    )


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("time", [0.0, 1.7, 5.0, 9.3])
def test_turn_rate_and_acceleration_are_the_rates_of_course_and_speed(
    leader: Leaders, slot: Slot[float], time: float
) -> None:
    step = 1e-4
    after = slot_motion(weaving(leader, time + step), slot)
    before = slot_motion(weaving(leader, time - step), slot)
    motion = slot_motion(weaving(leader, time), slot)
    turning = wrap_angle(after.course - before.course) / (2.0 * step)
    assert motion.turn_rate == pytest.approx(turning, abs=1e-7)
    speeding = (after.speed - before.speed) / (2.0 * step)
    assert motion.acceleration == pytest.approx(speeding, abs=1e-6)


def test_on_straight_flight_both_readings_of_a_slot_agree(leader: Leaders) -> None:
    state = leader(north=7.0, east=9.0, course=2.0, acceleration=0.4)
    for slot in SLOTS:
        assert slot_motion(state, slot) == article_motion(state, slot)


def test_the_articles_slot_takes_the_leaders_motion_even_in_a_turn(leader: Leaders) -> None:
    state = leader(course=1.0, acceleration=0.5, turn_rate=0.2, turn_acceleration=0.01)
    motion = article_motion(state, SLOTS[0])
    found = (motion.course, motion.speed, motion.turn_rate, motion.acceleration)
    assert found == (1.0, 20.0, 0.2, 0.5)


def test_a_transient_turn_rate_does_not_reverse_a_slot(leader: Leaders) -> None:
    # 0.8 rad/s, 40 m right: 20 - 32 m/s would be backward; 40 m ahead it moves at 32 m/s to the right,
    # and forward at the least of 3 m/s
    motion = slot_motion(leader(turn_rate=0.8), Slot(forward=40.0, right=40.0))
    assert motion.speed == pytest.approx(math.hypot(3.0, 32.0))
    assert motion.course == pytest.approx(math.atan2(32.0, 3.0))
    assert motion.course < math.pi / 2.0


def still_motion(north: float, east: float, course: float) -> SlotMotion[float]:
    return SlotMotion(
        north=north, east=east, course=course, speed=20.0, turn_rate=0.0, acceleration=0.0
    )


@pytest.mark.parametrize(
    ("north", "east", "along", "right"),
    [
        (0.0, 10.0, 10.0, 0.0),
        (-10.0, 0.0, 0.0, 10.0),
        (0.0, -10.0, -10.0, 0.0),
        (4.0, 3.0, 3.0, -4.0),
    ],
)
def test_ahead_is_positive_along_and_right_positive_across(
    vehicle: Vehicles, north: float, east: float, along: float, right: float
) -> None:
    # the slot flies east: ahead of the follower is east of it, right is south of it
    follower = vehicle(100.0, 50.0, math.pi / 2.0)
    error = formation_error(still_motion(100.0 + north, 50.0 + east, math.pi / 2.0), follower)
    assert (error.along_track, error.cross_track) == pytest.approx((along, right), abs=1e-12)
    assert error.along_track_rate == pytest.approx(0.0)
    assert error.cross_track_rate == pytest.approx(0.0)


@pytest.mark.parametrize("turn_rate", [-0.2, 0.0, 0.15])
@pytest.mark.parametrize("course", [-2.0, 0.3, 2.5])
def test_error_rates_are_the_rates_of_the_errors(
    vehicle: Vehicles, turn_rate: float, course: float
) -> None:
    def error_at(time: float) -> tuple[float, float, float, float]:
        slot_course = 0.7 + turn_rate * time
        motion = SlotMotion(
            north=30.0 + 22.0 * math.cos(0.7) * time,
            east=-12.0 + 22.0 * math.sin(0.7) * time,
            course=slot_course,
            speed=22.0,
            turn_rate=turn_rate,
            acceleration=0.0,
        )
        follower = vehicle(
            5.0 + 18.0 * math.cos(course) * time, 9.0 + 18.0 * math.sin(course) * time, course, 18.0
        )
        error = formation_error(motion, follower)
        return (
            error.along_track,
            error.cross_track,
            error.along_track_rate,
            error.cross_track_rate,
        )

    step = 1e-4
    after, before = error_at(step), error_at(-step)
    _, _, along_rate, cross_rate = error_at(0.0)
    assert along_rate == pytest.approx((after[0] - before[0]) / (2.0 * step), abs=1e-5)
    assert cross_rate == pytest.approx((after[1] - before[1]) / (2.0 * step), abs=1e-5)


def test_the_dual_field_saturates_far_away_and_is_steepest_in_the_slot() -> None:
    # 8 (2/pi) atan(0.2 . 5) = 8 (2/pi) (pi/4) = 4; slope 8 (2/pi) 0.2 / (1 + 1) = 0.5093, times 2 m/s
    assert arc_tangent_field(5.0, 2.0, 0.2, 8.0) == pytest.approx((4.0, 1.018592))
    assert arc_tangent_field(0.0, 1.0, 0.2, 8.0) == pytest.approx((0.0, 1.018592))
    assert arc_tangent_field(-1e9, 1.0, 0.2, 8.0)[0] == pytest.approx(-8.0)


def test_a_straight_accelerating_leader_is_predicted_exactly(leader: Leaders) -> None:
    # 0.5 s at 20 m/s and 2 m/s²: 10 + 0.25 m, then 21 m/s
    later = extrapolate_by_rates(leader(course=math.pi / 2.0, acceleration=2.0, time_s=3.0), 3.5)
    assert (later.north, later.east) == pytest.approx((0.0, 10.25), abs=1e-12)
    assert later.ground_speed == pytest.approx(21.0)
    assert (later.time_s, later.acceleration, later.course) == (3.5, 2.0, math.pi / 2.0)


def arc_miss(leader: Leaders, age: float) -> float:
    """Distance of a predicted leader from where it truly is on a circle of 150 m."""
    predicted, truth = extrapolate_by_rates(circling(leader, 0.0), age), circling(leader, age)
    assert predicted.course == pytest.approx(truth.course)
    return math.hypot(predicted.north - truth.north, predicted.east - truth.east)


def test_on_an_arc_the_prediction_misses_in_the_third_order_of_its_age(leader: Leaders) -> None:
    # chord for arc: V omega² t³/24 = 20 . 0.1333² . 0.001/24 = 0.0148 mm after 0.1 s
    assert arc_miss(leader, 0.1) == pytest.approx(1.48e-5, rel=0.01)
    assert arc_miss(leader, 0.4) / arc_miss(leader, 0.2) == pytest.approx(8.0, rel=0.01)


def test_a_changing_turn_rate_is_carried_on(leader: Leaders) -> None:
    start = leader(acceleration=1.0, turn_rate=0.2, turn_acceleration=0.3)
    north = east = 0.0
    steps, age = 4000, 0.4
    for index in range(steps):
        time = (index + 0.5) * age / steps
        course = 0.2 * time + 0.15 * time * time
        north += (20.0 + time) * math.cos(course) * age / steps
        east += (20.0 + time) * math.sin(course) * age / steps
    later = extrapolate_by_rates(start, age)
    # 0.2 . 0.4 + 0.3 . 0.16/2 = 0.104 rad; 0.2 + 0.12 rad/s
    assert (later.course, later.turn_rate) == pytest.approx((0.104, 0.32))
    # third order again: about 20 . 0.26² . 0.4³/24 = 3.6 mm; unchanged turning would be 64 mm off in east
    assert math.hypot(later.north - north, later.east - east) < 0.005
    unchanged = extrapolate_by_rates(leader(acceleration=1.0, turn_rate=0.2), age)
    assert east - unchanged.east == pytest.approx(20.0 * 0.3 * 0.4**3 / 6.0, rel=0.05)


def test_a_leader_seen_now_is_not_moved(leader: Leaders) -> None:
    state = leader(time_s=2.0, north=4.0, turn_rate=0.3, acceleration=1.0)
    assert extrapolate_by_rates(state, 2.0) == state
