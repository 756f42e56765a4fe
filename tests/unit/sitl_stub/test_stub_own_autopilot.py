"""An autopilot of the user's in the emulator: a file, its name, and what it obeys."""

import math
import re
from pathlib import Path
from typing import Any

import pytest

from sitl_stub import Autopilot, AutopilotConfig, CalmWind, load_plugins
from sitl_stub.personality import Personality, personality
from sitl_stub.registry import autopilots
from tests.kit.autopilot import GroundStation, config_of

Station = Any  # conftest.GroundStation
EXAMPLE = Path(__file__).parents[3] / "examples" / "own_emulated_autopilot.py"
MANUAL, LOITER, GUIDED = 0, 12, 15


def config(autopilot: str) -> AutopilotConfig:
    return config_of(system_id=1, autopilot=autopilot)


@pytest.fixture
def ground() -> Station:
    load_plugins([EXAMPLE])
    return GroundStation(Autopilot(config("brief"), CalmWind()), 1)


def test_it_turns_to_a_course_in_its_guided_mode_alone(ground):
    assert ground.result(ground.command_long(43002, 0, 90, 5)) == "FAILED"
    assert ground.result(ground.command_long(176, 1, GUIDED)) == "ACCEPTED"
    assert ground.result(ground.command_long(43002, 0, 90, 5)) == "ACCEPTED"
    assert ground.result(ground.command_long(43000, 0, 24, 0)) == "ACCEPTED"
    truth = ground.flown(20.0)
    # first order with 1.2 1/s: after 20 s of a quarter turn and 4 m/s nothing is left
    assert truth.course_rad == pytest.approx(math.pi / 2.0, abs=1e-3)
    assert truth.airspeed_m_s == pytest.approx(24.0, abs=1e-3)


def test_what_it_does_not_have_is_refused(ground):
    assert ground.result(ground.command_long(176, 1, 11)) == "DENIED"
    assert ground.result(ground.command_long(43001, 0, 0)) == "UNSUPPORTED"
    ground.guided()
    # its aircraft flies 12 to 32 m/s
    assert ground.result(ground.command_long(43000, 0, 50, 0)) == "FAILED"
    assert ground.result(ground.command_long(43002, 0, math.nan, 5)) == "DENIED"


def test_a_name_that_is_not_known_is_one_line_with_those_that_are():
    load_plugins([EXAMPLE])
    with pytest.raises(ValueError, match=r"one of ardupilot, px4, brief.*not 'breif'"):
        config("breif")


def test_a_class_that_leaves_its_modes_out_is_refused():
    class Partly(Personality):
        firmware = 3

    with pytest.raises(ValueError, match=re.escape("the class of partly has no modes; write it")):
        personality("partly")(Partly)
    assert "partly" not in autopilots


def test_a_name_is_taken_once():
    with pytest.raises(ValueError, match="px4: there is an autopilot of this name already"):
        personality("px4")(Personality)
