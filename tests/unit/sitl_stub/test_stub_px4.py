import math
from collections.abc import Callable
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind

Station = Callable[..., Any]
Vehicle = Any  # the ground station of conftest.py, which tests cannot import

OFFBOARD = (176, 1, 6)


def offboard(vehicle: Vehicle, north_m_s: float = 0.0, east_m_s: float = 20.0) -> None:
    vehicle.velocity_setpoint(north_m_s, east_m_s)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"


def fly(vehicle: Vehicle, to_s: float, north_m_s: float, east_m_s: float, **options: float) -> None:
    """Stream a setpoint at 10 Hz until `to_s`."""
    start = round(vehicle.autopilot.truth().time_s * 10.0)
    for tenth in range(start, round(to_s * 10.0)):
        vehicle.velocity_setpoint(north_m_s, east_m_s, **options)
        vehicle.advance((tenth + 1) / 10.0)


def test_the_heartbeat_is_px4_s_in_auto_loiter(station: Station) -> None:
    vehicle = station(autopilot="px4")
    heartbeat = vehicle.advance(0.0)[0]
    assert heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4
    assert heartbeat.custom_mode == 0x0304_0000


def test_offboard_without_a_stream_is_rejected(station: Station) -> None:
    vehicle = station(autopilot="px4")
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "TEMPORARILY_REJECTED"


def test_offboard_needs_a_setpoint_within_half_a_second(station: Station) -> None:
    vehicle = station(autopilot="px4")
    vehicle.velocity_setpoint(20.0, 0.0)
    vehicle.advance(0.6)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "TEMPORARILY_REJECTED"
    vehicle.velocity_setpoint(20.0, 0.0)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"
    assert vehicle.autopilot.truth().mode == "OFFBOARD"


def test_the_course_of_the_vector_is_flown_and_its_length_is_ignored(station: Station) -> None:
    vehicle = station(SteadyWind(5.0, 0.0), autopilot="px4")
    offboard(vehicle)
    fly(vehicle, 15.0, 0.0, 35.0)
    truth = vehicle.autopilot.truth()
    assert math.degrees(truth.course_rad) == pytest.approx(90.0, abs=1e-2)
    assert truth.airspeed_m_s == pytest.approx(20.0)


def test_a_lost_stream_leaves_offboard_after_one_second(station: Station) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    vehicle.advance(1.0)
    assert vehicle.autopilot.truth().mode == "OFFBOARD"
    messages = vehicle.advance(1.05)
    assert vehicle.autopilot.truth().mode == "AUTO.LOITER"
    assert [m.text for m in messages if m.get_type() == "STATUSTEXT"] == [
        "Offboard control lost",
        "Mode AUTO.LOITER",
    ]


def test_the_stream_is_lost_just_as_late_in_one_long_advance(station: Station) -> None:
    long, short = station(autopilot="px4"), station(autopilot="px4")
    for vehicle in (long, short):
        offboard(vehicle)
    long.advance(5.0)
    for tenth in range(51):
        short.advance(tenth / 10.0)
    expected, found = short.autopilot.truth(), long.autopilot.truth()
    assert found.mode == "AUTO.LOITER"
    assert found.course_rad == pytest.approx(expected.course_rad, abs=1e-4)


@pytest.mark.parametrize("mask", [2499, 3523])
def test_z_is_flown_as_height_when_it_is_not_masked(station: Station, mask: int) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    fly(vehicle, 40.0, 20.0, 0.0, z=-120.0, mask=mask)
    assert vehicle.autopilot.truth().altitude_amsl_m == pytest.approx(520.0, abs=1e-3)


@pytest.mark.parametrize("mask", [2503, 3527])
def test_a_masked_z_is_ignored(station: Station, mask: int) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    fly(vehicle, 20.0, 20.0, 0.0, z=-120.0, mask=mask)
    assert vehicle.autopilot.truth().altitude_amsl_m == 500.0


@pytest.mark.parametrize("mask", [0, 3527 & ~1, 3527 | 8, 3527 & ~64])
def test_a_setpoint_that_is_not_velocity_only_does_not_count_as_a_stream(
    station: Station, mask: int
) -> None:
    vehicle = station(autopilot="px4")
    vehicle.velocity_setpoint(20.0, 0.0, mask=mask)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "TEMPORARILY_REJECTED"
    assert vehicle.autopilot.counters["unsupported setpoint"] == 1


def test_a_non_finite_setpoint_is_counted_and_does_not_feed_the_stream(station: Station) -> None:
    vehicle = station(autopilot="px4")
    vehicle.velocity_setpoint(math.nan, 0.0)
    vehicle.velocity_setpoint(20.0, 0.0, z=math.inf, mask=3523)
    assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "TEMPORARILY_REJECTED"
    assert vehicle.autopilot.counters["non-finite field"] == 2


def test_the_zero_vector_keeps_the_stream_alive_and_the_course_as_it_was(
    station: Station,
) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    fly(vehicle, 10.0, 0.0, 20.0)
    fly(vehicle, 15.0, 0.0, 0.0)
    truth = vehicle.autopilot.truth()
    assert truth.mode == "OFFBOARD"
    assert math.degrees(truth.course_rad) == pytest.approx(90.0, abs=1e-3)


def test_a_global_setpoint_carries_course_and_height_above_sea_level(station: Station) -> None:
    vehicle = station(autopilot="px4")
    for tenth in range(400):
        vehicle.send(
            mavlink.MAVLink_set_position_target_global_int_message(
                0, 7, 1, 5, 3523, 0, 0, 510.0, 0, 20, 0, 0, 0, 0, 0, 0
            )
        )
        if tenth == 0:
            assert vehicle.result(vehicle.command_long(*OFFBOARD)) == "ACCEPTED"
        vehicle.advance((tenth + 1) / 10.0)
    truth = vehicle.autopilot.truth()
    assert truth.altitude_amsl_m == pytest.approx(510.0, abs=1e-3)
    assert math.degrees(truth.course_rad) == pytest.approx(90.0, abs=1e-3)


def test_speed_comes_by_the_common_command(station: Station) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    assert vehicle.result(vehicle.command_long(178, 0, 24.0)) == "ACCEPTED"
    assert vehicle.result(vehicle.command_long(178, 0, 50.0)) == "DENIED"
    assert vehicle.result(vehicle.command_long(178, 1, 20.0)) == "DENIED"
    fly(vehicle, 15.0, 0.0, 20.0)
    assert vehicle.autopilot.truth().airspeed_m_s == pytest.approx(24.0, abs=1e-3)


def test_the_article_s_plant_takes_a_ground_speed_by_it(station: Station) -> None:
    vehicle = station(
        SteadyWind(5.0, 1.0), autopilot="px4", plant=PlantParameters(kind="course-hold")
    )
    offboard(vehicle)
    assert vehicle.result(vehicle.command_long(178, 1, 22.0)) == "ACCEPTED"
    fly(vehicle, 15.0, 0.0, 1.0)
    assert vehicle.autopilot.truth().ground_speed_m_s == pytest.approx(22.0, abs=1e-3)


@pytest.mark.parametrize("command", [43000, 43001, 43002])
def test_arduplane_s_commands_are_unsupported(station: Station, command: int) -> None:
    vehicle = station(autopilot="px4")
    assert vehicle.result(vehicle.command_long(command)) == "UNSUPPORTED"


@pytest.mark.parametrize(("main", "sub"), [(9, 0), (4, 99), (6, 1), (-1, 0), (6.5, 0), (300, 0)])
def test_modes_that_do_not_exist_are_denied(station: Station, main: float, sub: float) -> None:
    vehicle = station(autopilot="px4")
    vehicle.velocity_setpoint(20.0, 0.0)
    assert vehicle.result(vehicle.command_long(176, 1, main, sub)) == "DENIED"
    assert vehicle.autopilot.truth().mode == "AUTO.LOITER"


def test_position_control_is_left_to_the_pilot(station: Station) -> None:
    vehicle = station(autopilot="px4")
    offboard(vehicle)
    assert vehicle.result(vehicle.command_long(176, 1, 3)) == "ACCEPTED"
    vehicle.velocity_setpoint(-20.0, 0.0)
    vehicle.advance(5.0)
    truth = vehicle.autopilot.truth()
    assert truth.mode == "POSCTL"
    assert truth.course_rad == pytest.approx(0.0, abs=1e-6)


def test_wind_is_not_among_its_messages(station: Station) -> None:
    vehicle = station(autopilot="px4")
    assert vehicle.interval(168, 100_000) == "DENIED"
