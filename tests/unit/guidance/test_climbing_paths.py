"""Heights of paths: where a climb begins and ends, and which turn of a helix is meant."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from vfguide.mission.flight_path import path_of, shape_of
from vfguide.paths.circle import Circle, Helix
from vfguide.paths.climb import Climb

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


def test_a_vehicle_above_the_climb_goes_round_level():
    for progress in np.linspace(0.0, 942.0, 50):
        place = HELIX.at(float(progress))
        point = HELIX.nearest_in_space(place.north, place.east, place.course, 60.5)
        assert (point.height, point.slope) == (pytest.approx(60.0), pytest.approx(0.0, abs=1e-9))


def test_a_vehicle_at_the_flying_height_begins_with_the_first_turn():
    place = HELIX.at(200.0)
    point = HELIX.nearest_in_space(place.north, place.east, place.course, 0.0)
    assert point.progress == pytest.approx(200.0)
    before = HELIX.at(-200.0)
    point = HELIX.nearest_in_space(before.north, before.east, before.course, 0.0)
    assert (point.progress, point.height) == (pytest.approx(-200.0), 0.0)


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


def test_a_line_climbs_from_its_point_on():
    path = path_of(shape_of({**NORTHBOUND, "climb_deg": 22.5, "end_height_m": 90.0}))
    slope = math.tan(math.radians(22.5))
    place = path.at(150.0)
    assert (place.height, place.slope) == (pytest.approx(slope * 100.0), pytest.approx(slope))
    assert path.nearest(10_000.0, 5.0).height == pytest.approx(90.0)
