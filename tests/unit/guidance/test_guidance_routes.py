"""Routes between waypoints: lengths and places worked out by hand, curvature, ends, heights."""

import math
import pickle
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from vfguide.mission.flight_path import path_of, shape_of
from vfguide.paths.chain import ChainedPath
from vfguide.paths.pieces import Bend, circle_entry, turn_back

CORNERS = ((0.0, 0.0), (1000.0, 0.0), (1000.0, 800.0), (0.0, 800.0))
"""Of a rectangle, in m north and east, flown clockwise."""

Places = Sequence[tuple[float, ...]]


def route(places: Places = CORNERS, **fields: object) -> ChainedPath:
    names = ("north_m", "east_m", "up_m")
    waypoints = [dict(zip(names, place, strict=False)) for place in places]
    path = path_of(shape_of({"type": "waypoints", "waypoints": waypoints, **fields}))
    assert isinstance(path, ChainedPath)
    return path


def misfits(places: Places, **fields: object) -> list[tuple[Any, str]]:
    with pytest.raises(ValidationError) as caught:
        route(places, **fields)
    return [(one["loc"][1:], one["msg"]) for one in caught.value.errors()]


def ends_of_pieces(path: ChainedPath) -> tuple[np.ndarray[Any, Any], ...]:
    """(course, curvature, next course, next curvature) at every joint, the last one included."""
    pieces = path.chain.pieces
    curvature = pieces.curvature + pieces.growth * pieces.length
    course = pieces.course + pieces.length * 0.5 * (pieces.curvature + curvature)
    again = int(np.searchsorted(pieces.progress, (path.chain.again or 0.0) - 1e-6))
    following = np.append(np.arange(1, course.size), again)
    return course, curvature, pieces.course[following], pieces.curvature[following]


@pytest.mark.parametrize("end", ["repeat", "reverse", "loiter"])
def test_course_and_curvature_are_continuous_and_within_the_radius(end):
    path = route(end=end, radius_m=120.0)
    course, curvature, next_course, next_curvature = ends_of_pieces(path)
    turned = np.remainder(course - next_course + math.pi, 2.0 * math.pi) - math.pi
    assert np.abs(turned).max() < 1e-9
    assert np.abs(curvature - next_curvature).max() < 1e-12
    assert np.abs(curvature).max() == pytest.approx(1.0 / 120.0)
    # and nowhere does the place jump
    pieces, step = path.chain.pieces, 1e-6
    for progress in pieces.progress[1:].tolist():
        before, after = path.at(progress - step), path.at(progress + step)
        gap = math.hypot(after.north - before.north, after.east - before.east)
        assert gap == pytest.approx(2.0 * step, abs=1e-9)


def test_a_route_that_loiters_circles_around_its_last_waypoint():
    for radius_m, sense in ((150.0, 1.0), (-150.0, -1.0)):
        path = route(end="loiter", radius_m=100.0, loiter_radius_m=radius_m)
        circle = path.at(np.linspace(path.chain.again or 0.0, path.length, 50))
        assert np.hypot(circle.north, circle.east - 800.0) == pytest.approx(150.0)
        assert circle.curvature == pytest.approx(sense / 150.0)
        # further on it goes round and round
        there, again = path.at(path.length + 10.0), path.at(path.length + 10.0 + 300.0 * math.pi)
        assert (there.north, there.east) == (pytest.approx(again.north), pytest.approx(again.east))


def test_the_last_leg_touches_the_circle_and_does_not_cross_it():
    path = route(((0.0, 0.0), (1000.0, 0.0)), end="loiter", radius_m=100.0, easement_m=0.0)
    # the tangent from 1000 m away to a circle of 100 m: asin 0.1 to its left
    assert path.at(0.0).course == pytest.approx(-math.asin(0.1), abs=1e-5)
    assert path.chain.again == pytest.approx(math.sqrt(1000.0**2 - 100.0**2), abs=0.1)
    places = path.at(np.linspace(0.0, path.length, 500))
    assert np.hypot(places.north - 1000.0, places.east).min() == pytest.approx(100.0, abs=1e-3)
    entry = circle_entry(Bend(100.0, 60.0), 1.0)
    # the shift of an easement of length s and linear curvature would be s² / 24 R = 1.5 m
    assert 100.5 < entry.aside < 101.5


def test_a_route_that_is_reversed_passes_its_waypoints_both_ways():
    path = route(((0.0, 0.0), (1000.0, 0.0), (1000.0, 900.0)), end="reverse", radius_m=100.0)
    there, back = (path.nearest(400.0, 3.0, course) for course in (0.0, math.pi))
    assert (there.cross_track_error, back.cross_track_error) == pytest.approx((3.0, -3.0))
    assert there.progress == pytest.approx(400.0)
    # as far before the end of the round as the turn at the beginning is long
    turn = sum(one.length for one in turn_back(Bend(100.0, 100.0)))
    assert path.length - back.progress - 400.0 == pytest.approx(turn, abs=300.0)
    assert path.at(path.length).north == pytest.approx(0.0, abs=1e-6)


def test_heights_climb_evenly_and_are_eased_where_the_slope_changes():
    places = ((0, 0, 0), (3000, 0, 60), (6000, 0, 60), (9000, 0, 0))
    path = route(places, end="loiter", radius_m=100)
    # 2 % between the first two, begun and ended by curves of 120 m: level at the very beginning
    assert path.at(0.0).slope == pytest.approx(0.0)
    assert path.at(1000.0).slope == pytest.approx(60.0 / 2940.0)
    assert path.at(3000.0).slope == pytest.approx(30.0 / 2940.0, abs=1e-4)
    # the curve lies below the corner by slope times a quarter of its half length: 0.0204 * 60 / 4
    assert path.at(3000.0).height == pytest.approx(60.0 - 60.0 / 2940.0 * 15.0, abs=1e-3)
    assert path.at(4500.0).height == pytest.approx(60.0)
    assert path.nearest(4500.0, 20.0, 0.0).height == pytest.approx(60.0)
    run = np.linspace(0.0, path.length, 40_000)
    places = path.at(run)
    rises = np.diff(places.height) / np.diff(run)
    assert np.abs(rises - 0.5 * (places.slope[1:] + places.slope[:-1])).max() < 1e-5
    assert np.abs(np.diff(places.slope)).max() / np.diff(run)[0] < 1.1 * 0.0408 / 120.0


def test_a_closed_route_comes_back_to_its_height():
    places = ((0, 0, 0), (1000, 0, 20), (1000, 1000, 40), (0, 1000, 20))
    path = route(places, end="repeat", radius_m=100)
    run = np.linspace(-200.0, path.length + 200.0, 4000)
    there, again = path.at(run), path.at(run + path.length)
    assert np.abs(there.height - again.height).max() < 1e-9
    assert 0.0 < there.height.min() < there.height.max() < 40.0
    assert np.abs(np.diff(there.height)).max() < 0.02 * np.diff(run)[0] * 1.5


LEG = st.tuples(st.floats(300.0, 1500.0), st.floats(-2.2, 2.2), st.floats(-30.0, 30.0))
ROUTES = st.lists(LEG, min_size=2, max_size=7)


def places_of(legs: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    """Waypoints by length and turn of each leg, as routes have them that were drawn one after the other."""
    north = east = up = course = 0.0
    places = [(0.0, 0.0, 0.0)]
    for length, turn, rise in legs:
        course += turn
        north += length * math.cos(course)
        east += length * math.sin(course)
        up += rise
        places.append((north, east, up))
    return places


@settings(max_examples=30, deadline=None)
@given(
    legs=ROUTES,
    end=st.sampled_from(["reverse", "loiter"]),
    north=st.floats(-2000.0, 2000.0),
    east=st.floats(-2000.0, 2000.0),
)
def test_the_nearest_place_of_any_route_is_the_nearest(legs, end, north, east):
    path = route(places_of(legs), end=end, radius_m=50.0, loiter_radius_m=60.0)
    point = path.nearest(north, east)
    places = path.at(np.arange(0.0, path.length, 1.0))
    least = np.hypot(places.north - north, places.east - east).min()
    # a metre along, and the 0.25 m by which a chord of 0.2 rad and 10 m differs from its bend
    assert abs(point.cross_track_error) <= least + 0.8
    if point.progress > 0.0:
        found = path.at(point.progress)
        away = math.hypot(found.north - north, found.east - east)
        assert away == pytest.approx(abs(point.cross_track_error), abs=1e-3 + 1e-3 * away)
        assert away >= least - 0.6


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])
@given(legs=ROUTES, right=st.floats(-15.0, 15.0))
def test_the_progress_of_a_vehicle_beside_any_route_never_jumps(legs, right):
    path = route(places_of(legs), end="reverse", radius_m=50.0)
    run = np.arange(0.0, path.length - 1.0, 7.3)
    places = path.at(run)
    north = places.north - right * np.sin(places.course)
    east = places.east + right * np.cos(places.course)
    # Where another branch of about the same course is as near, either may be meant.
    others = path.at(np.arange(0.0, path.length, 5.0))
    apart = np.abs(run[:, None] - np.arange(0.0, path.length, 5.0))
    alike = np.cos(places.course[:, None] - others.course) > math.cos(2.0)
    other_branch = alike & (np.minimum(apart, path.length - apart) > 80.0)
    distances = np.hypot(north[:, None] - others.north, east[:, None] - others.east)
    assume(np.where(other_branch, distances, np.inf).min() > 3.0 * abs(right) + 5.0)
    point = path.nearest(north, east, places.course)
    away = np.abs(point.progress - run)
    assert np.minimum(away, path.length - away).max() < 1e-3
    assert np.abs(point.cross_track_error - right).max() < 1e-3


def test_geodetic_waypoints_count_from_the_origin_of_the_mission():
    origin = {"latitude_deg": 47.0, "longitude_deg": 8.0}
    frame = {**origin, "altitude_amsl_m": 500.0, "height_above_origin_m": 100.0, "radius_m": 80.0}
    # one minute of latitude is 1853.2 m here, one of longitude 1268.2 m
    north = {"latitude_deg": 47.0 + 1.0 / 60.0}
    waypoints = [
        {**origin, "altitude_amsl_m": 600.0},
        {**origin, **north, "altitude_amsl_m": 630.0},
        {**north, "longitude_deg": 8.0 + 1.0 / 60.0},
    ]
    shape = shape_of({"type": "waypoints", "waypoints": waypoints, "frame": frame})
    path = path_of(shape)
    corner = path.nearest(1853.2, 0.0)
    assert abs(corner.cross_track_error) < 60.0
    assert corner.height == pytest.approx(30.0, abs=2.0)
    assert np.abs(path.at(path.outline(400)).curvature).max() == pytest.approx(1.0 / 80.0, rel=1e-3)
    assert pickle.loads(pickle.dumps(shape)) == shape  # noqa: S301 - our own


SQUASHED = ((0, 0), (500, 0), (500, 150), (0, 150))
SHARP = {"end": "repeat", "radius_m": 100, "easement_m": 0}
NO_CIRCLE = "a circle of less than 10 m; write 10 or more, or -10 or less"


@pytest.mark.parametrize(
    ("places", "fields", "location", "message"),
    [
        (((0, 0), (0, 0.5), (9, 9)), {}, ("waypoints", 1), "is the same place as waypoint 1"),
        (((0, 0), (900, 0), (0, 10), (9, 900)), {}, ("waypoints", 1), "turns back by 179°"),
        (
            SQUASHED,
            SHARP,
            ("waypoints", 2),
            "150 m long, its fillets need 200 m at a radius of 100",
        ),
        (((0, 0), (90, 0)), {"radius_m": 100}, ("waypoints", 1), "reaches beyond the waypoint"),
        (CORNERS, {"loiter_radius_m": 0}, ("loiter_radius_m",), NO_CIRCLE),
        # 80 km north and 60 km east are 100 km away; a metre more is not flown
        (((0, 0), (80e3, 60_001)), {}, ("waypoints", 1), "is 100 km away from the origin"),
    ],
)
def test_what_does_not_fit_together_is_named_with_its_place(places, fields, location, message):
    found = misfits(places, **fields)
    assert found[0][0][-len(location) :] == location
    assert message in found[0][1]
    assert route(((0.0, 0.0), (80e3, 60e3))).length > 100e3
