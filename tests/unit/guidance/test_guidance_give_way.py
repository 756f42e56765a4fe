"""The leader gives way to followers that could not hold their slots."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vfguide.guidance.formation import Slot, SlotLimits, airspeed_that_gives_way, slot_airspeed
from vfguide.state import Airframe, VehicleState

REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=300)
Vehicles = Callable[..., VehicleState[float]]
AIRFRAME = Airframe()
CRUISE = 20.0


def slot(forward: float, right: float) -> SlotLimits:
    return SlotLimits(slot=Slot(forward=forward, right=right), airspeed_min=12.0, airspeed_max=32.0)


INSIDE = slot(0.0, 90.0)
"""At 0.1 rad/s to the right and 20 m/s: 20 - 9 = 11 m/s."""
OUTSIDE = slot(0.0, -120.0)
"""20 + 12 = 32 m/s."""


def test_a_slot_needs_the_airspeed_of_its_own_velocity(vehicle: Vehicles) -> None:
    # 40 m behind at 0.1 rad/s: hypot(20, 4); in a wind of 5 m/s from behind: hypot(15, 4)
    behind = Slot(forward=-40.0, right=0.0)
    assert slot_airspeed(vehicle(), 0.1, behind) == pytest.approx(math.hypot(20.0, 4.0))
    windy = vehicle(wind=(5.0, 0.0))
    assert slot_airspeed(windy, 0.1, behind) == pytest.approx(math.hypot(15.0, 4.0))


def test_the_slots_velocity_turns_with_the_leader(vehicle: Vehicles) -> None:
    # flying east the slot slips to the left of east, north: (4, 20), less the wind (4, 5): 15
    windy = vehicle(course=math.pi / 2.0, wind=(4.0, 5.0))
    needed = slot_airspeed(windy, 0.1, Slot(forward=-40.0, right=0.0))
    assert needed == pytest.approx(15.0)


@pytest.mark.parametrize(
    ("followers", "airspeed"),
    [
        ([], 20.0),
        ([slot(0.0, 60.0)], 20.0),  # 14 m/s are enough
        ([slot(0.0, 75.0)], 20.5),  # 12.5 m/s are less than 12 and the margin of 1
        ([INSIDE], 22.0),  # 11 m/s are 2 short
        ([OUTSIDE], 19.0),  # 32 m/s are 1 more than 32 less the margin
        ([INSIDE, OUTSIDE], 21.0),  # 20 + 2 - 1
        ([INSIDE, slot(0.0, 100.0)], 23.0),  # 10 m/s: the worst one counts
        ([slot(0.0, 500.0)], 20.0),  # |20 - 50| = 30 m/s are within the range
    ],
)
def test_the_leader_adds_what_the_worst_slot_lacks(
    vehicle: Vehicles, followers: list[SlotLimits], airspeed: float
) -> None:
    found = airspeed_that_gives_way(CRUISE, vehicle(), 0.1, followers, AIRFRAME)
    assert found == pytest.approx(airspeed)


def test_having_given_way_it_keeps_doing_so(vehicle: Vehicles) -> None:
    # at 22 m/s the slot needs 13, at cruise it would need 11 still: no hunting between the two
    flying = vehicle(ground_speed=22.0)
    assert airspeed_that_gives_way(CRUISE, flying, 0.1, [INSIDE], AIRFRAME) == pytest.approx(22.0)


def test_it_gives_way_no_further_than_it_can_fly_itself(vehicle: Vehicles) -> None:
    narrow = Airframe(airspeed_min=19.5, airspeed_max=21.0)
    assert airspeed_that_gives_way(CRUISE, vehicle(), 0.1, [INSIDE], narrow) == 21.0
    assert airspeed_that_gives_way(CRUISE, vehicle(), 0.1, [OUTSIDE], narrow) == 19.5


@REPEATABLE
@given(
    course=st.floats(-math.pi, math.pi),
    speed=st.floats(1.0, 80.0),
    wind=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    turn_rate=st.floats(-2.0, 2.0),
    offsets=st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), max_size=5),
)
def test_conflicting_demands_stay_finite_and_within_the_leaders_range(
    vehicle: Vehicles,
    *,
    course: float,
    speed: float,
    wind: tuple[float, float],
    turn_rate: float,
    offsets: list[tuple[float, float]],
) -> None:
    state = vehicle(course=course, ground_speed=speed, wind=wind)
    followers = [slot(*offset) for offset in offsets]
    found = airspeed_that_gives_way(CRUISE, state, turn_rate, followers, AIRFRAME)
    assert AIRFRAME.airspeed_min <= found <= AIRFRAME.airspeed_max
    assert followers or found == CRUISE
