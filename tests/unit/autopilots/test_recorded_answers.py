"""The emulator answers and behaves as the real autopilots whose answers were recorded."""

import math

import pytest
import yaml
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl_stub import Autopilot, CalmWind
from sitl_stub.settings import Settings
from tests.autopilots.answers import RECORDINGS, Answers
from tests.autopilots.emulated import Emulated

AIRCRAFT = yaml.safe_load((RECORDINGS / "responses.yaml").read_text())["autopilots"]
"""With the parameters that they bring."""


def on_the_ground(autopilot: str) -> Emulated:
    """One that stands on the ground, disarmed."""
    place = {"system_id": 7, "start": (47.0, 8.0, 0.0, 0.0), "airspeed_m_s": 15.0}
    loop = {"loop_rate_hz": 50.0} if autopilot == "arduplane-factory" else {}
    config = Settings.of({**AIRCRAFT[autopilot], **place, **loop}).config()
    return Emulated(Autopilot(config, CalmWind()), 7)


def ordered(subject: Emulated, command: int, *values: float) -> None:
    """Command something, and see it accepted."""
    assert subject.result(subject.command_long(command, *values)) == "ACCEPTED"


def loitering_px4() -> Emulated:
    subject = on_the_ground("px4-factory")
    ordered(subject, mavlink.MAV_CMD_NAV_TAKEOFF, -1.0, 0.0, 0.0, *[math.nan] * 4)
    ordered(subject, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)
    subject.pass_time(60.0)
    return subject


def loitering_arduplane() -> Emulated:
    subject = on_the_ground("arduplane-factory")
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
