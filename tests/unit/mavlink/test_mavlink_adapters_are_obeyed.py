import math
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.autopilot import Emulated, address, asked
from vfguide.mavlink.ardupilot import ArduPlane
from vfguide.mavlink.px4 import Px4


def test_arduplane_flies_the_course_airspeed_and_altitude_in_guided_and_goes_back_to_loiter():
    plane, aircraft = ArduPlane(address(component_id=1)), Emulated("ardupilot")
    assert aircraft.autopilot.truth().mode == "LOITER"
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    answers = aircraft.obey(plane.fly(asked(-1.0, 24.0)))
    assert answers == [(43_002, "ACCEPTED"), (43_000, "ACCEPTED")]
    assert aircraft.obey(plane.hold_altitude(520.0)) == [(43_001, "ACCEPTED")]
    aircraft.stream(lambda: plane.fly(asked(-1.0, 24.0)), 30.0)
    assert_flown(aircraft, "GUIDED")
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.autopilot.truth().mode == "LOITER"


def assert_flown(aircraft: Emulated, mode: str) -> None:
    """A course of -1 rad at 24 m/s, 520 m above the sea."""
    truth = aircraft.autopilot.truth()
    assert truth.mode == mode
    assert math.remainder(truth.course_rad + 1.0, math.tau) == pytest.approx(0.0, abs=1e-3)
    assert truth.airspeed_m_s == pytest.approx(24.0, abs=1e-3)
    assert truth.altitude_amsl_m == pytest.approx(520.0, abs=0.1)


def test_arduplane_takes_a_ground_speed_where_the_vehicle_holds_one():
    plane = ArduPlane(address("course-hold", component_id=1))
    aircraft = Emulated("ardupilot", "course-hold")
    aircraft.obey(plane.engage())
    answers = aircraft.obey(plane.fly(asked(1.0, 24.0)))
    assert answers == [(43_002, "ACCEPTED"), (43_000, "ACCEPTED")]


@pytest.mark.parametrize(
    ("steering", "version"),
    [("position", (1, 15)), ("position", (1, 17)), ("position", (1, 18)), ("velocity", (1, 14))],
)
def test_px4_enters_offboard_once_setpoints_arrive_and_flies_the_course_and_airspeed(
    steering, version
):
    plane = Px4(address(component_id=1, px4_steering=steering))
    aircraft = Emulated("px4", version=version)

    def setpoint() -> list[Any]:
        where = aircraft.autopilot.truth()
        return plane.fly(
            replace(
                asked(2.5, 24.0), latitude_deg=where.latitude_deg, longitude_deg=where.longitude_deg
            )
        )

    assert aircraft.obey(plane.engage()) == [(176, "TEMPORARILY_REJECTED")]
    assert aircraft.obey(setpoint()) == [(178, "ACCEPTED")]
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    aircraft.stream(setpoint, 60.0)
    truth = aircraft.autopilot.truth()
    assert truth.mode == "OFFBOARD"
    assert (truth.course_rad, truth.airspeed_m_s) == pytest.approx((2.5, 24.0), abs=1e-3)
    held_m = 588.0 if plane.holds_altitude else 500.0
    assert truth.altitude_amsl_m == pytest.approx(held_m, abs=0.1)
    assert dict(aircraft.autopilot.counters) == {}
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.autopilot.truth().mode == "AUTO.LOITER"


def test_px4_in_guided_course_flies_course_airspeed_and_altitude():
    plane, aircraft = Px4(address(component_id=1)), Emulated("px4")
    assert aircraft.obey(plane.engage()) == [(176, "ACCEPTED")]
    assert aircraft.obey(plane.fly(asked(-1.0, 24.0))) == [(43_002, "ACCEPTED"), (178, "ACCEPTED")]
    assert aircraft.obey(plane.hold_altitude(520.0)) == [(186, "ACCEPTED")]
    aircraft.stream(list, 60.0)
    assert_flown(aircraft, "AUTO.COURSE")
    assert aircraft.obey(plane.hand_back()) == [(176, "ACCEPTED")]
    assert aircraft.autopilot.truth().mode == "AUTO.LOITER"


def test_what_steers_1_14_steers_no_later_px4():
    plane = Px4(address(component_id=1, px4_steering="velocity"))
    aircraft = Emulated("px4")
    aircraft.obey(plane.fly(asked(2.5, 24.0)))
    aircraft.obey(plane.engage())
    before = aircraft.autopilot.truth().course_rad
    aircraft.stream(lambda: plane.fly(asked(2.5, 24.0)), 30.0)
    assert aircraft.autopilot.truth().course_rad == pytest.approx(before, abs=1e-3)


@pytest.mark.parametrize(("kind", "adapter"), [("ardupilot", ArduPlane), ("px4", Px4)])
def test_telemetry_is_granted(kind, adapter):
    aircraft = Emulated(kind)
    requests = adapter(address(component_id=1)).request_telemetry(20.0)
    assert aircraft.obey(requests) == [(511, "ACCEPTED")] * len(requests)
    assert len(requests) == 6


@pytest.mark.parametrize(("kind", "adapter"), [("ardupilot", ArduPlane), ("px4", Px4)])
def test_a_message_for_another_component_is_not_obeyed(kind, adapter):
    aircraft = Emulated(kind)
    assert aircraft.obey(adapter(address(component_id=3)).hand_back()) == []
    assert aircraft.autopilot.counters["for another"] == 1
