"""Whole flights of the emulator, steered and observed by MAVLink bytes only."""

import math
from typing import Literal

import pytest
from pymap3d.vincenty import vdist

from sitl_stub import ArticleWind, CalmWind, PlantParameters, SteadyWind, Truth, Wind
from tests.kit.autopilot import GroundStation, new_station

Kind = Literal["course-hold", "heading-hold"]


def guided(wind: Wind, kind: Kind = "heading-hold") -> GroundStation:
    """A northbound aircraft in GUIDED at 20 m/s over 47 N 8 E, at sea level."""
    level = {"altitude_amsl_m": 0.0, "home_altitude_amsl_m": 0.0}
    return new_station(wind, plant=PlantParameters(kind=kind), **level).guided()


def steer(ground: GroundStation, course_rad: float) -> None:
    degrees = math.degrees(course_rad) % 360.0
    ground.command_long(43002, 0, degrees if degrees < 359.99999 else 0.0, 9.80665)


def distance_m(ground: GroundStation) -> float:
    return float(vdist(47.0, 8.0, ground.truth.latitude_deg, ground.truth.longitude_deg)[0])


@pytest.mark.parametrize(
    ("wind", "kind", "metres"),
    [
        (CalmWind(), "course-hold", 2000.0),
        (CalmWind(), "heading-hold", 2000.0),
        # The triangle's: sqrt(20² - 5²) m/s.
        (SteadyWind(5.0, math.pi / 2), "heading-hold", 1936.4917),
    ],
)
def test_100_s_north_are_the_ground_speed_s_distance_on_the_ellipsoid(wind, kind, metres):
    ground = guided(wind, kind)
    steer(ground, 0.0)
    ground.advance(100.0)
    assert distance_m(ground) == pytest.approx(metres, abs=0.01)
    assert ground.truth.longitude_deg == pytest.approx(8.0, abs=1e-9)


def square(ground: GroundStation) -> Truth:
    """Four legs of 30 s, a right turn between them."""
    for leg in range(4):
        steer(ground, leg * math.pi / 2.0)
        ground.advance(30.0 * (leg + 1))
    return ground.truth


def test_a_square_in_calm_air_is_the_same_whichever_plant_flies_it():
    first, second = (square(guided(CalmWind(), kind)) for kind in ("course-hold", "heading-hold"))
    apart_m, _ = vdist(
        first.latitude_deg, first.longitude_deg, second.latitude_deg, second.longitude_deg
    )
    assert float(apart_m) < 0.001


def test_the_heading_hold_plant_is_disturbed_by_the_article_s_wind():
    ground = guided(ArticleWind())
    steer(ground, 0.0)
    flown = [ground.flown(0.1 * index) for index in range(1, 1260)]
    errors = [abs(math.remainder(truth.course_rad, math.tau)) for truth in flown]
    speeds = [truth.ground_speed_m_s for truth in flown]
    assert [truth.airspeed_m_s for truth in flown] == pytest.approx([20.0] * 1259)
    # The wind turns the course by up to 2.5 m/s^2 / 20 m/s; the hold takes it back with 1.2 1/s.
    assert 0.05 < max(errors) < 0.15
    assert min(speeds) < 14.0
    assert max(speeds) > 26.0


def test_a_stream_of_turning_commands_is_followed_with_the_lag_of_the_hold():
    # A course ramp of 0.13 rad/s is trailed by 0.13 / 1.2 rad, less what the hold leads in 50 ms.
    ground = guided(CalmWind())
    for index in range(600):
        steer(ground, 0.13 * 0.05 * index)
        ground.advance(0.05 * (index + 1))
    lag_rad = math.remainder(0.13 * 30.0 - ground.truth.course_rad, math.tau)
    assert lag_rad == pytest.approx(0.13 / 1.2 + 0.13 * 0.025, abs=2e-3)


def test_an_hour_in_the_article_s_wind_stays_finite_and_on_time():
    ground = guided(ArticleWind())
    ground.command_long(511, 33, 1_000_000)
    ground.advance(3600.0)
    assert ground.truth.time_s == 3600.0
    assert ground.truth.airspeed_m_s == pytest.approx(20.0)
    assert distance_m(ground) < 20_000.0
