"""The local frame against distances on the ellipsoid worked out by hand, and against itself."""

import math

import pymap3d
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.frames import WGS84, LocalFrame, earth_centred, wrap_longitude

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=150)
ORIGIN = (47.397742, 8.545594, 488.0)
PLACE = st.floats(-5000.0, 5000.0)


def test_the_origin_is_the_origin():
    assert LocalFrame(*ORIGIN).to_local(*ORIGIN[:2]) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert LocalFrame(*ORIGIN).to_geodetic(0.0, 0.0) == pytest.approx(ORIGIN[:2], abs=1e-12)


def test_a_thousandth_of_a_degree_at_the_equator():
    # east: 6378137 m . pi/180000 = 111.3195 m; north: a (1 - e²) = 6335439.3 m . pi/180000 = 110.5743 m
    frame = LocalFrame(0.0, 0.0, 0.0)
    assert frame.to_local(0.0, 0.001) == pytest.approx((0.0, 111.3195), abs=1e-3)
    assert frame.to_local(0.001, 0.0) == pytest.approx((110.5743, 0.0), abs=1e-3)
    # Across the date line east is still east.
    across = LocalFrame(0.0, 179.9995, 0.0).to_local(0.0, -179.9995)
    assert across == pytest.approx((0.0, 111.3195), abs=1e-3)


def test_a_thousandth_of_a_degree_at_47_degrees_north():
    # e² sin² 47.397742 = 0.00669438 . 0.541844 = 0.00362731; N = 6378137/sqrt(1 - that) = 6389736 m,
    # M = 6335439.3/(1 - that)^1.5 = 6370065 m, both plus 488 m of height
    frame = LocalFrame(*ORIGIN)
    north, _ = frame.to_local(ORIGIN[0] + 0.001, ORIGIN[1])
    assert north == pytest.approx((6370065.0 + 488.0) * math.pi / 180000.0, abs=1e-3)
    _, east = frame.to_local(ORIGIN[0], ORIGIN[1] + 0.001)
    parallel = (6389736.0 + 488.0) * math.cos(math.radians(ORIGIN[0]))
    assert east == pytest.approx(parallel * math.pi / 180000.0, abs=1e-3)


@REPEATABLE
@given(
    north=PLACE,
    east=PLACE,
    latitude_deg=st.sampled_from([-70.0, -33.0, 0.0, ORIGIN[0], 80.0]),
    longitude_deg=st.sampled_from([-179.9, ORIGIN[1], 151.0]),
)
def test_within_kilometres_the_way_back_is_good_to_a_tenth_of_a_millimetre(
    north, east, latitude_deg, longitude_deg
):
    frame = LocalFrame(latitude_deg, longitude_deg, 300.0)
    back = frame.to_local(*frame.to_geodetic(north, east))
    assert back == pytest.approx((north, east), abs=1e-4)


@REPEATABLE
@given(north=PLACE, east=PLACE, by=st.tuples(st.floats(-10.0, 10.0), st.floats(-10.0, 10.0)))
def test_a_shift_moves_by_that_many_metres(north, east, by):
    frame = LocalFrame(*ORIGIN)
    start = frame.to_geodetic(north, east)
    there = frame.shifted(*start, *by)
    # north and east at the place itself, in a frame of its own
    moved = LocalFrame(*start, ORIGIN[2]).to_local(*there)
    assert moved == pytest.approx(by, abs=1e-3)


@pytest.mark.parametrize("distance", [-60e3, 60e3])
def test_sixty_kilometres_away_a_shift_by_ten_metres_is_right_to_a_millimetre(distance):
    # M changes by 3 e² sin cos (60/6371) = 0.9e-4 of itself: 0.9 mm of 10 m
    frame = LocalFrame(*ORIGIN)
    start = (ORIGIN[0] + math.degrees(distance / 6370553.0), ORIGIN[1])
    moved = LocalFrame(*start, ORIGIN[2]).to_local(*frame.shifted(*start, 10.0, 10.0))
    assert moved == pytest.approx((10.0, 10.0), abs=1.1e-3)


def test_a_shift_by_nothing_changes_nothing_and_others_count_at_the_origins_height():
    # a picodegree is a tenth of a micrometre
    moved = LocalFrame(*ORIGIN).shifted(47.4, 8.6, 0.0, 0.0)
    assert moved == pytest.approx((47.4, 8.6), abs=1e-12)
    # 5000 m up a degree is longer by 5000/6370000: without it 10 m would be 8 mm short
    frame = LocalFrame(*ORIGIN[:2], 5000.0)
    moved = frame.to_local(*frame.shifted(*ORIGIN[:2], 10.0, -10.0))
    assert moved == pytest.approx((10.0, -10.0), abs=1e-4)


@pytest.mark.parametrize(
    ("start", "east", "there"), [(179.9995, 1.0, -1.0), (-179.9995, -1.0, 1.0)]
)
def test_a_shift_across_the_date_line_stays_within_half_a_turn(start, east, there):
    # 0.001 degrees at the equator are 111.3195 m: as far beyond the line as it was before
    moved = LocalFrame(0.0, start, 0.0).shifted(0.0, start, 0.0, east * 111.3195)
    assert moved == pytest.approx((0.0, there * 179.9995), abs=1e-9)


@pytest.mark.parametrize(
    ("longitude", "wrapped"),
    [
        *((0.0, 0.0), (8.5, 8.5), (180.0, -180.0), (-180.0, -180.0)),
        *((180.5, -179.5), (-180.5, 179.5), (540.0, -180.0), (725.0, 5.0)),
    ],
)
def test_a_longitude_is_wrapped_to_half_a_turn_either_way(longitude, wrapped):
    assert wrap_longitude(longitude) == wrapped


@pytest.mark.parametrize("latitude", [-90.0, -89.9, -45.0, -0.001, 0.0, 12.3, 47.397742, 90.0])
@pytest.mark.parametrize("longitude", [-180.0, -77.7, 0.0, 8.545594, 135.0])
@pytest.mark.parametrize("altitude", [-100.0, 0.0, 588.0, 9000.0])
def test_a_place_is_where_the_library_for_arrays_has_it(latitude, longitude, altitude):
    library = pymap3d.geodetic2ecef(latitude, longitude, altitude, WGS84)
    assert earth_centred(latitude, longitude, altitude) == pytest.approx(library, abs=1e-9, rel=0.0)
