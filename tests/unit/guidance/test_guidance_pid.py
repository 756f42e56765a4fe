"""The PID baseline: what it answers to an error, and when its integrals stand still."""

from collections.abc import Callable

import numpy as np
import pytest

from vfguide.guidance.controller import FieldController, PidController, formation_controller
from vfguide.guidance.formation import Slot, formation_error, slot_motion
from vfguide.guidance.pid import AxisMemory, axis_step, first_memory, pid_step
from vfguide.guidance.settings import AxisGains, GuidanceSettings, PidGains
from vfguide.state import Airframe, LeaderState, VehicleState

Leader = Callable[..., LeaderState[float]]
Vehicle = Callable[..., VehicleState[float]]
Choices = Callable[..., GuidanceSettings]

PERIOD = 0.05
GAINS = AxisGains(
    proportional=0.1, integral=0.02, derivative=0.5, derivative_filter_s=0.0, greatest=2.0
)
BOTH = PidGains(lateral=GAINS, longitudinal=GAINS)
GENTLE = AxisGains(
    proportional=0.01, integral=0.02, derivative=0.0, derivative_filter_s=0.0, greatest=2.0
)
EMPTY = AxisMemory(integral=0.0, rate=0.0)


def test_the_correction_is_the_sum_of_three_parts() -> None:
    correction, memory = axis_step(3.0, -0.4, EMPTY, GAINS, period=PERIOD, share=1.0, held=False)
    # 0.1 * 3 + 0.02 * 3 * 0.05 - 0.5 * 0.4
    assert correction == pytest.approx(0.103)
    assert memory.integral == pytest.approx(0.003)


def test_the_rate_is_low_passed() -> None:
    slow = AxisGains(
        proportional=0.0, integral=0.0, derivative=1.0, derivative_filter_s=0.15, greatest=2.0
    )
    correction, memory = axis_step(0.0, 1.0, EMPTY, slow, period=PERIOD, share=1.0, held=False)
    # Backward Euler: 0.05 / (0.15 + 0.05).
    assert correction == memory.rate == pytest.approx(0.25)


def test_an_integral_stands_still_while_its_correction_is_at_the_limit() -> None:
    memory = EMPTY
    for _ in range(100):
        correction, memory = axis_step(
            80.0, 0.0, memory, GAINS, period=PERIOD, share=1.0, held=False
        )
        assert correction == 2.0
    assert memory.integral == 0.0


def test_far_from_its_slot_a_follower_learns_nothing_for_its_integrals(
    leader: Leader, vehicle: Vehicle
) -> None:
    leading, slot = leader(), Slot(forward=-20.0, right=0.0)
    motion = slot_motion(leading, slot)

    def learned_at(east: float) -> float:
        state = vehicle(north=-20.0, east=east, course=0.0, ground_speed=motion.speed)
        error = formation_error(motion, state)
        _, memory = pid_step(
            state,
            motion,
            error,
            first_memory(error),
            gains=PidGains(lateral=GENTLE, longitudinal=GENTLE),
            airframe=Airframe(),
            period=PERIOD,
            wind_feedforward=True,
            rho=50.0,
        )
        return float(memory.lateral.integral)

    # Half of it 2 m away, 1 / (1 + 5^4) of it 10 m away.
    assert learned_at(-2.0) == pytest.approx(0.02 * 2.0 * 0.05 / 2.0)
    assert learned_at(-10.0) == pytest.approx(0.02 * 10.0 * 0.05 / 626.0)


def test_an_integral_at_the_limit_still_shrinks() -> None:
    wound_up = AxisMemory(integral=2.0, rate=0.0)
    _, memory = axis_step(-1.0, 0.0, wound_up, GAINS, period=PERIOD, share=1.0, held=False)
    assert memory.integral == pytest.approx(2.0 - 0.02 * 0.05)


def test_an_integral_stands_still_while_the_vehicle_is_at_a_limit() -> None:
    _, memory = axis_step(3.0, 0.0, EMPTY, GAINS, period=PERIOD, share=1.0, held=True)
    assert memory.integral == 0.0


def test_on_a_turning_slot_it_asks_for_the_slots_own_motion(
    leader: Leader, vehicle: Vehicle
) -> None:
    leading, slot = leader(turn_rate=0.1), Slot(forward=-40.0, right=0.0)
    motion = slot_motion(leading, slot)
    state = vehicle(
        north=motion.north, east=motion.east, course=motion.course, ground_speed=motion.speed
    )
    error = formation_error(motion, state)
    guidance, _ = pid_step(
        state,
        motion,
        error,
        first_memory(error),
        gains=BOTH,
        airframe=Airframe(),
        period=PERIOD,
        wind_feedforward=True,
        rho=50.0,
    )
    assert guidance.setpoint.course == pytest.approx(motion.course + 0.1 * (1.0 / 1.2 + 0.025))
    assert guidance.setpoint.speed == pytest.approx(motion.speed)


def test_on_arrays_it_is_what_it_is_on_floats() -> None:
    errors = np.array([-30.0, -0.5, 0.0, 2.0, 100.0])
    rates = np.array([1.0, -0.2, 0.0, 3.0, -20.0])
    memory = AxisMemory(integral=np.array([0.1, 0.0, -0.2, 2.0, 0.3]), rate=rates * 0.5)
    columns = np.ones(5)
    gains = AxisGains(
        proportional=0.1 * columns,
        integral=0.02 * columns,
        derivative=0.5 * columns,
        derivative_filter_s=0.2,
        greatest=2.0 * columns,
    )
    held = np.array([False, True, False, True, False])
    many, remembered = axis_step(
        errors, rates, memory, gains, period=PERIOD, share=columns, held=held
    )
    for index in range(5):
        one, kept = axis_step(
            float(errors[index]),
            float(rates[index]),
            AxisMemory(integral=float(memory.integral[index]), rate=float(memory.rate[index])),
            AxisGains(
                proportional=0.1,
                integral=0.02,
                derivative=0.5,
                derivative_filter_s=0.2,
                greatest=2.0,
            ),
            period=PERIOD,
            share=1.0,
            held=bool(held[index]),
        )
        assert many[index] == pytest.approx(one, abs=1e-15)
        assert remembered.integral[index] == pytest.approx(kept.integral, abs=1e-15)


def test_a_controller_that_is_reset_has_learnt_nothing(
    leader: Leader, vehicle: Vehicle, choices: Choices
) -> None:
    slot, state = Slot(forward=-20.0, right=0.0), vehicle(north=-25.0, east=1.0)
    controller = PidController(choices(), slot, Airframe(), BOTH)
    first = controller.step(state, leader(), period=PERIOD).setpoint
    later = controller.step(state, leader(), period=PERIOD).setpoint
    assert later.course < first.course
    controller.reset()
    assert controller.step(state, leader(), period=PERIOD).setpoint == first


def test_a_law_without_gains_is_refused(choices: Choices) -> None:
    slot = Slot(forward=-20.0, right=0.0)
    assert isinstance(formation_controller(choices(), slot, Airframe()), FieldController)
    with pytest.raises(ValueError, match="pid has no gains"):
        formation_controller(choices(law="pid"), slot, Airframe())
