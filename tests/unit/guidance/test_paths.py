"""What every path has in common, heights of climbs, and the fields around lines and circles."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from vfguide.elementwise import FloatArray, wrap_angle
from vfguide.errors import InputError
from vfguide.guidance.airframe import polar, resolve
from vfguide.guidance.path import (
    Direction,
    Path,
    desired_course,
    desired_course_rate_per_speed,
    tangent_rate_per_speed,
)
from vfguide.mission.flight_path import path_of, shape_of
from vfguide.paths import Curve
from vfguide.paths.chain import closed_spline
from vfguide.paths.circle import Circle, Helix
from vfguide.paths.climb import Climb
from vfguide.paths.line import Line
from vfguide.paths.racetrack import Racetrack


class Eight(Curve):
    """The lemniscate of Gerono, 400 m to either side."""

    name = "eight"

    def trace(self, shape: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = 2.0 * np.pi * share
        return shape * np.sin(angle), shape * np.sin(angle) * np.cos(angle)


class Bridge(Eight):
    """Its second way over its middle is 40 m higher than its first."""

    name = "bridge"

    def height(self, shape: float, share: FloatArray) -> FloatArray:
        return 0.05 * shape * (1.0 - np.cos(2.0 * np.pi * share))


Trace = Callable[[float, FloatArray], tuple[FloatArray, FloatArray]]


def curve(name: str, trace: Trace, height: Callable[..., FloatArray] | None = None) -> type[Curve]:
    """A kind of path by its functions of shape and share."""
    functions: dict[str, Any] = {"trace": trace}
    if height is not None:
        functions["height"] = height
    members = {what: staticmethod(function) for what, function in functions.items()}
    return type(name, (Curve,), {"name": name, **members})


def around(shape: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A circle, clockwise from due north, its shares not in proportion to the distance."""
    angle = 2.0 * np.pi * share**1.5
    return shape * np.cos(angle), shape * np.sin(angle)


Round = curve("round", around)
EIGHT = Eight(400.0)
CORNERS = [
    {"north_m": north, "east_m": east}
    for north, east in ((0, 0), (700, 100), (600, 700), (1000, 1000), (-100, 1100))
]
CIRCLE = Circle(north=30.0, east=-40.0, radius=150.0, direction=-1)
LINE = {"north": 10.0, "east": 20.0, "course": 2.0}
TRACK = {"north": 5.0, "east": 6.0, "course": 1.0, "leg": 400.0, "radius": 150.0}
WAYPOINTS = {"type": "waypoints", "waypoints": CORNERS, "end": "repeat", "radius_m": 90}
PATHS: dict[str, Path] = {
    "line": Line(**LINE),
    "climbing line": Line(**LINE, climb=Climb(slope=0.1, end=60.0)),
    "helix": Helix(circle=CIRCLE, climb=Climb(slope=0.1, end=600.0)),
    "circle": CIRCLE,
    "circle about the origin": Circle(north=0.0, east=0.0, radius=150.0, direction=1),
    "racetrack": Racetrack(**TRACK, direction=-1, easement=80.0),
    "racetrack without easement": Racetrack(**TRACK, direction=1),
    "eight": EIGHT,
    "eight with a bridge": Bridge(400.0),
    "figure-eight": path_of(shape_of({"type": "figure-eight", "half_length_m": 500})),
    "waypoints": path_of(shape_of(WAYPOINTS)),
}


@pytest.mark.parametrize("name", PATHS)
@settings(max_examples=60, deadline=None)
@given(progress=st.floats(0.0, 5000.0), right=st.floats(-40.0, 40.0))
def test_a_place_beside_the_path_is_found_again_where_it_is(name, progress, right):
    path = PATHS[name]
    place = path.at(progress)
    north = place.north - right * math.sin(place.course)
    east = place.east + right * math.cos(place.course)
    point = path.nearest_in_space(north, east, place.course, place.height)
    # on an easement the distance is measured across the plain figure: 1 - cos(easement / 8 R), 0.22 %
    within = 1e-3 + (2.3e-3 * abs(right) if name == "racetrack" else 0.0)
    assert point.cross_track_error == pytest.approx(right, abs=within)
    off_course = math.remainder(point.course - place.course, 2.0 * math.pi)
    assert off_course == pytest.approx(0.0, abs=0.02 if name == "racetrack" else 1e-4)
    # beside an easement a racetrack's progress, which is that of the plain figure, is metres off
    apart = 8.0 if name == "racetrack" else 0.01
    run = point.progress - progress
    if math.isfinite(path.length):
        run = math.remainder(run, path.length)
    assert run == pytest.approx(0.0, abs=apart)


@pytest.mark.parametrize("name", PATHS)
@settings(max_examples=40, deadline=None)
@given(progress=st.floats(0.0, 5000.0))
def test_a_path_runs_along_its_course_and_turns_by_its_curvature(name, progress):
    path, step = PATHS[name], 0.02
    here, there = path.at(progress), path.at(progress + step)
    along, right = resolve(there.north - here.north, there.east - here.east, here.course)
    # an easement is some per cent longer or shorter than the plain figure that gives the progress
    assert along == pytest.approx(step, rel=0.15 if name == "racetrack" else 1e-3)
    assert abs(right) < 1e-4
    assert there.height - here.height == pytest.approx(here.slope * step, abs=1e-6)
    turn = math.remainder(there.course - here.course, 2.0 * math.pi)
    mean = 0.5 * (here.curvature + there.curvature)
    if "racetrack" not in name:
        assert turn == pytest.approx(mean * step, abs=2e-6)


@pytest.mark.parametrize("name", PATHS)
def test_arrays_are_found_as_each_of_their_places_alone(name):
    path = PATHS[name]
    rng = np.random.default_rng(1)
    north, east, course = rng.uniform(-500.0, 500.0, (3, 40))
    many = path.nearest(north, east, course)
    for index in range(40):
        one = path.nearest(float(north[index]), float(east[index]), float(course[index]))
        for field in ("course", "cross_track_error", "curvature", "progress", "height", "slope"):
            found = np.broadcast_to(getattr(many, field), 40)[index]
            assert found == pytest.approx(getattr(one, field), abs=1e-9)


@pytest.mark.parametrize(
    ("course_deg", "runs_deg", "height"), [(50, 45, 0.0), (120, 135, 40.0), (160, 135, 40.0)]
)
def test_where_a_path_crosses_itself_the_vehicles_course_tells_branch_and_height(
    course_deg, runs_deg, height
):
    # through its middle the eight runs at 45 degrees, and half a round later at 135
    point = PATHS["eight with a bridge"].nearest(3.0, 4.0, math.radians(course_deg))
    assert math.degrees(point.course) == pytest.approx(runs_deg, abs=1.5)
    assert point.height == pytest.approx(height, abs=0.01)


def test_a_vehicle_that_flies_straight_on_keeps_its_branch_all_the_way_across():
    course = math.radians(45.0)
    for run in np.linspace(-60.0, 60.0, 121):
        point = EIGHT.nearest(run * math.cos(course), run * math.sin(course), course)
        assert math.degrees(point.course) == pytest.approx(45.0, abs=8.0)
        assert abs(point.cross_track_error) < 2.0


def test_the_nearest_point_of_a_curve_moves_evenly_with_the_vehicle():
    # A jump of the course from one millimetre to the next would be a jump of the setpoint.
    place = EIGHT.at(700.0)
    course = place.course
    steps = np.arange(0.0, 5.0, 1e-3)
    north = place.north + steps * math.cos(course) - 20.0 * math.sin(course)
    east = place.east + steps * math.sin(course) + 20.0 * math.cos(course)
    found = EIGHT.nearest(north, east, np.full_like(north, course))
    assert np.abs(np.diff(np.unwrap(found.course))).max() < 2e-5
    assert np.abs(np.diff(found.cross_track_error)).max() < 1.2e-3


def test_a_traced_circle_is_the_circle():
    traced, circle = Round(200.0), Circle(north=0.0, east=0.0, radius=200.0, direction=1)
    assert traced.length == pytest.approx(circle.length, rel=1e-6)
    for bearing in np.linspace(0.1, 6.2, 20):
        place = (230.0 * math.cos(bearing), 230.0 * math.sin(bearing))
        one, other = traced.nearest(*place), circle.nearest(*place)
        assert one.cross_track_error == pytest.approx(other.cross_track_error, abs=1e-3)
        assert one.curvature == pytest.approx(other.curvature, rel=2e-3)
        assert one.progress == pytest.approx(other.progress, abs=0.05)


def test_a_place_that_is_not_known_has_no_nearest_point_and_none_raises_anything():
    found = EIGHT.nearest(np.array([math.nan, 1.0]), np.array([0.0, 2.0]), np.array([0.0, 0.8]))
    assert math.isnan(found.cross_track_error[0])
    assert math.isfinite(found.cross_track_error[1])
    for far in (1e12, 1e200, math.inf):
        assert math.isfinite(EIGHT.nearest(far, 0.0, 0.0).course)


def test_a_curve_climbs_as_its_heights_do():
    path = PATHS["eight with a bridge"]
    outline = path.at(np.linspace(0.0, path.length, 4000))
    # Half way round it is highest; the share is that of the angle, not of the way.
    assert float(np.max(outline.height)) == pytest.approx(40.0, abs=1e-3)
    steps = np.gradient(outline.height, path.length / 3999.0)
    assert outline.slope == pytest.approx(steps, abs=1e-3)
    assert EIGHT.at(300.0).height == 0.0


def outward(shape: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A spiral: it does not end where it begins."""
    return shape * (1.0 + share) * np.cos(6.0 * share), shape * np.sin(6.0 * share)


def square(shape: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A square from the middle of a side, with corners."""
    corners = np.array([0.0, 0.125, 0.375, 0.625, 0.875, 1.0])
    north = np.interp(share, corners, [1.0, 1.0, -1.0, -1.0, 1.0, 1.0])
    east = np.interp(share, corners, [0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    return shape * north, shape * east


def hippodrome(shape: float, share: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Legs of 3000 m, and half circles of 50 m of which a hundred even steps see next to nothing."""
    track = Racetrack(north=0.0, east=0.0, course=0.0, leg=3000.0, radius=shape, direction=1)
    place = track.at(share * track.length)
    return place.north, place.east


Ramp = curve("ramp", around, lambda shape, share: 0.05 * shape * share)
"""It climbs by 10 m all the way round."""
Roof = curve("roof", around, lambda shape, share: 0.5 * shape - np.abs(shape * (share - 0.5)))
"""It climbs evenly and descends evenly, by half of its radius."""
Headless = curve("headless", around, lambda shape, share: share[int(shape) :])
"""Its heights cannot be told."""
Failing = curve("failing", lambda shape, share: (share / shape, share[int(shape) :]))
"""It cannot be traced."""


@pytest.mark.parametrize(
    ("path", "radius"),
    [
        (curve("hippodrome", hippodrome)(50.0), 50.0),
        (Racetrack(north=0.0, east=0.0, course=0.0, leg=90e3, radius=100.0, direction=1), 100.0),
    ],
    ids=["curve", "racetrack"],
)
def test_the_tightest_bend_of_a_path_is_looked_at_however_short_it_is(path, radius):
    seen = np.abs(path.at(path.outline(97)).curvature)
    assert 1.0 / radius <= seen.max() < 1.2 / radius
    assert (seen > 0.5 / radius).sum() > 40


def test_round_a_small_curve_a_vehicle_that_flies_the_wrong_way_is_beside_its_own_side():
    point = Round(60.0).nearest(60.0, 0.0, math.radians(-90.0))
    assert math.remainder(point.course - math.pi / 2.0, 2.0 * math.pi) == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize(
    ("kind", "shape", "words"),
    [
        (
            curve("square", square),
            100.0,
            r"path square: it has a corner near north -?\d+ m, east -?\d+ m; round it",
        ),
        (Failing, 3.0, r"trace\(\) gives \(100000,\) and \(99997,\) for \(100000,\) shares"),
        (Failing, math.nan, r"trace\(\) fails \(ValueError in test_paths.py:\d+"),
        (curve("spiral", outward), 100.0, "path spiral: the curve that it traces ends"),
        (Round, 0.0, "has no length"),
        (Ramp, 200.0, r"path ramp: it ends 10 m above where it begins; mend height\(\)"),
        (Roof, 200.0, r"path roof: its height has an edge near north -?\d+ m, east -?\d+ m; round"),
        (Headless, 200.0, r"path headless: height\(\) gives \(1057,\) for \(1257,\) shares"),
        (Eight, math.nan, "not finite"),
    ],
)
def test_a_curve_that_cannot_be_flown_is_refused_in_a_line(kind, shape, words):
    with pytest.raises(InputError, match=words):
        kind(shape)


def test_a_figure_eight_is_the_lemniscate_of_its_half_length():
    shape = {"half_length_m": 300, "course_deg": 90, "centre": {"north_m": 50}}
    path = path_of(shape_of(shape | {"type": "figure-eight"}))
    # Gauss's constant: the lemniscate of half length 1 is 5.2441151085842396 long
    assert path.length == pytest.approx(300.0 * 5.2441151085842396, rel=1e-12)
    quarter = path.at(path.length / 4.0)
    assert (quarter.north, quarter.east) == (pytest.approx(50.0), pytest.approx(300.0))
    assert quarter.curvature == pytest.approx(3.0 / 300.0, rel=1e-6)
    middle = path.at(path.length / 2.0)
    assert (middle.north, middle.east) == (pytest.approx(50.0), pytest.approx(0.0, abs=1e-6))
    assert middle.curvature == pytest.approx(0.0, abs=1e-9)
    # out at 45 degrees to the left of its axis, and back at 45 to the left of the other way
    assert math.degrees(path.at(0.0).course) == pytest.approx(45.0)
    assert math.degrees(middle.course) == pytest.approx(90.0 + 225.0)
    other = path_of(shape_of(shape | {"type": "figure-eight", "direction": "counterclockwise"}))
    assert other.at(other.length / 4.0).curvature == pytest.approx(-3.0 / 300.0, rel=1e-6)


def test_the_spline_through_the_corners_of_a_square_has_the_slopes_of_its_symmetry():
    # m = a times the corner turned by 90 degrees: 4 a = 3 (1 + 1), a = 1.5; second derivative
    # 6 ((0, 1) - (1, 0)) - 4 (0, 1.5) - 2 (-1.5, 0) = (-3, 0) at (1, 0)
    corners = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
    first, second = closed_spline(corners, 1.0)
    assert first == pytest.approx(1.5 * np.array([[0, 1], [-1, 0], [0, -1], [1, 0]]), abs=1e-12)
    assert second == pytest.approx(-3.0 * corners, abs=1e-12)


RISE = Climb(slope=0.1, end=60.0)
"""Its slope alone takes 600 m to the end; 100 m more are eased."""

HELIX = Helix(circle=Circle(north=0.0, east=0.0, radius=150.0, direction=1), climb=RISE)
NORTHBOUND = {"type": "line", "course_deg": 0.0}
ROUND = {"type": "helix", "radius_m": 100.0, "centre": {"north_m": 0.0, "east_m": 0.0}}


@pytest.mark.parametrize(
    ("progress", "height", "slope"),
    [
        (-10.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        # Midway of the easement: a quarter of what it gains, half of the slope.
        (50.0, 1.25, 0.05),
        (100.0, 5.0, 0.1),
        (350.0, 30.0, 0.1),
        (600.0, 55.0, 0.1),
        (650.0, 58.75, 0.05),
        (700.0, 60.0, 0.0),
        (5000.0, 60.0, 0.0),
    ],
)
def test_a_climb_is_eased_at_both_ends(progress, height, slope):
    assert RISE.at(progress) == (pytest.approx(height), pytest.approx(slope))
    # A descent is a climb upside down.
    descent = Climb(slope=-0.1, end=-60.0)
    assert descent.at(progress) == (pytest.approx(-height), pytest.approx(-slope))


def test_a_short_climb_is_eased_all_the_way_and_one_without_an_end_goes_on():
    # 20 m of way at the slope: eased over 20 m each, 40 m in all.
    short = Climb(slope=0.1, end=2.0)
    assert short.at(20.0) == (pytest.approx(1.0), pytest.approx(0.1))
    assert short.at(40.0) == (pytest.approx(2.0), pytest.approx(0.0, abs=1e-12))
    assert Climb(slope=0.1, end=math.inf).at(10_050.0) == (pytest.approx(1000.0), 0.1)


@settings(deadline=None)
@given(st.floats(0.0, 5000.0), st.floats(-40.0, 40.0))
def test_the_height_tells_which_turn_of_a_helix_is_flown(progress, off):
    # A turn is 94 m high.
    high = replace(HELIX, climb=Climb(slope=0.1, end=600.0))
    place = high.at(progress)
    point = high.nearest_in_space(place.north, place.east, place.course, place.height + off)
    assert point.progress == pytest.approx(progress, abs=1e-6)
    assert (point.height, point.slope) == (pytest.approx(place.height), pytest.approx(place.slope))


def test_above_a_helix_a_vehicle_goes_round_level_and_at_the_flying_height_begins_with_its_turns():
    for progress in np.linspace(0.0, 942.0, 50):
        place = HELIX.at(float(progress))
        point = HELIX.nearest_in_space(place.north, place.east, place.course, 60.5)
        assert (point.height, point.slope) == (pytest.approx(60.0), pytest.approx(0.0, abs=1e-9))
    for progress in (200.0, -200.0):
        place = HELIX.at(progress)
        point = HELIX.nearest_in_space(place.north, place.east, place.course, 0.0)
        assert point.progress == pytest.approx(progress)
    assert point.height == 0.0


@pytest.mark.parametrize(
    "fields",
    [
        {**NORTHBOUND, "climb_deg": 5.0, "end_height_m": -10.0},
        {**NORTHBOUND, "end_height_m": 10.0},
        {**ROUND, "climb_deg": -5.0, "end_height_m": 10.0},
        {**ROUND, "climb_deg": 0.0, "end_height_m": 10.0},
        {**ROUND, "climb_deg": 40.0, "end_height_m": 10.0},
    ],
)
def test_a_climb_that_does_not_lead_to_its_end_is_refused(fields):
    with pytest.raises(ValidationError, match=r"climb_deg|less than or equal"):
        shape_of(fields)


REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=200)
GAIN = 0.03

SENSES: tuple[Direction, Direction] = (1, -1)
ARTICLE_PATHS: list[Path] = [
    Line(north=10.0, east=-20.0, course=0.7),
    Line(north=0.0, east=0.0, course=4.0),
    Circle(north=30.0, east=40.0, radius=150.0, direction=1),
    Circle(north=30.0, east=40.0, radius=150.0, direction=-1),
]


@REPEATABLE
@given(
    bearing=st.floats(-math.pi, math.pi),
    distance=st.floats(0.1, 1e6),
    direction=st.sampled_from(SENSES),
    gain=st.floats(0.001, 1.0),
)
@example(bearing=0.5, distance=150.0, direction=1, gain=GAIN)
@example(bearing=-2.5, distance=150.0, direction=-1, gain=GAIN)
def test_the_circle_field_is_the_articles(bearing, distance, direction, gain):
    # The tangent on the circle itself; far away it points at the centre.
    circle = Circle(north=12.0, east=-34.0, radius=150.0, direction=direction)
    north, east = polar(distance, bearing)
    point = circle.nearest(12.0 + north, -34.0 + east)
    article = bearing + direction * (math.pi / 2.0 + math.atan(gain * (distance - 150.0)))
    off = wrap_angle(desired_course(point, gain, math.pi / 2.0) - article)
    assert off == pytest.approx(0.0, abs=1e-8)
    assert point.cross_track_error == pytest.approx(direction * (150.0 - distance), abs=1e-8)
    assert point.curvature == pytest.approx(direction / 150.0)


@pytest.mark.parametrize(
    ("path", "position", "course"),
    list(product(ARTICLE_PATHS, [(100.0, 220.0), (-140.0, -30.0), (60.0, 60.0)], [0.3, 2.0, -2.5])),
)
def test_along_a_flight_field_and_tangent_turn_at_the_analytic_rates(path, position, course):
    (north, east), step, approach = position, 1e-3, math.pi / 2.0
    ahead = path.nearest(north + step * math.cos(course), east + step * math.sin(course))
    behind = path.nearest(north - step * math.cos(course), east - step * math.sin(course))
    here = path.nearest(north, east)
    # over the ground by +-1 mm: what changes per metre flown is the rate per m/s of ground speed
    tangent = wrap_angle(ahead.course - behind.course) / (2.0 * step)
    assert tangent_rate_per_speed(here, course) == pytest.approx(tangent, abs=1e-8)
    change = desired_course(ahead, GAIN, approach) - desired_course(behind, GAIN, approach)
    rate = desired_course_rate_per_speed(here, course, GAIN, approach)
    assert rate == pytest.approx(wrap_angle(change) / (2.0 * step), abs=1e-8)


@pytest.mark.parametrize("direction", SENSES)
def test_at_the_centre_of_a_circle_everything_is_finite(direction):
    circle = Circle(north=30.0, east=40.0, radius=150.0, direction=direction)
    point = circle.nearest(30.0, 40.0)
    assert abs(point.cross_track_error) == pytest.approx(150.0)
    assert math.isfinite(desired_course(point, GAIN, math.pi / 2.0))
    for course in np.radians(range(0, 360, 45)).tolist():
        rate = desired_course_rate_per_speed(point, course, GAIN, math.pi / 2.0)
        # at most (1/R) / NEAR_CENTRE + k = 0.133 + 0.03 rad/m
        assert abs(rate) < 0.17
