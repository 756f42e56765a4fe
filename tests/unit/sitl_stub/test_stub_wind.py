import math

import pytest

from sitl_stub import ArticleWind, CalmWind, SteadyWind
from sitl_stub.geometry import MIN_GROUND_SPEED_M_S, airspeed_of_m_s, ground_speed_along_m_s


def test_calm_is_calm():
    assert CalmWind().at(17.0) == (0.0, 0.0)


def test_steady_wind_is_given_by_where_it_blows_to():
    north, east = SteadyWind(5.0, math.pi / 2).at(3.0)
    assert (north, east) == pytest.approx((0.0, 5.0))


def test_article_wind_starts_at_8_m_s_toward_135_deg():
    north, east = ArticleWind().at(0.0)
    assert (north, east) == pytest.approx((-5.656854, 5.656854))


def test_article_wind_is_5_m_s_toward_315_deg_after_a_quarter_period():
    # 0.1 t = pi/2: W = 5, psi_w = 135 deg + 180 deg.
    north, east = ArticleWind().at(5.0 * math.pi)
    assert (north, east) == pytest.approx((3.535534, -3.535534))


def test_northbound_at_20_m_s_airspeed_in_5_m_s_crosswind_makes_19_365_m_s():
    # sqrt(20^2 - 5^2) = sqrt(375)
    assert ground_speed_along_m_s(0.0, 20.0, 0.0, 5.0) == pytest.approx(19.364917)


@pytest.mark.parametrize(("wind_north", "expected"), [(5.0, 25.0), (-5.0, 15.0)])
def test_tail_and_head_wind_add_and_subtract(wind_north, expected):
    assert ground_speed_along_m_s(0.0, 20.0, wind_north, 0.0) == pytest.approx(expected)


def test_crosswind_above_the_airspeed_leaves_a_small_finite_ground_speed():
    assert ground_speed_along_m_s(0.0, 20.0, 0.0, 25.0) == MIN_GROUND_SPEED_M_S
    assert ground_speed_along_m_s(0.0, 20.0, -30.0, 0.0) == MIN_GROUND_SPEED_M_S


def test_airspeed_of_a_ground_velocity_is_its_difference_to_the_wind():
    # Northbound at 15 over ground, air moving 8 to the east: hypot(15, 8) = 17.
    assert airspeed_of_m_s(0.0, 15.0, 0.0, 8.0) == pytest.approx(17.0)
