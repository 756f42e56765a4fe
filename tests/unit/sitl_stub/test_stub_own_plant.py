"""A plant and an autopilot of one's own in the emulator."""

import math
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import pytest

from sitl_stub import (
    AirPlant,
    AirRates,
    AirState,
    PlantParameters,
    SteadyWind,
    load_plugins,
    options_of,
    plant,
    plant_of,
)
from sitl_stub.loops import Targets
from sitl_stub.personality import Personality, autopilots, personality
from tests.kit.autopilot import GroundStation, new_autopilot
from tests.kit.plants import flown, held

EXAMPLE = Path(__file__).parents[3] / "examples" / "own_plant.py"
STEP_S = 0.025


def measured(**options: float) -> PlantParameters:
    load_plugins([EXAMPLE])
    return PlantParameters(kind="measured", options=options_of(options))


@pytest.mark.parametrize(("damping", "overshoot"), [(0.4, 0.254), (0.8, 0.0152)])
def test_a_second_order_course_overshoots_by_its_damping(damping, overshoot):
    # exp(-pi D / sqrt(1 - D²)): 0.254 and 0.0152 of a step of 0.1 rad
    states = flown(measured(course_damping=damping), held(0.1), 12.0, step_s=STEP_S)
    courses = [math.remainder(one.direction_rad, math.tau) for one in states]
    assert max(courses) == pytest.approx(0.1 * (1.0 + overshoot), rel=0.01)
    assert courses[-1] == pytest.approx(0.1, abs=1e-3)


def test_speed_comes_to_what_is_commanded_and_the_bank_limits_the_turn():
    states = flown(measured(), held(3.0, 24.0), 15.0, step_s=STEP_S)
    assert states[-1].speed_m_s == pytest.approx(24.0, abs=0.01)
    # g tan(45 degrees) / 20 m/s = 0.49 rad/s at most
    turns = [
        math.remainder(b.direction_rad - a.direction_rad, math.tau) / STEP_S
        for a, b in pairwise(states)
    ]
    assert 0.35 < max(turns) <= 0.4904


def test_it_is_carried_by_the_wind_and_flies_the_course_through_it():
    wind = SteadyWind(5.0, math.pi / 2.0)
    last = flown(measured(), held(), 20.0, wind, step_s=STEP_S)[-1]
    motion = plant_of(measured()).motion(held(), last, wind.at(0.0))
    # the nose points asin(5/20) = 14.48 degrees into the wind, so that it flies north at sqrt(400 - 25) m/s
    heading_deg = math.degrees(math.remainder(motion.heading_rad, math.tau))
    assert heading_deg == pytest.approx(-14.48, abs=0.01)
    assert (motion.north_m_s, motion.east_m_s) == pytest.approx((19.365, 0.0), abs=0.01)


def test_an_option_that_it_does_not_have_is_named_with_those_that_it_has():
    with pytest.raises(ValueError, match="measured has no option damping; it has course_damping"):
        plant_of(measured(damping=0.3))
    with pytest.raises(ValueError, match="option course_damping must be finite"):
        plant_of(measured(course_damping=math.nan))


def test_what_leaves_something_out_or_takes_a_name_is_refused(tmp_path):
    file = tmp_path / "partly.py"
    file.write_text(
        "from sitl_stub import AirPlant, plant\n\n@plant('partly')\nclass Partly(AirPlant): pass\n"
    )
    with pytest.raises(
        ValueError, match=r"partly\.py: ValueError: the class of partly has no rates"
    ):
        load_plugins([file])
    with pytest.raises(ValueError, match="there is no such file of Python"):
        load_plugins([tmp_path / "absent.py"])
    with pytest.raises(ValueError, match="bank: there is a plant of this name already"):
        plant("bank")(Still)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drag:
    drag_1_s: float = 0.1


class Still(AirPlant):
    """It answers nothing, and slows down."""

    Options = Drag

    def rates(self, targets: Targets, state: AirState) -> AirRates:
        del targets
        return AirRates(
            turn_rate_rad_s=0.0, acceleration_m_s2=-self.options.drag_1_s * state.airspeed_m_s
        )


def test_a_plant_without_memory_needs_none_and_keeps_to_its_airspeed_range():
    plant("still")(Still)
    aircraft = PlantParameters(kind="still", options=options_of({"drag_1_s": 0.5}))
    states = flown(aircraft, held(), 5.0, step_s=STEP_S)
    # 20 e^-0.5 = 12.13 m/s after a second; 12 m/s is the slowest that is flown
    assert states[40].speed_m_s == pytest.approx(20.0 * math.exp(-0.5), abs=0.01)
    assert states[-1].speed_m_s == 12.0


def test_the_example_is_one_file_that_needs_nothing_of_vfguide():
    assert "vfguide" not in "".join(
        line for line in EXAMPLE.read_text().splitlines() if line.startswith(("import", "from"))
    )
    assert type(plant_of(measured())).__name__ == "Measured"


AUTOPILOT = Path(__file__).parents[3] / "examples" / "own_emulated_autopilot.py"
MANUAL, LOITER, GUIDED = 0, 12, 15


@pytest.fixture
def ground() -> GroundStation:
    load_plugins([AUTOPILOT])
    return GroundStation(new_autopilot(system_id=1, autopilot="brief"), 1)


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
    load_plugins([AUTOPILOT])
    with pytest.raises(ValueError, match="breif is not one of ardupilot, px4, brief"):
        new_autopilot(autopilot="breif")


def test_a_class_that_leaves_its_modes_out_is_refused_and_a_name_is_taken_once():
    class Partly(Personality):
        firmware = 3

    with pytest.raises(ValueError, match=re.escape("the class of partly has no modes; write it")):
        personality("partly")(Partly)
    assert "partly" not in autopilots
    with pytest.raises(ValueError, match="px4: there is an autopilot of this name already"):
        personality("px4")(Personality)
