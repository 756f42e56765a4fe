"""The emulator answers and behaves as the real autopilots whose answers were recorded."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind, PlantParameters
from tests.autopilots.answers import Answers
from tests.autopilots.emulated import Emulated
from tests.kit.autopilot import config_of

SYSTEM_ID = 7

ARDUPLANE = PlantParameters(
    kind="bank",
    guided_p_cdeg_rad=5000.0,
    turn_efficiency=0.745,
    speed_response="tecs",
    airspeed_min_m_s=10.0,
    airspeed_max_m_s=30.0,
    max_bank_rad=math.radians(65.0),
)
"""Model `plane`, with the parameters that it brings."""

PX4 = PlantParameters(
    kind="npfg",
    alpha_1_s=4.0 * math.pi * 0.7 / 10.0,
    speed_response="px4-untrimmed",
    course_dead_time_s=0.06,
    roll_delay_s=0.2,
    airspeed_min_m_s=10.0,
    airspeed_max_m_s=20.0,
    max_bank_rad=math.radians(50.0),
)
"""SIH's airplane, with the parameters that it brings."""


def on_the_ground(autopilot: str, plant: PlantParameters) -> Emulated:
    """One that stands on the ground, disarmed."""
    config = config_of(
        autopilot=autopilot,
        plant=plant,
        altitude_amsl_m=0.0,
        home_altitude_amsl_m=0.0,
        airspeed_m_s=15.0,
        airborne=False,
        armed=False,
        loop_rate_hz=50.0 if autopilot == "ardupilot" else None,
    )
    return Emulated(Autopilot(config, CalmWind()), SYSTEM_ID)


def ordered(subject: Emulated, command: int, *values: float) -> None:
    """Command something, and see it accepted."""
    assert subject.result(subject.command_long(command, *values)) == "ACCEPTED"


def loitering_px4() -> Emulated:
    subject = on_the_ground("px4", PX4)
    ordered(subject, mavlink.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, *[math.nan] * 4)
    ordered(subject, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    subject.pass_time(60.0)
    return subject


def loitering_arduplane() -> Emulated:
    subject = on_the_ground("ardupilot", ARDUPLANE)
    ordered(subject, mavlink.MAV_CMD_DO_SET_MODE, 1.0, 13.0)
    ordered(subject, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    subject.pass_time(60.0)
    ordered(subject, mavlink.MAV_CMD_DO_SET_MODE, 1.0, 12.0)
    return subject


SUBJECTS = {"px4": loitering_px4, "arduplane": loitering_arduplane}


@pytest.mark.parametrize("autopilot", SUBJECTS)
def test_the_emulator_answers_and_behaves_as_recorded_and_comes_with_the_parameters(autopilot):
    assert Answers(autopilot).asked_of(SUBJECTS[autopilot]()) == []
    assert Answers(autopilot).parameters_of(SUBJECTS[autopilot]()) == []


def test_the_emulator_tells_the_recorded_version():
    assert loitering_px4().version() == Answers("px4").version
