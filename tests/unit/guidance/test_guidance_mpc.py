"""The predictive baseline: its programme against the regulator, its bounds, its robustness."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.following import keeper
from tests.kit.states import choices, leader_at, vehicle_at
from vfguide.guidance.airframe import GRAVITY
from vfguide.guidance.formation import Slot, slot_motion
from vfguide.laws.keeper import SlotKeeper
from vfguide.laws.mpc import MpcGains, Programme, predicted_slot, regulator
from vfguide.state import Airframe, Setpoint, VehicleState

PERIOD = 0.05
CHOSEN: dict[str, Any] = {
    "horizon_s": 3.0,
    "intervals": 20,
    "velocity_weight_s2": 1.0,
    "acceleration_weight_s4": 0.1,
    "integral_s": 0.0,
}
WEIGHTS = MpcGains(**CHOSEN)
SLOT = Slot(forward=-40.0, right=10.0)


def controller_of(**gains: float) -> SlotKeeper:
    return keeper("mpc", choices(), SLOT, Airframe(), **(CHOSEN | gains))


def asked(controller: SlotKeeper, state: VehicleState, **leader: float) -> Setpoint:
    """What a step asks for behind a leader."""
    return controller.step(state, leader_at(**leader), period=PERIOD).setpoint


def unbounded(count: int) -> tuple[np.ndarray, np.ndarray]:
    far = np.full(4 * count, 1e6)
    return -far, far


@pytest.mark.parametrize(
    ("error", "velocity"), [(1.0 + 0.0j, 0.0j), (0.0j, 2.0 - 1.0j), (-3.0 + 5.0j, 1.0 + 1.0j)]
)
def test_without_bounds_it_is_the_linear_quadratic_regulator(error, velocity):
    programme = Programme(WEIGHTS, beta=0.8)
    _, gain = regulator(
        programme.interval, WEIGHTS.velocity_weight_s2, WEIGHTS.acceleration_weight_s4
    )
    straight = np.zeros(WEIGHTS.intervals + 1)
    found = programme.solve(error, velocity, straight, unbounded(WEIGHTS.intervals))
    wanted = -(gain[0] * error + gain[1] * velocity)
    assert found == pytest.approx(wanted, abs=2e-3)


def test_a_slot_ahead_is_answered_by_going_faster():
    _, gain = regulator(0.15, 1.0, 0.1)
    # a = -gain (p, v): p counts the slot's distance ahead, v the excess over its speed.
    assert gain[0] < 0.0 < gain[1]


def test_the_slot_is_predicted_along_the_leaders_arc():
    horizon = predicted_slot(
        leader_at(turn_rate=0.1, acceleration=0.5),
        Slot(forward=-20.0, right=0.0),
        interval=0.5,
        count=4,
    )
    # Speed in the middle of the third interval: hypot(20 + 0.5 * 1.25, 0.1 * 20).
    assert horizon.speed[2] == pytest.approx(math.hypot(20.625, 2.0))
    assert horizon.turned[0] == 0.0
    assert horizon.turned[4] == pytest.approx(0.2, abs=0.01)


def test_on_a_turning_slot_it_asks_for_the_slots_own_motion():
    motion = slot_motion(leader_at(turn_rate=0.1), SLOT)
    state = vehicle_at(motion.north, motion.east, motion.course, motion.speed)
    setpoint = asked(controller_of(), state, turn_rate=0.1)
    lead = motion.turn_rate * (1.0 / 1.2 + 0.025)
    assert setpoint.course == pytest.approx(motion.course + lead, abs=1e-4)
    assert setpoint.speed == pytest.approx(motion.speed, abs=1e-3)


def test_a_distant_slot_is_flown_to_within_bank_and_airspeed():
    airframe, controller = Airframe(), controller_of()
    fastest = GRAVITY * math.tan(airframe.max_bank) / 20.0
    steepest = fastest * (1.0 / airframe.alpha + PERIOD / 2.0)
    for east in (-300.0, 300.0):
        setpoint = asked(controller, vehicle_at(north=-200.0, east=east))
        assert abs(setpoint.course) <= steepest + 1e-6
        assert airframe.airspeed_min <= setpoint.speed <= airframe.airspeed_max


def test_a_vehicle_outside_its_bounds_is_led_back_in():
    controller = controller_of()
    too_fast = vehicle_at(north=-40.0, east=10.0, ground_speed=40.0)
    assert asked(controller, too_fast).speed < 40.0
    backwards = vehicle_at(north=-40.0, east=10.0, course=3.0)
    assert abs(asked(controller, backwards).course - 3.0) > 0.1


def test_with_an_integral_it_asks_for_more_the_longer_it_is_off_its_slot():
    behind = vehicle_at(north=-40.5, east=10.0)

    def speeds_of(controller: SlotKeeper) -> list[float]:
        speeds = [asked(controller, behind).speed for _ in range(5)]
        controller.reset()
        assert asked(controller, behind).speed == pytest.approx(speeds[0], abs=1e-3)
        return speeds

    alone, learning = speeds_of(controller_of()), speeds_of(controller_of(integral_s=1.0))
    assert alone == pytest.approx([alone[0]] * 5, abs=1e-3)
    # Each step moves the target by 0.5 m * 0.05 s / 1 s, less 1 / 256 for the nearness.
    _, gain = regulator(
        WEIGHTS.horizon_s / WEIGHTS.intervals,
        WEIGHTS.velocity_weight_s2,
        WEIGHTS.acceleration_weight_s4,
    )
    share = -gain[0] * (1.0 / 0.8 + PERIOD / 2.0)
    wanted = [learning[0] + share * step * 0.025 * (256.0 / 257.0) for step in range(5)]
    assert learning == pytest.approx(wanted, abs=5e-3)


def test_the_same_states_give_the_same_setpoints():
    def flown() -> list[float]:
        controller = controller_of()
        states = [vehicle_at(north=-40.0 + 0.3 * step, east=8.0) for step in range(20)]
        return [asked(controller, state).speed for state in states]

    assert flown() == flown()


@settings(deadline=None, derandomize=True, database=None, max_examples=60)
@given(
    north=st.floats(-1e4, 1e4),
    east=st.floats(-1e4, 1e4),
    course=st.floats(-4.0, 4.0),
    speed=st.floats(1.0, 60.0),
    turn_rate=st.floats(-1.0, 1.0),
    wind=st.floats(-30.0, 30.0),
)
def test_wherever_a_follower_is_its_guidance_is_finite(north, east, course, speed, turn_rate, wind):
    state = vehicle_at(north=north, east=east, course=course, ground_speed=speed, wind=(wind, 0.0))
    # Nobody who stands still in the air is guided: a companion takes its airspeed for 1 m/s at least.
    state = replace(state, airspeed=max(state.airspeed, 1.0))
    setpoint = asked(controller_of(), state, turn_rate=turn_rate)
    assert math.isfinite(setpoint.course)
    assert math.isfinite(setpoint.speed)
