import math

import pymap3d
import pytest
from pymap3d.rcurve import meridian, transverse
from pymap3d.vincenty import vdist

from sitl_stub.geometry import displace, radii_m


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 47.0, 89.0])
def test_radii_of_curvature_agree_with_pymap3d(latitude_deg):
    meridian_m, transverse_m = radii_m(math.radians(latitude_deg))
    assert meridian_m == pytest.approx(float(meridian(latitude_deg)), abs=1e-6)
    assert transverse_m == pytest.approx(float(transverse(latitude_deg)), abs=1e-6)


def test_two_kilometres_north_in_half_metre_moves_are_two_kilometres_on_the_ellipsoid():
    latitude, longitude = math.radians(47.0), math.radians(8.0)
    for _ in range(4000):
        latitude, longitude = displace(latitude, longitude, 0.0, north_m=0.5, east_m=0.0)
    distance_m, azimuth_deg = vdist(47.0, 8.0, math.degrees(latitude), math.degrees(longitude))
    assert float(distance_m) == pytest.approx(2000.0, abs=1e-3)
    assert float(azimuth_deg) == pytest.approx(0.0, abs=1e-6)


def test_a_short_move_is_the_same_in_a_tangent_plane_at_altitude():
    latitude, longitude = displace(
        math.radians(-33.0), math.radians(151.0), 800.0, north_m=3.0, east_m=-4.0
    )
    east_m, north_m, up_m = pymap3d.geodetic2enu(
        math.degrees(latitude), math.degrees(longitude), 800.0, -33.0, 151.0, 800.0
    )
    assert (north_m, east_m, up_m) == pytest.approx((3.0, -4.0, 0.0), abs=1e-5)


def test_eastward_across_the_date_line_continues_in_the_west():
    _, longitude = displace(0.0, math.radians(179.99999), 0.0, north_m=0.0, east_m=100.0)
    assert math.degrees(longitude) == pytest.approx(-179.99911, abs=1e-5)
