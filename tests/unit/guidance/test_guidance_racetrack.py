"""The racetrack: legs, half circles, and the easement between them."""

import math
from functools import cache
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import compose, polar
from vfguide.guidance.path import Direction, PathPoint
from vfguide.paths.racetrack import Racetrack

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=200)
LEG, RADIUS, STEP = 600.0, 150.0, 0.4
SENSES: tuple[Direction, Direction] = (1, -1)


def racetrack(easement: float, direction: Direction = 1, **place: float) -> Racetrack:
    usual = {"north": 0.0, "east": 0.0, "course": 0.0} | place
    return Racetrack(**usual, leg=LEG, radius=RADIUS, direction=direction, easement=easement)


@cache
def lap(track: Racetrack) -> list[tuple[float, float, PathPoint[float]]]:
    """(north, east, nearest point) along a lap by the tangent alone, from the middle of the first leg.

    The midpoint rule; the first leg has to run north.
    """
    north, east = 0.0, -RADIUS * track.direction
    flown = []
    while True:
        point = track.nearest(north, east)
        flown.append((north, east, point))
        half = polar(STEP / 2.0, point.course)
        step = polar(STEP, track.nearest(north + half[0], east + half[1]).course)
        before, north, east = north, north + step[0], east + step[1]
        if before < 0.0 <= north and east * track.direction < 0.0:
            flown.append((north, east, track.nearest(north, east)))
            return flown


@pytest.mark.parametrize(
    ("north", "east", "course_deg"),
    [(450.0, 0.0, 90.0), (-450.0, 0.0, 270.0), (406.066, -106.066, 45.0)],
)
def test_in_the_turns_it_follows_the_half_circles(north, east, course_deg):
    # half circles of 150 m about (+-300, 0); (406.066, -106.066) is 45 degrees into the first
    point = racetrack(0.0).nearest(north, east)
    assert abs(wrap_angle(point.course - math.radians(course_deg))) < 1e-6
    assert point.cross_track_error == pytest.approx(0.0, abs=1e-3)
    assert point.curvature == pytest.approx(1.0 / RADIUS)


@REPEATABLE
@given(
    north=st.floats(-600.0, 600.0),
    east=st.floats(-400.0, 400.0).filter(lambda east: abs(east) > 1e-3),
    easement=st.sampled_from([0.0, 40.0, 100.0]),
)
def test_counterclockwise_is_the_mirror_image(north, east, easement):
    one = racetrack(easement, 1).nearest(north, east)
    other = racetrack(easement, -1).nearest(north, -east)
    assert abs(wrap_angle(one.course + other.course)) < 1e-9
    assert one.cross_track_error == pytest.approx(-other.cross_track_error, abs=1e-9)
    assert one.curvature == pytest.approx(-other.curvature, abs=1e-12)


@REPEATABLE
@given(
    along=st.floats(-600.0, 600.0),
    right=st.floats(-400.0, 400.0).filter(lambda right: abs(right) > 1e-3),
    course=st.floats(-math.pi, math.pi),
)
def test_a_racetrack_turned_and_moved_is_the_same_racetrack(along, right, course):
    still = racetrack(40.0).nearest(along, right)
    moved = racetrack(40.0, north=400.0, east=-70.0, course=course)
    north, east = compose(along, right, course)
    point = moved.nearest(400.0 + north, -70.0 + east)
    assert abs(wrap_angle(point.course - course - still.course)) < 1e-6
    assert point.cross_track_error == pytest.approx(still.cross_track_error, abs=1e-6)
    assert point.curvature == pytest.approx(still.curvature, abs=1e-7)


@pytest.mark.parametrize("direction", SENSES)
def test_without_easement_it_is_the_plain_stadium(direction):
    flown = lap(racetrack(0.0, direction))
    # two legs and one circle: 1200 + 2 pi 150 = 2142.48 m, in steps of 0.4 m
    assert STEP * (len(flown) - 1) == pytest.approx(2142.48, abs=0.8)
    assert max(abs(point.cross_track_error) for _, _, point in flown) < 1e-3
    assert max(abs(north) for north, _, _ in flown) == pytest.approx(450.0, abs=1e-2)


@pytest.mark.parametrize("direction", SENSES)
@pytest.mark.parametrize(("easement", "accuracy"), [(40.0, 0.001), (100.0, 0.02), (150.0, 0.1)])
def test_the_tangent_integrates_to_the_closed_eased_track(easement, accuracy, direction):
    flown = lap(racetrack(easement, direction))
    assert flown[-1][1] == pytest.approx(flown[0][1], abs=1e-4)
    assert max(abs(point.cross_track_error) for _, _, point in flown) < accuracy
    # one whole turn to the right or left
    courses = [point.course for _, _, point in flown]
    turned = sum(wrap_angle(after - before) for before, after in pairwise(courses))
    assert turned == pytest.approx(direction * 2.0 * math.pi, abs=1e-6)
    # inward by easement²/(24 R) to first order in easement/R
    shift = 450.0 - max(abs(north) for north, _, _ in flown)
    assert shift == pytest.approx(easement**2 / (24.0 * RADIUS), rel=0.06)


@pytest.mark.parametrize("direction", SENSES)
@pytest.mark.parametrize(("easement", "accuracy"), [(40.0, 4e-5), (100.0, 2e-4)])
def test_curvature_is_how_fast_the_tangent_turns_along_the_eased_track(
    easement, accuracy, direction
):
    points = [point for _, _, point in lap(racetrack(easement, direction))]
    for before, here, after in zip(points, points[1:], points[2:], strict=False):
        turning = wrap_angle(after.course - before.course) / (2.0 * STEP)
        # 1/R is 6.7e-3 1/m
        assert here.curvature == pytest.approx(turning, abs=accuracy)


@pytest.mark.parametrize("aside", [-60.0, 0.0, 60.0])
@pytest.mark.parametrize("easement", [0.0, 40.0, 100.0, 150.0])
def test_along_and_beside_the_track_nothing_jumps(easement, aside):
    track = racetrack(easement)
    beside = [
        track.nearest(north - aside * math.sin(point.course), east + aside * math.cos(point.course))
        for north, east, point in lap(track)
    ]
    for before, after in pairwise(beside):
        # steps of 0.4 m on the track, and of at most 0.56 m beside it; 1/90 rad/m at 60 m inside
        assert abs(after.cross_track_error - before.cross_track_error) < 2e-2
        assert abs(wrap_angle(after.course - before.course)) < 8e-3
        if easement:
            # 1/R over the easement's length: 0.4 / (150 . 40) = 6.7e-5 for each step
            assert abs(after.curvature - before.curvature) < 1.6e-4


@pytest.mark.parametrize("easement", [0.0, 150.0])
@pytest.mark.parametrize("direction", SENSES)
def test_on_the_axis_everything_is_finite(direction, easement):
    for along in (-300.0, -10.0, 0.0, 10.0, 299.0, 300.0):
        point = racetrack(easement, direction).nearest(along, 0.0)
        assert math.isfinite(point.course + point.curvature)
        assert abs(point.cross_track_error) <= RADIUS


def test_half_way_through_the_easement_the_curvature_is_half():
    # the end of the leg, 150 m west of the axis: half of the 40 m are behind
    point = racetrack(40.0).nearest(300.0, -150.0)
    assert point.curvature == pytest.approx(0.5 / RADIUS, rel=0.005)
    # a clothoid of 40 m to 1/150 has turned by s²/(2 R L) = 20²/(2.150.40) = 0.0333 rad in its middle
    assert point.course == pytest.approx(0.0333, abs=2e-4)
    # and lies s³/(6 R L) = 20³/(6.150.40) = 0.222 m inward of the leg: the vehicle is that far outside
    assert point.cross_track_error == pytest.approx(-0.222, abs=2e-3)
