"""What slots are fixed to: the measured leader in calm air, in turbulence the one that its path means."""

import math
from collections.abc import Callable
from random import Random

import pytest

from vfguide.guidance.intended_motion import (
    IntendedMotion,
    KnownLeader,
    bent_course,
    intended_at_first,
    intended_motion,
    planned_motion,
)
from vfguide.guidance.path import PathPoint
from vfguide.guidance.settings import PathGains
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line
from vfguide.state import LeaderState

PERIOD_S = 0.05
GAINS = PathGains(gain=0.01, approach_angle=math.pi / 2.0)
NORTHBOUND = KnownLeader(
    path=Line(north=0.0, east=0.0, course=0.0), path_gains=GAINS, airspeed=20.0, rate_filter_s=0.6
)
CALM = (0.0, 0.0)

Course = Callable[[float], float]


def heard(
    time_s: float, course: float, *, east: float = 0.0, speed: float = 20.0
) -> LeaderState[float]:
    return LeaderState(
        time_s=time_s,
        north=20.0 * time_s,
        east=east,
        course=course,
        ground_speed=speed,
        acceleration=0.0,
        turn_rate=0.0,
        turn_acceleration=0.0,
    )


def after(
    until_s: float, course: Course, speed: Course = lambda _: 20.0, *, as_planned: bool = False
) -> IntendedMotion:
    """What is made of a leader that flies north along its path, with this course (rad) and speed (m/s)."""
    first = heard(0.0, course(0.0), speed=speed(0.0))
    known = intended_at_first(first, planned_motion(first, NORTHBOUND, CALM))
    for step in range(1, round(until_s / PERIOD_S) + 1):
        time_s = step * PERIOD_S
        state = heard(time_s, course(time_s), speed=speed(time_s))
        planned = planned_motion(state, NORTHBOUND, CALM)
        known = intended_motion(known, state, planned, as_planned=as_planned)
    return known


def test_in_calm_air_slots_follow_the_measured_course_at_once() -> None:
    # A swing of the wind within a minute, as the article's: 3 degrees and no jitter.
    known = after(60.0, lambda t: 0.05 * math.sin(2.0 * math.pi * t / 60.0))
    measured = 0.05 * math.sin(2.0 * math.pi * 60.0 / 60.0)
    assert known.motion.course == pytest.approx(measured, abs=0.0015)
    assert known.motion.ground_speed == pytest.approx(20.0, abs=1e-9)


def test_a_course_that_jitters_turns_the_frame_by_a_tenth_of_it_at_most() -> None:
    # 1.2 degrees at 0.3 Hz, as in moderate turbulence: at its peak the frame points along the path.
    swing = math.radians(1.2) * math.sqrt(2.0)
    peak_s = 60.0 + 0.25 / 0.3
    known = after(peak_s, lambda t: swing * math.sin(2.0 * math.pi * 0.3 * t))
    assert abs(known.motion.course) < 0.15 * swing
    # Fed forward as it is measured it would be 2 pi 0.3 Hz times the swing: 0.056 rad/s.
    crossing = after(60.0, lambda t: swing * math.sin(2.0 * math.pi * 0.3 * t))
    assert abs(crossing.motion.turn_rate) < 0.01


def test_place_and_true_velocity_stay_those_of_the_leader() -> None:
    random = Random(1)
    courses = [random.gauss(0.0, 0.03) for _ in range(1201)]
    known = after(60.0, lambda t: courses[round(t / PERIOD_S)], lambda t: 20.0 + math.sin(t))
    motion = known.motion
    assert (motion.north, motion.east) == (1200.0, 0.0)
    north = motion.ground_speed * math.cos(motion.course) + motion.drift_north
    east = motion.ground_speed * math.sin(motion.course) + motion.drift_east
    speed = 20.0 + math.sin(60.0)
    assert north == pytest.approx(speed * math.cos(courses[1200]))
    assert east == pytest.approx(speed * math.sin(courses[1200]))


def test_a_lasting_difference_from_the_path_becomes_part_of_the_frame() -> None:
    random = Random(2)
    jitter = [random.gauss(0.0, 0.02) for _ in range(1601)]
    known = after(80.0, lambda t: 0.03 + jitter[round(t / PERIOD_S)])
    assert known.motion.course == pytest.approx(0.03, abs=0.008)


def test_a_leader_on_its_way_to_the_path_is_followed_as_it_flies() -> None:
    known = after(3.0, lambda t: 1.0 - 0.2 * t)
    assert known.motion.course == pytest.approx(0.4)


def test_on_a_circle_the_plan_turns_with_it_and_knows_what_the_wind_does_to_the_speed() -> None:
    circle = Circle(north=0.0, east=0.0, radius=250.0, direction=1)
    known = KnownLeader(path=circle, path_gains=GAINS, airspeed=20.0, rate_filter_s=0.6)
    # In the north of a clockwise circle the course is east: 5 m/s of west wind come from behind.
    north = LeaderState(
        time_s=0.0,
        north=250.0,
        east=0.0,
        course=math.pi / 2.0,
        ground_speed=25.0,
        acceleration=0.0,
        turn_rate=0.1,
        turn_acceleration=0.0,
    )
    planned = planned_motion(north, known, (0.0, 5.0))
    assert planned.course == pytest.approx(math.pi / 2.0)
    assert planned.ground_speed == pytest.approx(25.0)
    assert planned.turn_rate == pytest.approx(25.0 / 250.0)
    # The tail wind is at its greatest there, and changes with the square of the angle.
    assert planned.acceleration == pytest.approx(0.0, abs=1e-3)


def test_small_bends_of_the_field_are_left_out_and_great_ones_are_not() -> None:
    metre = PathPoint(0.0, 1.0, 0.0, 0.0)
    # The field turns 0.0064 rad back for a metre; what is kept of it is 0.0064 / 0.1064.
    bend = math.pi / 2.0 * (2.0 / math.pi) * math.atan(0.01)
    course, slope = bent_course(metre, GAINS)
    assert course == pytest.approx(-bend * bend / (bend + 0.1))
    step = bent_course(PathPoint(0.0, 1.001, 0.0, 0.0), GAINS)[0]
    assert slope == pytest.approx((step - course) / 0.001, rel=1e-3)
    far, _ = bent_course(PathPoint(0.0, 1000.0, 0.0, 0.0), GAINS)
    assert far == pytest.approx(-math.atan(10.0), rel=0.07)


def test_slots_of_a_planned_leader_turn_with_the_path_alone() -> None:
    # A course that is off by 1 degree for good, such as an estimator's, and one that wobbles slowly.
    for course in (lambda _: 0.0175, lambda t: 0.02 * math.sin(2.0 * math.pi * t / 8.0)):
        known = after(60.0, course, as_planned=True)
        assert abs(known.motion.course) < 1e-6
        assert abs(known.motion.turn_rate) < 1e-6
        # Its place moves as it is measured to move.
        velocity = known.motion.ground_speed * math.sin(known.motion.course)
        assert velocity + known.motion.drift_east == pytest.approx(20.0 * math.sin(course(60.0)))


def test_a_planned_leader_that_leaves_its_path_is_followed_as_it_flies() -> None:
    turned = after(60.0, lambda t: 0.0 if t < 45.0 else 0.5, as_planned=True)
    # 15 s after the turn e^(-15/2) of the trust is left.
    assert turned.motion.course == pytest.approx(0.5, abs=0.5 * math.exp(-7.0))
