"""The slot's field learns what keeps pushing a follower off its slot, and nothing else."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.unit.guidance.following import follower_step, keeper
from vfguide.guidance.formation import FormationError, Slot
from vfguide.guidance.settings import GuidanceSettings
from vfguide.guidance.slot_integral import (
    GREATEST_M,
    Offset,
    aimed_error,
    learned,
    nearness,
    no_offset,
)
from vfguide.state import Airframe, LeaderState, VehicleState

PERIOD = 0.05
COURSE_HOLD = Airframe(hold="course-hold")
BEHIND = Slot(forward=-20.0, right=0.0)
LEARNS = 1.5
"""s, of the integral."""
Choices = Callable[..., GuidanceSettings]
Leaders = Callable[..., LeaderState[float]]
Vehicles = Callable[..., VehicleState[float]]


def off(along: float, cross: float) -> FormationError[float]:
    return FormationError(
        along_track=along, cross_track=cross, along_track_rate=0.3, cross_track_rate=-0.2
    )


def test_a_field_that_aims_beyond_its_slot_sees_the_sum_of_error_and_offset() -> None:
    # at 5 cm all of the error is learned from: 0.03/1.5 and 0.04/1.5 m/s
    aimed = aimed_error(off(0.03, 0.04), Offset(ahead=0.5, right=-0.25), LEARNS)
    assert aimed.along_track == pytest.approx(0.53)
    assert aimed.cross_track == pytest.approx(-0.21)
    assert aimed.along_track_rate == pytest.approx(0.3 + 0.02, abs=1e-6)
    assert aimed.cross_track_rate == pytest.approx(-0.2 + 0.04 / 1.5, abs=1e-6)


@pytest.mark.parametrize(
    ("along", "cross", "share"), [(0.0, 0.0, 1.0), (1.2, 1.6, 0.5), (-4.0, 0.0, 1.0 / 17.0)]
)
def test_nearness_is_one_in_the_slot_a_half_at_two_metres_and_little_far_away(
    along: float, cross: float, share: float
) -> None:
    assert nearness(off(along, cross)) == pytest.approx(share)


def test_the_offset_grows_by_the_error_over_the_time_and_stops_at_its_bound() -> None:
    after = learned(no_offset(0.0), off(0.03, -0.03), LEARNS, period=0.5, held=False)
    assert (after.ahead, after.right) == pytest.approx((0.01, -0.01), abs=1e-6)
    full = Offset(ahead=GREATEST_M, right=-GREATEST_M)
    assert learned(full, off(1.0, -1.0), LEARNS, period=0.5, held=False) == full


def test_nothing_is_learned_at_a_limit_or_without_a_time_to_learn_in() -> None:
    before = Offset(ahead=0.2, right=0.1)
    assert learned(before, off(0.5, 0.5), LEARNS, period=0.5, held=True) == before
    never = 0.0
    assert learned(before, off(0.5, 0.5), never, period=0.5, held=False) == before
    assert aimed_error(off(0.5, 0.5), no_offset(0.0), never) == off(0.5, 0.5)


def test_offsets_of_a_batch_are_those_of_each_alone() -> None:
    along, cross = np.array([0.1, 3.0, -0.4]), np.array([-0.2, 0.5, 9.0])
    many = learned(
        no_offset(along),
        FormationError(
            along_track=along, cross_track=cross, along_track_rate=along, cross_track_rate=cross
        ),
        LEARNS,
        period=PERIOD,
        held=np.array([False, False, True]),
    )
    for index in range(3):
        error = off(float(along[index]), float(cross[index]))
        one = learned(no_offset(0.0), error, LEARNS, period=PERIOD, held=index == 2)
        assert (many.ahead[index], many.right[index]) == pytest.approx((one.ahead, one.right))


def error_with_biased_holds(
    settings: GuidanceSettings,
    leader: Leaders,
    vehicle: Vehicles,
    plant: Callable[..., Any],
    **gains: float,
) -> tuple[float, float]:
    """(along, across) error after a minute with holds that are 0.05 rad and 0.5 m/s off."""
    flyer = plant(north=-20.0)
    controller = keeper("slot", settings, BEHIND, COURSE_HOLD, **gains)
    for step in range(1200):
        state = vehicle(flyer.north, flyer.east, flyer.course, flyer.speed, time_s=step * PERIOD)
        ahead = leader(time_s=step * PERIOD, north=20.0 * step * PERIOD)
        guidance = controller.step(state, ahead, period=PERIOD)
        flyer.fly(guidance.setpoint.course + 0.05, guidance.setpoint.speed - 0.5, PERIOD)
    return guidance.error.along_track, guidance.error.cross_track


def test_without_an_integral_biased_holds_leave_a_lasting_error(
    leader: Leaders, vehicle: Vehicles, choices: Choices, plant: Callable[..., Any]
) -> None:
    # 0.05 rad . 1.2 1/s = 0.06 rad/s: chi~ = 0.06 . 0.525/3 = 0.0105 rad, y_E = -tan(2 chi~)/0.2 = -0.105 m;
    # 0.5 m/s . 0.8 1/s = 0.4 m/s², less x_E/50: V~ = 0.07 m/s, x_E = tan(pi/16 . 0.07)/0.2 = 0.0687 m;
    # and 3 % more for the lead of half a period that the holds do not have
    along, across = error_with_biased_holds(choices(), leader, vehicle, plant)
    assert along == pytest.approx(0.0687, rel=0.05)
    assert across == pytest.approx(-0.105, rel=0.05)


def test_with_an_integral_biased_holds_leave_no_error(
    leader: Leaders, vehicle: Vehicles, choices: Choices, plant: Callable[..., Any]
) -> None:
    along, across = error_with_biased_holds(choices(), leader, vehicle, plant, integral_s=LEARNS)
    assert abs(along) < 1e-4
    assert abs(across) < 1e-4


def test_a_follower_that_flies_something_else_learns_nothing(
    leader: Leaders, vehicle: Vehicles, choices: Choices
) -> None:
    state = vehicle(-20.05, 0.05)

    def second_speed(*, held: bool) -> float:
        learns = keeper("slot", choices(), BEHIND, COURSE_HOLD, integral_s=LEARNS)
        learns.step(state, leader(), period=PERIOD, held=held)
        return float(learns.step(state, leader(), period=PERIOD).setpoint.speed)

    fresh = follower_step(
        state, leader(), BEHIND, choices(), COURSE_HOLD, period=PERIOD, integral_s=LEARNS
    )
    assert second_speed(held=True) == fresh.setpoint.speed
    assert second_speed(held=False) > fresh.setpoint.speed


def test_a_law_that_is_reset_is_as_on_its_first_step(
    leader: Leaders, vehicle: Vehicles, choices: Choices
) -> None:
    learns = keeper("slot", choices(), BEHIND, COURSE_HOLD, integral_s=LEARNS)
    state = vehicle(-20.4, 0.3)
    first = learns.step(state, leader(), period=PERIOD)
    for _ in range(20):
        later = learns.step(state, leader(), period=PERIOD)
    assert later.setpoint.speed > first.setpoint.speed
    learns.reset()
    assert learns.step(state, leader(), period=PERIOD) == first
