"""A leader that is carried on, against a leader that flies on."""

import math
from collections.abc import Callable, Iterator
from dataclasses import fields, replace

import numpy as np
import pytest

from vfguide.guidance.intended_motion import KnownLeader, extrapolate_along_path
from vfguide.guidance.path import Path
from vfguide.guidance.settings import PathGains
from vfguide.mission.flight_path import path_of, shape_of
from vfguide.paths.circle import Circle
from vfguide.paths.line import Line
from vfguide.paths.racetrack import Racetrack
from vfguide.state import LeaderState, VehicleState

Vehicle = Callable[..., VehicleState[float]]
Leader = Callable[..., LeaderState[float]]

AIRSPEED, RADIUS, PERIOD = 20.0, 150.0, 0.05
WINDS = [(0.0, 0.0), (5.0, 0.0), (-4.0, 6.0), (3.0, -7.0)]


def known(path: Path) -> KnownLeader:
    gains = PathGains(gain=0.015, approach_angle=math.pi / 2.0)
    return KnownLeader(path=path, path_gains=gains, airspeed=AIRSPEED, rate_filter_s=0.4)


def speed_over_ground(course: float, wind: tuple[float, float]) -> float:
    """By the law of cosines in the wind triangle."""
    strength, angle = math.hypot(*wind), math.atan2(wind[1], wind[0]) - course
    return strength * math.cos(angle) + math.sqrt(AIRSPEED**2 - (strength * math.sin(angle)) ** 2)


def carried(
    leader: LeaderState[float], vehicle: Vehicle, path: Path, wind: tuple[float, float]
) -> Iterator[LeaderState[float]]:
    """The leader every 50 ms for 20 s."""
    for step in range(1, 401):
        leader = extrapolate_along_path(
            leader, vehicle(wind=wind, time_s=PERIOD * step), known(path)
        )
        yield leader


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize("course", [0.0, 0.8, 4.0])
def test_on_a_line_it_is_where_the_leader_is(
    vehicle: Vehicle, leader: Leader, course: float, wind: tuple[float, float]
) -> None:
    speed = speed_over_ground(course, wind)
    path = Line(north=30.0, east=-40.0, course=course)
    begin = leader(north=30.0, east=-40.0, course=course, ground_speed=speed)
    for state in carried(begin, vehicle, path, wind):
        run = speed * state.time_s
        assert state.north == pytest.approx(30.0 + run * math.cos(course), abs=1e-6)
        assert state.east == pytest.approx(-40.0 + run * math.sin(course), abs=1e-6)
        assert state.course == pytest.approx(course)
        assert state.ground_speed == pytest.approx(speed)
        rates = (state.acceleration, state.turn_rate, state.turn_acceleration)
        assert rates == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("wind", WINDS)
@pytest.mark.parametrize("direction", [1, -1])
def test_on_a_circle_in_wind_it_is_where_the_leader_is(
    vehicle: Vehicle, leader: Leader, direction: int, wind: tuple[float, float]
) -> None:
    def course_at(bearing: float) -> float:
        return bearing + direction * math.pi / 2.0

    def rate_at(bearing: float) -> float:
        return direction * speed_over_ground(course_at(bearing), wind) / RADIUS

    path = Circle(north=100.0, east=50.0, radius=RADIUS, direction=direction)
    bearing = 0.3
    begin = leader(
        north=100.0 + RADIUS * math.cos(bearing),
        east=50.0 + RADIUS * math.sin(bearing),
        course=course_at(bearing),
        ground_speed=speed_over_ground(course_at(bearing), wind),
        turn_rate=rate_at(bearing),
    )
    for state in carried(begin, vehicle, path, wind):
        for _ in range(10):
            middle = bearing + rate_at(bearing) * PERIOD / 20.0
            bearing += rate_at(middle) * PERIOD / 10.0
        assert state.north == pytest.approx(100.0 + RADIUS * math.cos(bearing), abs=0.01)
        assert state.east == pytest.approx(50.0 + RADIUS * math.sin(bearing), abs=0.01)
        turned = math.remainder(state.course - course_at(bearing), math.tau)
        assert turned == pytest.approx(0.0, abs=1e-4)
        speed = speed_over_ground(course_at(bearing), wind)
        assert state.ground_speed == pytest.approx(speed, abs=1e-3)
        assert state.turn_rate == pytest.approx(rate_at(bearing), abs=1e-3)
    # What slots need most on a circle in wind: how the speed changes, 0.4 s late by its filter.
    change = rate_at(bearing) * (
        speed_over_ground(course_at(bearing) + 1e-4, wind)
        - speed_over_ground(course_at(bearing) - 1e-4, wind)
    )
    assert state.acceleration == pytest.approx(change / 2e-4, abs=0.1)


ROUTE = [
    {"north_m": north, "east_m": east}
    for north, east in ((0, 0), (600, 0), (600, 700), (-200, 400), (800, 300))
]
CURVED = {
    "figure-eight": {"type": "figure-eight", "half_length_m": 500},
    "repeat": {"type": "waypoints", "waypoints": ROUTE[:4], "end": "repeat", "radius_m": 150},
    "reverse": {"type": "waypoints", "waypoints": ROUTE[:3], "end": "reverse", "radius_m": 120},
    "loiter": {"type": "waypoints", "waypoints": ROUTE, "end": "loiter", "radius_m": 100},
}


@pytest.mark.parametrize("wind", [(0.0, 0.0), (-4.0, 6.0)])
@pytest.mark.parametrize("name", CURVED)
def test_on_any_path_it_is_where_the_leader_is(
    vehicle: Vehicle, leader: Leader, name: str, wind: tuple[float, float]
) -> None:
    # A second and more of silence begins everywhere: on legs, on fillets, where branches cross, at the end.
    path = path_of(shape_of(CURVED[name]))
    for begin in np.linspace(10.0, path.length + 300.0, 12).tolist():
        place, run = path.at(begin), begin
        speed = speed_over_ground(place.course, wind)
        first = leader(
            north=place.north,
            east=place.east,
            course=place.course,
            ground_speed=speed,
            turn_rate=speed * place.curvature,
        )
        for step, state in zip(range(60), carried(first, vehicle, path, wind), strict=False):
            for _ in range(4):
                run += speed_over_ground(path.at(run).course, wind) * PERIOD / 4.0
            place = path.at(run)
            apart = math.hypot(state.north - place.north, state.east - place.east)
            assert apart < 0.05 + 0.02 * step * PERIOD, (name, begin, step)
            turned = math.remainder(state.course - place.course, math.tau)
            assert turned == pytest.approx(0.0, abs=0.01)


def test_a_leader_beside_its_path_comes_back_to_it(vehicle: Vehicle, leader: Leader) -> None:
    path = Line(north=0.0, east=0.0, course=0.0)
    states = list(carried(leader(east=10.0), vehicle, path, (0.0, 5.0)))
    assert states[0].course < 0.0
    errors = [state.east for state in states]
    assert errors == sorted(errors, reverse=True)
    # At 20 m/s the field halves a small error in some 3.6 s.
    assert 0.0 < errors[-1] < 0.5


def test_the_wind_that_counts_is_that_of_the_moment(vehicle: Vehicle, leader: Leader) -> None:
    path = Line(north=0.0, east=0.0, course=0.0)
    first = extrapolate_along_path(leader(), vehicle(wind=(2.0, 0.0), time_s=0.1), known(path))
    second = extrapolate_along_path(first, vehicle(wind=(-3.0, 0.0), time_s=0.2), known(path))
    assert (first.ground_speed, second.ground_speed) == (22.0, 17.0)
    assert second.north == pytest.approx(2.2 + 1.7)
    assert second.time_s == 0.2


@pytest.mark.parametrize("wind", [(40.0, 0.0), (0.0, 40.0), (-40.0, 0.0)])
def test_a_wind_that_is_faster_than_the_leader_is_borne(
    vehicle: Vehicle, leader: Leader, wind: tuple[float, float]
) -> None:
    path = Circle(north=0.0, east=0.0, radius=RADIUS, direction=1)
    for state in carried(leader(), vehicle, path, wind):
        assert all(math.isfinite(getattr(state, field.name)) for field in fields(state))


@pytest.mark.parametrize(
    "path",
    [
        Line(north=10.0, east=-20.0, course=2.0),
        Circle(north=10.0, east=-20.0, radius=RADIUS, direction=-1),
        Racetrack(
            north=0.0, east=3.0, course=1.0, leg=300.0, radius=RADIUS, direction=1, easement=60
        ),
    ],
)
def test_leaders_in_a_batch_are_carried_on_as_alone(
    vehicle: Vehicle, leader: Leader, path: Path
) -> None:
    random, count = np.random.default_rng(1), 50
    columns = {
        name: random.uniform(low, high, count)
        for name, low, high in (
            *(("north", -300.0, 300.0), ("east", -300.0, 300.0), ("course", -4.0, 4.0)),
            *(("ground_speed", 8.0, 35.0), ("acceleration", -3.0, 3.0)),
            *(("turn_rate", -0.5, 0.5), ("turn_acceleration", -0.3, 0.3)),
        )
    }
    winds = random.uniform(-15.0, 15.0, (2, count))
    time_s = 0.1
    followers = replace(vehicle(time_s=time_s), wind_north=winds[0], wind_east=winds[1])
    batch = extrapolate_along_path(leader(**columns), followers, known(path))
    for index in range(count):
        alone = extrapolate_along_path(
            leader(**{name: float(column[index]) for name, column in columns.items()}),
            vehicle(time_s=time_s, wind=(float(winds[0, index]), float(winds[1, index]))),
            known(path),
        )
        assert batch.time_s == alone.time_s == time_s
        for name in columns:
            single = getattr(alone, name)
            assert isinstance(single, float)
            assert getattr(batch, name)[index] == pytest.approx(single, rel=1e-12, abs=1e-12)
