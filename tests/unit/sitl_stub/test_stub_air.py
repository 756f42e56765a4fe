"""The air that aircraft share, sensors that err as real ones do, and the shape of the earth."""

import math

import numpy as np
import pymap3d
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from numpy.random import default_rng
from pymap3d.rcurve import meridian, transverse

from sitl_stub import ArticleWind, CalmWind, PlantParameters, Shear, SteadyWind, air_of
from sitl_stub.air import (
    SHORTEST_WAVE_M,
    Air,
    AirPlace,
    Intensity,
    TurbulenceField,
    earth_centred_m,
    local_axes,
    low_altitude_intensity,
    wave_numbers,
)
from sitl_stub.geometry import MIN_GROUND_SPEED_M_S, displace, ground_speed_along_m_s, radii_m
from sitl_stub.sensor_errors import GaussMarkov, SensorErrors, SensorGrade
from sitl_stub.settings import parse_gust
from tests.kit.autopilot import new_station

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
    # exp(-30 m / 263 m) = 0.89.
    [(0.0, 2.0, 0.97, 1.0), (0.0, 30.0, 0.8, 0.95), (5000.0, 0.0, -0.15, 0.15)],
)
def test_neighbours_share_most_of_a_gust_and_far_apart_nothing(north_m, east_m, least, greatest):
    airs = [turbulent(seed) for seed in range(400)]
    pairs = [(air.at(HERE, 0.0)[1], air.at(beside(north_m, east_m), 0.0)[1]) for air in airs]
    assert least < float(np.corrcoef(np.array(pairs).T)[0, 1]) < greatest


def test_a_gust_of_the_command_line_rises_to_its_greatest_and_ends():
    here = Air(SteadyWind(5.0, 0.0), gusts=(parse_gust("10,4,6,-2"),)).near(HERE)
    told = [*here.at(10.0), *here.at(11.0), *here.at(12.0), *here.at(14.0)]
    assert told == pytest.approx([5.0, 0.0, 8.0, -1.0, 11.0, -2.0, 5.0, 0.0])
    with pytest.raises(ValueError, match="gust"):
        parse_gust("60,0,6,-2")


def test_the_wind_grows_with_the_logarithm_of_the_height():
    # ln(50 / 0.05) / ln(100 / 0.05) = 6.9078 / 7.6009.
    air = Air(SteadyWind(10.0, 0.0), shear=Shear(reference_m=100.0, roughness_m=0.05))
    assert air.near(HERE).at(0.0) == pytest.approx((10.0, 0.0))
    low = replace(HERE, height_m=50.0)
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


FIELDS = 300
"""Over so many seeds an average is good to some percent."""

INTENSITY = Intensity(length_m=200.0, deviation_m_s=2.0)


@pytest.fixture(scope="module")
def fields() -> list[TurbulenceField]:
    """Fields of many seeds."""
    return [TurbulenceField(INTENSITY, seed) for seed in range(FIELDS)]


def covariances(fields, distances_m):
    """Covariance of (along, across, across) at the first of some points on the x axis with all of them."""
    points = np.zeros((3, distances_m.size))
    points[0] = distances_m
    total = np.zeros((3, distances_m.size))
    # Every field at eight places far from each other, as good as eight fields.
    for field in fields:
        for place in range(8):
            gusts = field.at(points + 4000.0 * place)
            total += gusts * gusts[:, :1]
    return total / (8 * len(fields))


@pytest.mark.parametrize(
    ("level", "height_m", "length_ft", "deviation_kn", "within"),
    [
        # h = 328.08 ft, a = 0.44701: L = 328.08 / 0.38050 = 862.2 ft, sigma = 3.0 kn / 0.72466.
        ("moderate", 100.0, 862.2, 4.140, 1e-3),
        ("light", 100.0, 862.2, 2.070, 1e-3),
        # Above the model its upper end holds: at 1000 ft a is 1, L = 1000 ft and sigma = 0.1 W20.
        ("severe", 2000.0, 1000.0, 4.5, 1e-6),
    ],
)
def test_turbulence_is_that_of_the_standard(level, height_m, length_ft, deviation_kn, within):
    intensity = low_altitude_intensity(level, height_m)
    assert intensity.length_m == pytest.approx(length_ft * 0.3048, rel=within)
    assert intensity.deviation_m_s == pytest.approx(deviation_kn * 0.514444, rel=within)


def test_gusts_along_and_across_the_way_correlate_as_drydens_do(fields):
    distances_m = np.array([0.0, 20.0, 60.0, 200.0, 400.0])
    share = np.exp(-distances_m / 200.0)
    across = (1.0 - distances_m / 400.0) * share
    # At no distance it is the variance, 2 m/s squared.
    found = covariances(fields, distances_m) / 4.0
    assert found == pytest.approx(np.array([share, across, across]), abs=0.06)


def test_air_does_not_pile_up():
    field, step_m = TurbulenceField(INTENSITY, 3), 0.01
    rng = np.random.default_rng(1)
    for centre in rng.uniform(-1e4, 1e4, (20, 3)):
        slopes = [
            (field.at(centre + offset)[axis] - field.at(centre - offset)[axis]) / (2 * step_m)
            for axis, offset in enumerate(step_m * np.eye(3))
        ]
        assert abs(sum(slopes)) < 1e-6
        assert max(map(abs, slopes)) > 1e-3


@given(seed=st.integers(0, 2**32 - 1), length_m=st.floats(20.0, 400.0))
def test_no_wave_is_shorter_than_an_aircraft_feels(seed, length_m):
    numbers = wave_numbers(length_m, np.random.default_rng(seed))
    assert np.all(np.diff(numbers) >= 0.0)
    assert numbers[0] > 0.0
    assert numbers[-1] <= 2.0 * math.pi / SHORTEST_WAVE_M * (1.0 + 1e-9)


def errors_of(seed: int, system_id: int, grade: SensorGrade = "standalone") -> SensorErrors:
    """The errors of one aircraft."""
    return SensorErrors(grade, seed=seed, system_id=system_id)


def norths(system_id, grade="standalone"):
    """Errors of an aircraft's first position on many flights."""
    return np.array([errors_of(seed, system_id, grade).position_m(0.0)[0] for seed in range(400)])


def test_ideal_sensors_have_no_errors():
    ideal = errors_of(1, 1, "ideal")
    assert ideal.position_m(3.0) == (0.0, 0.0)
    assert ideal.velocity_m_s() == (0.0, 0.0)
    assert (ideal.altitude_m(3.0), ideal.heading_rad(), ideal.airspeed_m_s()) == (0.0, 0.0, 0.0)
    assert (ideal.calibration, ideal.clock_rate) == (1.0, 0.0)


def test_a_gauss_markov_process_keeps_its_variance_and_forgets_with_its_time():
    process = GaussMarkov(2.0, 30.0, default_rng(1))
    values = np.array([process.at(float(second)) for second in range(60_000)])
    assert np.std(values) == pytest.approx(2.0, rel=0.05)
    later = float(np.corrcoef(values[:-30], values[30:])[0, 1])
    assert later == pytest.approx(math.exp(-1.0), abs=0.05)


def test_neighbours_share_the_metres_and_differ_by_decimetres():
    one, other = norths(1), norths(2)
    # 1.26 m shared and 0.2 m of its own, on one axis; 0.28 m apart on it, 0.4 m on both.
    assert np.std(one) == pytest.approx(math.hypot(1.26, 0.2), rel=0.1)
    assert np.std(one - other) == pytest.approx(math.sqrt(2.0) * 0.2, rel=0.1)


def test_positions_wander_and_do_not_jump():
    errors = errors_of(5, 3)
    path = np.array([errors.position_m(0.05 * step)[0] for step in range(2400)])
    assert np.std(np.diff(path)) < 0.05
    assert np.ptp(path) > 0.2


def test_the_same_seed_gives_the_same_errors_however_often_they_are_asked_for():
    often, seldom = errors_of(9, 4), errors_of(9, 4)
    for second in range(100):
        often.altitude_m(float(second))
    # The white part differs, the wandering one is the same to the centimetre.
    assert often.position_m(100.0) == pytest.approx(seldom.position_m(100.0), abs=0.15)


def test_a_better_receiver_is_better():
    rtk, sbas, standalone = (np.std(norths(1, grade)) for grade in ("rtk", "sbas", "standalone"))
    assert rtk < 0.02 < sbas < standalone


LATERAL = 9.80665


def test_a_course_reaches_its_loop_after_the_dead_time_and_is_flown_as_without_it():
    prompt, late = new_station(), new_station(plant=PlantParameters(course_dead_time_s=0.3))
    for vehicle in (prompt, late):
        vehicle.guided()
        vehicle.command_int(43002, 0, 0.0, LATERAL)
        vehicle.advance(10.0)
        vehicle.command_int(43002, 0, 20.0, LATERAL)
    assert late.flown(10.29).course_rad == pytest.approx(0.0, abs=1e-6)
    prompt.advance(11.0)
    assert late.flown(11.3).course_rad == pytest.approx(prompt.truth.course_rad, abs=1e-6)


def test_a_stream_of_speeds_is_delayed_and_not_swallowed():
    prompt, late = new_station(), new_station(plant=PlantParameters(speed_dead_time_s=0.5))
    for vehicle, delay_s in ((prompt, 0.0), (late, 0.5)):
        vehicle.guided()
        for index in range(200):
            vehicle.command_int(43000, 0, 20.0 + 0.02 * index, 0.0)
            vehicle.advance(0.05 * (index + 1))
        vehicle.advance(10.0 + delay_s)
    assert late.truth.airspeed_m_s == pytest.approx(prompt.truth.airspeed_m_s, abs=1e-9)


def test_what_was_commanded_before_a_change_of_mode_does_not_come_after_it():
    vehicle = new_station(plant=PlantParameters(course_dead_time_s=1.0)).guided()
    vehicle.command_int(43002, 0, 180.0, LATERAL)
    vehicle.command_long(176, 1, 10)  # AUTO flies straight on
    assert math.remainder(vehicle.flown(10.0).course_rad, math.tau) == pytest.approx(0.0, abs=1e-6)


def test_tecs_brings_its_own_dead_time_unless_it_is_given_one():
    assert PlantParameters(speed_response="tecs").speed_delay_s == 0.5
    assert PlantParameters(speed_response="tecs", speed_dead_time_s=0.0).speed_delay_s == 0.0
    assert PlantParameters().speed_delay_s == 0.0
    with pytest.raises(ValueError, match="course_dead_time_s"):
        PlantParameters(course_dead_time_s=-0.1)


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 47.0, 89.0])
def test_radii_of_curvature_agree_with_pymap3d(latitude_deg):
    meridian_m, transverse_m = radii_m(math.radians(latitude_deg))
    assert meridian_m == pytest.approx(float(meridian(latitude_deg)), abs=1e-6)
    assert transverse_m == pytest.approx(float(transverse(latitude_deg)), abs=1e-6)


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
