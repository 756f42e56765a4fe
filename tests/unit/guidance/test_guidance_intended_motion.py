"""What slots are fixed to: the measured leader in calm air, in turbulence the one that its path means."""

import math
from collections.abc import Callable, Iterator
from random import Random

import numpy as np
import pytest
from msgspec.structs import replace

from tests.kit.states import circling, leader_at, vehicle_at
from vfguide.guidance.airframe import polar
from vfguide.guidance.intended_motion import (
    IntendedMotion,
    KnownLeader,
    bent_course,
    extrapolate_along_path,
    intended_at_first,
    intended_motion,
    planned_motion,
)
from vfguide.guidance.path import Path, PathPoint
from vfguide.guidance.sliding_laws import PathGains
from vfguide.mission.flight_path import path_of, shape_of
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


def heard(time_s: float, course: float, *, east: float = 0.0, speed: float = 20.0) -> LeaderState:
    place = {"north": 20.0 * time_s, "east": east}
    return leader_at(time_s=time_s, **place, course=course, ground_speed=speed)


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


def test_in_calm_air_or_off_its_path_the_leader_is_followed_as_it_flies():
    # A swing of the wind within a minute, as the article's: 3 degrees and no jitter.
    known = after(60.0, lambda t: 0.05 * math.sin(2.0 * math.pi * t / 60.0))
    assert known.motion.course == pytest.approx(0.0, abs=0.0015)
    assert known.motion.ground_speed == pytest.approx(20.0, abs=1e-9)
    # On its way to the path, and 15 s after it has left it: e^(-15/2) of the trust is left.
    assert after(3.0, lambda t: 1.0 - 0.2 * t).motion.course == pytest.approx(0.4)
    turned = after(60.0, lambda t: 0.0 if t < 45.0 else 0.5, as_planned=True)
    assert turned.motion.course == pytest.approx(0.5, abs=0.5 * math.exp(-7.0))


def test_a_course_that_jitters_turns_the_frame_by_a_tenth_of_it_at_most():
    # 1.2 degrees at 0.3 Hz, as in moderate turbulence: at its peak the frame points along the path.
    swing = math.radians(1.2) * math.sqrt(2.0)

    def course(time_s: float) -> float:
        return swing * math.sin(2.0 * math.pi * 0.3 * time_s)

    assert abs(after(60.0 + 0.25 / 0.3, course).motion.course) < 0.15 * swing
    # Fed forward as it is measured it would be 2 pi 0.3 Hz times the swing: 0.056 rad/s.
    assert abs(after(60.0, course).motion.turn_rate) < 0.01
    # Blown beside its path it flies back to it, 1.7 degrees off for 6 s: 1.8 m in a slot 60 m behind.
    random = Random(2)
    jitter = [random.gauss(0.0, 0.02) for _ in range(1601)]
    known = after(80.0, lambda t: (0.03 if t > 74.0 else 0.0) + jitter[round(t / PERIOD_S)])
    assert abs(known.motion.course) < 0.1 * 0.03


def test_place_and_true_velocity_stay_those_of_the_leader():
    random = Random(1)
    courses = [random.gauss(0.0, 0.03) for _ in range(1201)]
    known = after(60.0, lambda t: courses[round(t / PERIOD_S)], lambda t: 20.0 + math.sin(t))
    motion = known.motion
    assert (motion.north, motion.east) == (1200.0, 0.0)
    north, east = polar(motion.ground_speed, motion.course)
    true = polar(20.0 + math.sin(60.0), courses[1200])
    assert (north + motion.drift_north, east + motion.drift_east) == pytest.approx(true)


def test_the_frame_turns_as_fast_as_the_leader_truly_passes_along_a_bend():
    bound = replace(NORTHBOUND, path=Circle(north=0.0, east=0.0, radius=150.0, direction=1))
    first = circling(0.0)
    known = intended_at_first(first, planned_motion(first, bound, CALM))
    for step in range(1, 801):
        # From 39.9 s on a gust from behind.
        state = replace(circling(step * PERIOD_S), ground_speed=23.0 if step > 798 else 20.0)
        known = intended_motion(known, state, planned_motion(state, bound, CALM), as_planned=True)
    assert known.motion.turn_rate == pytest.approx(23.0 / 150.0, rel=1e-3)


def test_on_a_circle_the_plan_turns_with_it_and_knows_what_the_wind_does_to_the_speed():
    known = replace(NORTHBOUND, path=Circle(north=0.0, east=0.0, radius=250.0, direction=1))
    # In the north of a clockwise circle the course is east: 5 m/s of west wind come from behind.
    north = leader_at(north=250.0, course=math.pi / 2.0, ground_speed=25.0, turn_rate=0.1)
    planned = planned_motion(north, known, (0.0, 5.0))
    assert planned.course == pytest.approx(math.pi / 2.0)
    assert planned.ground_speed == pytest.approx(25.0)
    assert planned.turn_rate == pytest.approx(25.0 / 250.0)
    # The tail wind is at its greatest there, and changes with the square of the angle.
    assert planned.acceleration == pytest.approx(0.0, abs=1e-3)


def test_small_bends_of_the_field_are_left_out_and_great_ones_are_not():
    metre = PathPoint(0.0, 1.0, 0.0, 0.0)
    # The field turns 0.0064 rad back for a metre; what is kept of it is 0.0064 / 0.1064.
    bend = math.pi / 2.0 * (2.0 / math.pi) * math.atan(0.01)
    course, slope = bent_course(metre, GAINS)
    assert course == pytest.approx(-bend * bend / (bend + 0.1))
    step = bent_course(PathPoint(0.0, 1.001, 0.0, 0.0), GAINS)[0]
    assert slope == pytest.approx((step - course) / 0.001, rel=1e-3)
    far, _ = bent_course(PathPoint(0.0, 1000.0, 0.0, 0.0), GAINS)
    assert far == pytest.approx(-math.atan(10.0), rel=0.07)


AIRSPEED, RADIUS, PERIOD = 20.0, 150.0, 0.05
WINDS = [(0.0, 0.0), (5.0, 0.0), (-4.0, 6.0), (3.0, -7.0)]


def known(path: Path) -> KnownLeader:
    gains = PathGains(gain=0.015, approach_angle=math.pi / 2.0)
    return KnownLeader(path=path, path_gains=gains, airspeed=AIRSPEED, rate_filter_s=0.4)


def speed_over_ground(course: float, wind: tuple[float, float]) -> float:
    """By the law of cosines in the wind triangle."""
    strength, angle = math.hypot(*wind), math.atan2(wind[1], wind[0]) - course
    return strength * math.cos(angle) + math.sqrt(AIRSPEED**2 - (strength * math.sin(angle)) ** 2)


def carried(leader: LeaderState, path: Path, wind: tuple[float, float]) -> Iterator[LeaderState]:
    """The leader every 50 ms for 20 s."""
    for step in range(1, 401):
        here = vehicle_at(wind=wind, time_s=PERIOD * step)
        leader = extrapolate_along_path(leader, here, known(path))
        yield leader


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize("direction", [1, -1])
def test_on_a_circle_in_wind_it_is_where_the_leader_is(direction, wind):
    def motion_at(bearing: float) -> dict[str, float]:
        north, east = polar(RADIUS, bearing)
        course = bearing + direction * math.pi / 2.0
        speed = speed_over_ground(course, wind)
        place = {"north": 100.0 + north, "east": 50.0 + east}
        turn_rate = direction * speed / RADIUS
        return {**place, "course": course, "ground_speed": speed, "turn_rate": turn_rate}

    path = Circle(north=100.0, east=50.0, radius=RADIUS, direction=direction)
    bearing = 0.3
    for state in carried(leader_at(**motion_at(bearing)), path, wind):
        for _ in range(10):
            middle = bearing + motion_at(bearing)["turn_rate"] * PERIOD / 20.0
            bearing += motion_at(middle)["turn_rate"] * PERIOD / 10.0
        true = motion_at(bearing)
        assert (state.north, state.east) == pytest.approx((true["north"], true["east"]), abs=0.01)
        turned = math.remainder(state.course - true["course"], math.tau)
        assert turned == pytest.approx(0.0, abs=1e-4)
        assert state.ground_speed == pytest.approx(true["ground_speed"], abs=1e-3)
        assert state.turn_rate == pytest.approx(true["turn_rate"], abs=1e-3)
    # What slots need most on a circle in wind: how the speed changes, 0.4 s late by its filter.
    slower, faster = (speed_over_ground(true["course"] + step, wind) for step in (-1e-4, 1e-4))
    change = true["turn_rate"] * (faster - slower) / 2e-4
    assert state.acceleration == pytest.approx(change, abs=0.1)


PLACES = ((0, 0), (600, 0), (600, 700), (-200, 400), (800, 300))
ROUTE = [{"north_m": north, "east_m": east} for north, east in PLACES]
CURVED = {
    "figure-eight": {"type": "figure-eight", "half_length_m": 500},
    "repeat": {"type": "waypoints", "waypoints": ROUTE[:4], "end": "repeat", "radius_m": 150},
    "reverse": {"type": "waypoints", "waypoints": ROUTE[:3], "end": "reverse", "radius_m": 120},
    "loiter": {"type": "waypoints", "waypoints": ROUTE, "end": "loiter", "radius_m": 100},
}


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-4.0, 6.0)])
@pytest.mark.parametrize("name", CURVED)
def test_on_any_path_it_is_where_the_leader_is(name, wind):
    # A second and more of silence begins everywhere: on legs, on fillets, where branches cross, at the end.
    path = path_of(shape_of(CURVED[name]))
    for begin in np.linspace(10.0, path.length + 300.0, 12).tolist():
        place, run = path.at(begin), begin
        speed = speed_over_ground(place.course, wind)
        where = {"north": place.north, "east": place.east, "course": place.course}
        first = leader_at(**where, ground_speed=speed, turn_rate=speed * place.curvature)
        for step, state in zip(range(60), carried(first, path, wind), strict=False):
            for _ in range(4):
                run += speed_over_ground(path.at(run).course, wind) * PERIOD / 4.0
            place = path.at(run)
            apart = math.hypot(state.north - place.north, state.east - place.east)
            assert apart < 0.05 + 0.02 * step * PERIOD, (name, begin, step)
            turned = math.remainder(state.course - place.course, math.tau)
            assert turned == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("wind", [(40.0, 0.0), (0.0, 40.0), (-40.0, 0.0)])
def test_a_wind_that_is_faster_than_the_leader_is_borne(wind):
    path = Circle(north=0.0, east=0.0, radius=RADIUS, direction=1)
    for state in carried(leader_at(), path, wind):
        assert all(math.isfinite(getattr(state, name)) for name in state.__struct_fields__)
