import math
from typing import Literal

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import PlantParameters, SteadyWind
from tests.kit.autopilot import GroundStation, new_station

LANDED, TAKING_OFF, FLYING = 1, 3, 2


def on_ground(
    autopilot: Literal["ardupilot", "px4"] = "ardupilot",
    *,
    plant: PlantParameters | None = None,
    ready_after_s: float = 0.0,
) -> GroundStation:
    """Makes an aircraft that stands on the ground at 400 m, its nose to the east."""
    return new_station(
        SteadyWind(3.0, 0.0),
        autopilot=autopilot,
        plant=plant,
        altitude_amsl_m=400.0,
        course_rad=math.pi / 2,
        airborne=False,
        armed=False,
        ready_after_s=ready_after_s,
    )


def landed_state(vehicle: GroundStation) -> int:
    return int(vehicle.command_long(512, 245)[-1].landed_state)


def test_nothing_moves_until_it_is_armed_in_a_mode_that_takes_off():
    vehicle = on_ground()
    start = vehicle.truth
    assert (start.mode, start.armed, landed_state(vehicle)) == ("MANUAL", False, LANDED)
    assert vehicle.result(vehicle.command_long(176, 1, 13)) == "ACCEPTED"
    here = vehicle.flown(10.0)
    assert (here.latitude_deg, here.longitude_deg) == (start.latitude_deg, start.longitude_deg)
    assert here.ground_speed_m_s == 0.0
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"
    assert vehicle.flown(11.0).ground_speed_m_s == pytest.approx(4.0)


@pytest.mark.parametrize("kind", ["heading-hold", "course-hold", "bank"])
def test_arduplane_takes_off_climbs_and_loiters_ahead_of_the_runway(kind):
    vehicle = on_ground(plant=PlantParameters(kind=kind))
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    vehicle.advance(8.0)
    assert landed_state(vehicle) == TAKING_OFF
    vehicle.advance(120.0)
    assert landed_state(vehicle) == FLYING
    centre_east_deg = 8.0 + 200.0 / 76_060.0
    for second in range(121, 160):
        truth = vehicle.flown(float(second))
        north_m = (truth.latitude_deg - 47.0) * 111_180.0
        east_m = (truth.longitude_deg - centre_east_deg) * 76_060.0
        assert math.hypot(north_m, east_m) == pytest.approx(80.0, abs=20.0)
        assert truth.altitude_amsl_m == pytest.approx(450.0, abs=2.5)
    assert vehicle.truth.mode == "TAKEOFF"


def test_px4_takes_off_by_command_and_ends_in_a_loiter():
    vehicle = on_ground("px4")
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"
    assert vehicle.result(vehicle.command_long(22, 0, 0, 0, math.nan)) == "ACCEPTED"
    assert vehicle.truth.mode == "AUTO.TAKEOFF"
    truth = vehicle.flown(90.0)
    assert truth.mode == "AUTO.LOITER"
    assert truth.altitude_amsl_m == pytest.approx(450.0, abs=2.5)


def test_a_mode_that_does_not_take_off_ends_the_roll_and_a_reboot_on_the_ground_disarms():
    vehicle = on_ground()
    vehicle.command_long(400, 1)
    vehicle.command_long(176, 1, 13)
    vehicle.advance(1.0)
    vehicle.command_long(176, 1, 0)
    assert vehicle.flown(5.0).ground_speed_m_s == 0.0
    assert vehicle.truth.armed
    vehicle.command_long(246, 1)
    assert not vehicle.truth.armed


@pytest.mark.parametrize(
    ("autopilot", "refusal"), [("ardupilot", "FAILED"), ("px4", "TEMPORARILY_REJECTED")]
)
def test_it_is_not_armed_before_its_sensors_have_settled(autopilot, refusal):
    vehicle = on_ground(autopilot, ready_after_s=3.0)
    replies = vehicle.command_long(400, 1)
    assert vehicle.result(replies) == refusal
    assert replies[-1].text.startswith("Arm: Waiting for GPS")
    health = vehicle.command_long(512, 1)[-1].onboard_control_sensors_health
    assert health & 0x10000020 == 0
    vehicle.advance(3.0)
    assert vehicle.result(vehicle.command_long(400, 1)) == "ACCEPTED"


def test_arduplane_does_not_arm_with_an_airspeed_it_cannot_fly():
    vehicle = on_ground()
    vehicle.write("AIRSPEED_MIN", 3.0)
    replies = vehicle.command_long(400, 1)
    assert vehicle.result(replies) == "FAILED"
    assert replies[-1].text == "Arm: AIRSPEED_MIN too low (3 < 5)"
    assert vehicle.result(vehicle.command_long(400, 1, 2989)) == "ACCEPTED"


def test_in_the_air_it_is_disarmed_by_force_only():
    vehicle = new_station()
    assert vehicle.result(vehicle.command_long(400, 0)) == "FAILED"
    assert vehicle.truth.armed
    assert vehicle.result(vehicle.command_long(400, 0, 21196)) == "ACCEPTED"
    heartbeat = vehicle.advance(0.0)[0]
    assert not heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED
    assert vehicle.result(vehicle.command_long(400, 2)) == "UNSUPPORTED"
