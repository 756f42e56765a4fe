"""The PID baseline: what it answers to an error, and when its integrals stand still."""

from typing import Any

import pytest

from tests.kit.following import follower_step, keeper
from tests.kit.states import choices, leader_at, vehicle_at
from vfguide.guidance.formation import Slot, slot_motion
from vfguide.laws.pid import AxisMemory, axis_step
from vfguide.state import Airframe

PERIOD = 0.05
GAINS: dict[str, Any] = {
    "proportional": 0.1,
    "integral": 0.02,
    "derivative": 0.5,
    "filter_s": 0.0,
    "greatest": 2.0,
}
USUAL = {**GAINS, "period": PERIOD, "share": 1.0, "held": False}
EMPTY = AxisMemory(integral=0.0, rate=0.0)


def test_the_correction_is_the_sum_of_three_parts():
    correction, memory = axis_step(3.0, -0.4, EMPTY, **USUAL)
    # 0.1 * 3 + 0.02 * 3 * 0.05 - 0.5 * 0.4
    assert correction == pytest.approx(0.103)
    assert memory.integral == pytest.approx(0.003)


def test_the_rate_is_low_passed():
    slow = USUAL | {"proportional": 0.0, "integral": 0.0, "derivative": 1.0, "filter_s": 0.15}
    correction, memory = axis_step(0.0, 1.0, EMPTY, **slow)
    # Backward Euler: 0.05 / (0.15 + 0.05).
    assert correction == memory.rate == pytest.approx(0.25)


def test_an_integral_stands_still_while_its_correction_is_at_the_limit():
    memory = EMPTY
    for _ in range(100):
        correction, memory = axis_step(80.0, 0.0, memory, **USUAL)
        assert correction == 2.0
    assert memory.integral == 0.0


def test_far_from_its_slot_a_follower_learns_nothing_for_its_integrals():
    slot = Slot(forward=-20.0, right=0.0)

    def learned_at(east: float) -> float:
        """What the second step asks for more than the first, rad of course."""
        gains = {"lateral_p_rad_m": 0.01, "lateral_i_rad_m_s": 0.02, "lateral_d_rad_s_m": 0.0}
        gentle = keeper("pid", choices(), slot, Airframe(), **gains)
        state = vehicle_at(north=-20.0, east=east, course=0.0)
        errors = [gentle.step(state, leader_at(), period=PERIOD).course_error for _ in range(2)]
        return float(errors[0] - errors[1])

    # Half of it 2 m away, 1 / (1 + 5^4) of it 10 m away.
    assert learned_at(-2.0) == pytest.approx(0.02 * 2.0 * 0.05 / 2.0)
    assert learned_at(-10.0) == pytest.approx(0.02 * 10.0 * 0.05 / 626.0)


def test_an_integral_at_the_limit_still_shrinks():
    wound_up = AxisMemory(integral=2.0, rate=0.0)
    _, memory = axis_step(-1.0, 0.0, wound_up, **USUAL)
    assert memory.integral == pytest.approx(2.0 - 0.02 * 0.05)


def test_an_integral_stands_still_while_the_vehicle_is_at_a_limit():
    _, memory = axis_step(3.0, 0.0, EMPTY, **USUAL | {"held": True})
    assert memory.integral == 0.0


def test_on_a_turning_slot_it_asks_for_the_slots_own_motion():
    leading, slot = leader_at(turn_rate=0.1), Slot(forward=-40.0, right=0.0)
    motion = slot_motion(leading, slot)
    state = vehicle_at(
        north=motion.north, east=motion.east, course=motion.course, ground_speed=motion.speed
    )
    guidance = follower_step(state, leading, slot, choices(), Airframe(), period=PERIOD, law="pid")
    assert guidance.setpoint.course == pytest.approx(motion.course + 0.1 * (1.0 / 1.2 + 0.025))
    assert guidance.setpoint.speed == pytest.approx(motion.speed)


def test_a_controller_that_is_reset_has_learnt_nothing():
    slot, state = Slot(forward=-20.0, right=0.0), vehicle_at(north=-20.5, east=0.1)
    gentle = {"lateral_p_rad_m": 0.01, "longitudinal_p_1_s": 0.01}
    controller = keeper("pid", choices(), slot, Airframe(), **gentle)
    first = controller.step(state, leader_at(), period=PERIOD).setpoint
    later = controller.step(state, leader_at(), period=PERIOD).setpoint
    assert later.course < first.course
    controller.reset()
    assert controller.step(state, leader_at(), period=PERIOD).setpoint == first
