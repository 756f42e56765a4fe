"""The air that aircraft share: gusts of neighbours, discrete gusts, and a wind that grows with height."""

import math

import numpy as np
import pytest

from sitl_stub import ArticleWind, CalmWind, DiscreteGust, Shear, SteadyWind, air_of
from sitl_stub.air import Air, AirPlace, earth_centred_m, local_axes
from sitl_stub.geometry import displace
from sitl_stub.options import parse_gust

HERE = AirPlace(math.radians(47.4), math.radians(8.5), 588.0, 100.0)


def beside(north_m: float, east_m: float) -> AirPlace:
    """A place so far from the usual one."""
    latitude_rad, longitude_rad = displace(
        HERE.latitude_rad, HERE.longitude_rad, HERE.altitude_m, north_m=north_m, east_m=east_m
    )
    return AirPlace(latitude_rad, longitude_rad, HERE.altitude_m, HERE.height_m)


def turbulent(seed: int, wind: SteadyWind | CalmWind | ArticleWind | None = None) -> Air:
    """Moderate turbulence in a wind, calm if none is given."""
    return air_of(wind or CalmWind(), level="moderate", height_m=100.0, seed=seed)


def test_an_air_with_nothing_in_it_is_the_wind_itself():
    wind = SteadyWind(5.0, 1.0)
    assert Air(wind).near(HERE) is wind


def test_two_processes_with_one_seed_meet_the_same_gusts():
    one, other = turbulent(7), turbulent(7)
    assert one.at(HERE, 12.5) == other.at(HERE, 12.5)
    assert one.at(HERE, 12.5) != turbulent(8).at(HERE, 12.5)


def test_gusts_drift_with_the_wind():
    # 8 m/s toward east for 5 s: what was here is then 40 m farther east.
    air = turbulent(3, SteadyWind(8.0, math.pi / 2))
    assert air.at(beside(0.0, 40.0), 5.0) == pytest.approx(air.at(HERE, 0.0), abs=1e-3)


@pytest.mark.parametrize(("distance_m", "least", "greatest"), [(2.0, 0.97, 1.0), (30.0, 0.8, 0.95)])
def test_neighbours_share_most_of_a_gust(distance_m, least, greatest):
    pairs = np.array(
        [
            (air.at(HERE, 0.0)[1], air.at(beside(0.0, distance_m), 0.0)[1])
            for air in (turbulent(seed) for seed in range(400))
        ]
    )
    shared = float(np.corrcoef(pairs.T)[0, 1])
    # exp(-30 m / 263 m) = 0.89.
    assert least < shared < greatest


def test_far_apart_they_share_nothing():
    pairs = np.array(
        [
            (air.at(HERE, 0.0)[1], air.at(beside(5000.0, 0.0), 0.0)[1])
            for air in (turbulent(seed) for seed in range(400))
        ]
    )
    assert abs(float(np.corrcoef(pairs.T)[0, 1])) < 0.15


def test_a_discrete_gust_rises_to_its_greatest_and_ends():
    air = Air(
        SteadyWind(5.0, 0.0),
        gusts=(DiscreteGust(start_s=10.0, length_s=4.0, north_m_s=6.0, east_m_s=-2.0),),
    )
    assert air.near(HERE).at(10.0) == (5.0, 0.0)
    assert air.near(HERE).at(11.0) == pytest.approx((8.0, -1.0))
    assert air.near(HERE).at(12.0) == pytest.approx((11.0, -2.0))
    assert air.near(HERE).at(14.0) == (5.0, 0.0)


def test_a_gust_of_the_command_line_is_read():
    assert parse_gust("60,4,6,-2") == DiscreteGust(
        start_s=60.0, length_s=4.0, north_m_s=6.0, east_m_s=-2.0
    )
    with pytest.raises(ValueError, match="gust"):
        parse_gust("60,0,6,-2")


def test_the_wind_grows_with_the_logarithm_of_the_height():
    # ln(50 / 0.05) / ln(100 / 0.05) = 6.9078 / 7.6009.
    air = Air(SteadyWind(10.0, 0.0), shear=Shear(reference_m=100.0, roughness_m=0.05))
    assert air.near(HERE).at(0.0) == pytest.approx((10.0, 0.0))
    low = HERE._replace(height_m=50.0)
    assert air.near(low).at(0.0)[0] == pytest.approx(9.0882, rel=1e-4)


def test_places_are_told_apart_as_far_as_they_are():
    north, east = local_axes(HERE)
    apart_m = earth_centred_m(beside(30.0, -40.0)) - earth_centred_m(HERE)
    assert (north @ apart_m, east @ apart_m) == pytest.approx((30.0, -40.0), abs=0.01)
