import math

import pytest

from sitl_stub import PlantParameters
from tests.kit.autopilot import new_station

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
