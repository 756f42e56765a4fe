"""Whole flights of the emulator, steered and observed by MAVLink bytes only."""

import math
from typing import Literal

import pytest
from pymap3d.vincenty import vdist

from sitl_stub import ArticleWind, Autopilot, CalmWind, PlantParameters, SteadyWind, Truth, Wind
from tests.kit.autopilot import config_of
from tests.kit.wire import command_long, packed

Kind = Literal["course-hold", "heading-hold"]

LATERAL_M_S2 = 9.80665


def guided(wind: Wind, kind: Kind = "heading-hold", altitude_amsl_m: float = 0.0) -> Autopilot:
    """A northbound aircraft in GUIDED at 20 m/s over 47 N 8 E."""
    config = config_of(
        system_id=1,
        plant=PlantParameters(kind=kind),
        altitude_amsl_m=altitude_amsl_m,
        home_altitude_amsl_m=0.0,
    )
    vehicle = Autopilot(config, wind)
    command(vehicle, 176, 1, 15)
    return vehicle


def command(vehicle: Autopilot, number: int, *parameters: float) -> None:
    vehicle.receive(packed(command_long(number, *parameters, system_id=1)))


def steer(vehicle: Autopilot, course_rad: float) -> None:
    degrees = math.degrees(course_rad) % 360.0
    command(vehicle, 43002, 0, degrees if degrees < 359.99999 else 0.0, LATERAL_M_S2)


def distance_m(vehicle: Autopilot) -> float:
    truth = vehicle.truth()
    return float(vdist(47.0, 8.0, truth.latitude_deg, truth.longitude_deg)[0])


@pytest.mark.parametrize("kind", ["course-hold", "heading-hold"])
def test_100_s_north_at_20_m_s_is_2000_m_on_the_ellipsoid(kind):
    vehicle = guided(CalmWind(), kind)
    steer(vehicle, 0.0)
    vehicle.advance(100.0)
    assert distance_m(vehicle) == pytest.approx(2000.0, abs=0.01)


def test_100_s_in_a_steady_crosswind_is_the_triangle_s_distance():
    vehicle = guided(SteadyWind(5.0, math.pi / 2))
    steer(vehicle, 0.0)
    vehicle.advance(100.0)
    assert distance_m(vehicle) == pytest.approx(1936.4917, abs=0.01)
    assert vehicle.truth().longitude_deg == pytest.approx(8.0, abs=1e-9)


def square(vehicle: Autopilot) -> Truth:
    """Four legs of 30 s, a right turn between them."""
    for leg in range(4):
        steer(vehicle, leg * math.pi / 2.0)
        vehicle.advance(30.0 * (leg + 1))
    return vehicle.truth()


def test_a_square_in_calm_air_is_the_same_whichever_plant_flies_it():
    first, second = (square(guided(CalmWind(), kind)) for kind in ("course-hold", "heading-hold"))
    apart_m, _ = vdist(
        first.latitude_deg, first.longitude_deg, second.latitude_deg, second.longitude_deg
    )
    assert float(apart_m) < 0.001


def test_the_heading_hold_plant_is_disturbed_by_the_article_s_wind():
    vehicle = guided(ArticleWind())
    steer(vehicle, 0.0)
    errors, speeds = [], []
    for index in range(1, 1260):
        vehicle.advance(0.1 * index)
        truth = vehicle.truth()
        errors.append(abs(math.remainder(truth.course_rad, math.tau)))
        speeds.append(truth.ground_speed_m_s)
        assert truth.airspeed_m_s == pytest.approx(20.0)
    # The wind turns the course by up to 2.5 m/s^2 / 20 m/s; the hold takes it back with 1.2 1/s.
    assert 0.05 < max(errors) < 0.15
    assert min(speeds) < 14.0
    assert max(speeds) > 26.0


def test_a_stream_of_turning_commands_is_followed_with_the_lag_of_the_hold():
    # A course ramp of 0.13 rad/s is trailed by 0.13 / 1.2 rad, less what the hold leads in 50 ms.
    vehicle = guided(CalmWind())
    for index in range(600):
        steer(vehicle, 0.13 * 0.05 * index)
        vehicle.advance(0.05 * (index + 1))
    lag_rad = math.remainder(0.13 * 30.0 - vehicle.truth().course_rad, math.tau)
    assert lag_rad == pytest.approx(0.13 / 1.2 + 0.13 * 0.025, abs=2e-3)


def test_an_hour_in_the_article_s_wind_stays_finite_and_on_time():
    vehicle = guided(ArticleWind(), altitude_amsl_m=500.0)
    command(vehicle, 511, 33, 1_000_000)
    vehicle.advance(3600.0)
    truth = vehicle.truth()
    assert truth.time_s == 3600.0
    assert truth.airspeed_m_s == pytest.approx(20.0)
    assert distance_m(vehicle) < 20_000.0
