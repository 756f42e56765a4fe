"""The air that aircraft share: winds, gusts of neighbours, and a wind that grows with height."""

import math

import numpy as np
import pytest

from sitl_stub import ArticleWind, CalmWind, DiscreteGust, Shear, SteadyWind, air_of
from sitl_stub.air import Air, AirPlace, earth_centred_m, local_axes
from sitl_stub.geometry import (
    MIN_GROUND_SPEED_M_S,
    airspeed_of_m_s,
    displace,
    ground_speed_along_m_s,
)
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


@pytest.mark.parametrize(
    ("north_m", "east_m", "least", "greatest"),
    [
        (0.0, 2.0, 0.97, 1.0),
        # exp(-30 m / 263 m) = 0.89.
        (0.0, 30.0, 0.8, 0.95),
        (5000.0, 0.0, -0.15, 0.15),
    ],
)
def test_neighbours_share_most_of_a_gust_and_far_apart_nothing(north_m, east_m, least, greatest):
    airs = [turbulent(seed) for seed in range(400)]
    pairs = [(air.at(HERE, 0.0)[1], air.at(beside(north_m, east_m), 0.0)[1]) for air in airs]
    assert least < float(np.corrcoef(np.array(pairs).T)[0, 1]) < greatest


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


@pytest.mark.parametrize(
    ("wind", "time_s", "north_east"),
    [
        (CalmWind(), 17.0, (0.0, 0.0)),
        # Given by where it blows to.
        (SteadyWind(5.0, math.pi / 2), 3.0, (0.0, 5.0)),
        # 8 m/s toward 135 deg, and after a quarter of the period 5 m/s toward 315 deg.
        (ArticleWind(), 0.0, (-5.656854, 5.656854)),
        (ArticleWind(), 5.0 * math.pi, (3.535534, -3.535534)),
    ],
)
def test_a_wind_is_where_it_blows_to(wind, time_s, north_east):
    assert wind.at(time_s) == pytest.approx(north_east)


@pytest.mark.parametrize(
    ("wind", "expected"),
    [
        # sqrt(20^2 - 5^2) = sqrt(375)
        ((0.0, 5.0), 19.364917),
        ((5.0, 0.0), 25.0),
        ((-5.0, 0.0), 15.0),
        # More wind than airspeed leaves a small finite ground speed.
        ((0.0, 25.0), MIN_GROUND_SPEED_M_S),
        ((-30.0, 0.0), MIN_GROUND_SPEED_M_S),
    ],
)
def test_northbound_at_20_m_s_the_wind_makes_the_ground_speed(wind, expected):
    assert ground_speed_along_m_s(0.0, 20.0, *wind) == pytest.approx(expected)


def test_airspeed_of_a_ground_velocity_is_its_difference_to_the_wind():
    # Northbound at 15 over ground, air moving 8 to the east: hypot(15, 8) = 17.
    assert airspeed_of_m_s(0.0, 15.0, 0.0, 8.0) == pytest.approx(17.0)
