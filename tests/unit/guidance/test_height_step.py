"""Which height a vehicle goes to beside others: hand-computed distances in space."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vfguide.guidance.height import ENOUGH, Neighbour, best_step, clearance, deepest

UP, DOWN = 20.0, -20.0
STEPS = (0.0, UP, DOWN)


def beside(distance: float, up: float, *, over: bool | None = None, soon: float = 0.0) -> Neighbour:
    """A vehicle some metres away in the plane and higher than the slot, that climbs by some metres soon."""
    return Neighbour(
        distance=distance,
        least=7.0,
        least_up=7.0,
        lowest=up + min(soon, 0.0),
        highest=up + max(soon, 0.0),
        over=(up < 0.0 if up else None) if over is None else over,
    )


def test_a_distance_in_space_counts_in_least_distances() -> None:
    # 4.2 m aside and 5.6 m below: 7 m.
    assert clearance(0.0, [beside(4.2, -5.6)]) == pytest.approx(1.0)
    assert clearance(0.0, [beside(4.2, -5.6), beside(3.5, 0.0)]) == pytest.approx(0.5)
    assert clearance(0.0, []) == ENOUGH


def test_beside_one_alone_either_way_is_open_and_the_first_is_taken() -> None:
    assert best_step(0.0, (0.0, UP, DOWN), [beside(3.0, 0.0)]) == UP
    assert best_step(0.0, (0.0, DOWN, UP), [beside(3.0, 0.0)]) == DOWN


def test_nobody_steps_into_or_through_the_layer_of_another() -> None:
    # 12 m above, and 9 m aside: 20 m would lead through that height, and end 8 m over it.
    assert best_step(0.0, STEPS, [beside(3.0, 0.0), beside(9.0, 12.0)]) == DOWN
    # 24 m above: 4 m under it.
    assert best_step(0.0, STEPS, [beside(3.0, 0.0), beside(6.0, 24.0)]) == DOWN


def test_with_others_near_above_and_below_no_height_is_better() -> None:
    layers = [beside(3.0, 0.0), beside(3.0, 12.0), beside(3.0, -12.0)]
    assert best_step(0.0, STEPS, layers) == 0.0


def test_who_is_far_away_in_the_plane_closes_no_height() -> None:
    assert best_step(0.0, STEPS, [beside(3.0, 0.0), beside(15.0, 12.0)]) == UP


def test_one_that_is_climbing_counts_where_it_will_be() -> None:
    # f3 is level now, 5 m aside, and 9 m higher in 3 s: it is the lower one's business to go down.
    climbing = beside(5.0, 4.0, soon=9.0)
    assert best_step(0.0, STEPS, [beside(3.0, 0.0), climbing]) == DOWN
    assert clearance(UP, [beside(5.0, -2.0, soon=12.0)]) == pytest.approx(math.hypot(5, 10) / 7)


def test_of_two_that_are_as_high_one_goes_over_the_other_and_never_both() -> None:
    first = best_step(0.0, STEPS, [beside(3.0, 0.0, over=True)])
    second = best_step(0.0, STEPS, [beside(3.0, 0.0, over=False)])
    assert (first, second) == (UP, DOWN)
    # The way over is closed to the first: it stays, and does not follow the other one down.
    closed = [beside(3.0, 0.0, over=True), beside(3.0, 12.0)]
    assert best_step(0.0, STEPS, closed) == 0.0


def test_a_step_is_kept_until_another_is_clearly_better() -> None:
    # 7 m and 8 m from somebody: 1.0 and 1.14 least distances.
    near = [beside(0.0, 27.0), beside(0.0, -28.0)]
    assert best_step(UP, (UP, DOWN), near) == UP
    # 4 m: 0.57 against 1.14.
    worse = [beside(0.0, 24.0), beside(0.0, -28.0)]
    assert best_step(UP, (UP, DOWN), worse) == DOWN


@pytest.mark.parametrize(("height_m", "deepest_m"), [(100.0, 20.0), (40.0, 10.0), (-3.0, 0.0)])
def test_no_vehicle_descends_by_more_than_a_quarter_of_its_height(
    height_m: float, deepest_m: float
) -> None:
    assert deepest(height_m) == pytest.approx(deepest_m)


NEIGHBOURS = st.lists(
    st.builds(
        beside,
        st.floats(0.0, 100.0),
        st.floats(-60.0, 60.0),
        over=st.none() | st.booleans(),
        soon=st.floats(-15.0, 15.0),
    ),
    max_size=6,
)


@given(NEIGHBOURS, st.sampled_from(STEPS))
def test_no_step_leaves_less_than_staying_does(neighbours: list[Neighbour], present: float) -> None:
    found = best_step(present, STEPS, neighbours)
    assert found == present or clearance(found, neighbours) > clearance(present, neighbours)
