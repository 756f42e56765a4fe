import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from vfguide.guidance.separation import CLOSING_RATE, LEAST_DISTANCE, Obstacle, separated_velocity

HERE = (0.0, 0.0)


def obstacle(
    north: float, east: float, velocity: tuple[float, float] = (0.0, 0.0), keep: float = 10.0
) -> Obstacle[float]:
    return Obstacle(
        north=north,
        east=east,
        velocity_north=velocity[0],
        velocity_east=velocity[1],
        keep=keep,
    )


def test_with_nobody_there_every_wish_is_granted() -> None:
    assert separated_velocity(HERE, (20.0, 3.0), []) == (20.0, 3.0, False)


def test_a_formation_that_flies_as_one_is_left_alone() -> None:
    others = [obstacle(15.0, 0.0, (20.0, 3.0)), obstacle(0.0, -10.5, (20.0, 3.0))]
    assert separated_velocity(HERE, (20.0, 3.0), others) == (20.0, 3.0, False)


def test_slots_of_a_turning_formation_do_not_close_in_on_each_other() -> None:
    # Turning right by 0.1 rad/s about a point 200 m east; the other, 15 m inside, is slower by 1.5 m/s.
    assert separated_velocity(HERE, (20.0, 0.0), [obstacle(0.0, 15.0, (18.5, 0.0))]) == (
        20.0,
        0.0,
        False,
    )


def test_what_is_wanted_through_somebody_goes_round_on_the_right() -> None:
    # 20 m ahead, 10 to be kept: 0.4 * 10 = 4 of the 9 m/s remain, the other 5 turn to the right.
    north, east, avoiding = separated_velocity(HERE, (9.0, 0.0), [obstacle(20.0, 0.0)])
    assert (north, east) == (pytest.approx(4.0), pytest.approx(5.0))
    assert avoiding


def test_two_that_meet_head_on_both_turn_right() -> None:
    speed = 5.0
    north, east, _ = separated_velocity(HERE, (speed, 0.0), [obstacle(20.0, 0.0, (-speed, 0.0))])
    back, aside, _ = separated_velocity(
        (20.0, 0.0), (-speed, 0.0), [obstacle(0.0, 0.0, (speed, 0.0))]
    )
    assert east > 1.0
    assert aside == pytest.approx(-east)
    assert back == pytest.approx(-north)


def test_whoever_is_faster_passes_in_front_of_one_that_cuts_in_from_the_right() -> None:
    # It is 12 m right of us, keeps its course and flies 5 m/s slower; we want to turn toward it by 6 m/s. Of
    # those 0.4 * 2 = 0.8 remain, and the other 5.2 turn to the left of the way toward it, which is ahead.
    slower = obstacle(0.0, 12.0, (15.0, 0.0))
    north, east, avoiding = separated_velocity(HERE, (20.0, 6.0), [slower])
    assert (north, east) == (pytest.approx(25.2), pytest.approx(0.8))
    assert avoiding


def test_whoever_is_too_near_backs_off_and_does_not_go_round() -> None:
    # 5 m ahead, 10 to be kept: 0.4 * 5 = 2 m/s away from it.
    north, east, avoiding = separated_velocity(HERE, (0.0, 0.0), [obstacle(5.0, 0.0)])
    assert (north, east) == (pytest.approx(-2.0), pytest.approx(0.0))
    assert avoiding


def test_whoever_comes_from_the_right_is_let_pass_in_front() -> None:
    # 15 m right of us and coming at 6 m/s: 0.4 * 5 = 2 m/s of closing are all right. The other 4 are made
    # good by moving away, and turned to the right of the way toward it, which is back.
    north, east, _ = separated_velocity(HERE, (20.0, 0.0), [obstacle(0.0, 15.0, (20.0, -6.0))])
    assert (north, east) == (pytest.approx(16.0), pytest.approx(-4.0))


def test_two_in_the_same_place_get_a_number_to_fly_by() -> None:
    velocity = separated_velocity(HERE, (0.0, 0.0), [obstacle(0.0, 0.0)])
    assert all(math.isfinite(part) for part in velocity)


@given(
    north=st.floats(-100.0, 100.0),
    east=st.floats(-100.0, 100.0),
    wanted=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    velocity=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
)
def test_nobody_is_approached_faster_than_the_barrier_allows(
    north: float, east: float, wanted: tuple[float, float], velocity: tuple[float, float]
) -> None:
    one = obstacle(north, east, velocity)
    distance = math.hypot(north, east)
    assume(distance > LEAST_DISTANCE)
    along, across, _ = separated_velocity(HERE, wanted, [one])
    closing = ((along - velocity[0]) * north + (across - velocity[1]) * east) / distance
    assert closing <= CLOSING_RATE * (distance - one.keep) + 1e-9


def test_arrays_are_separated_like_floats() -> None:
    wishes = [(9.0, 0.0), (0.0, 0.0), (-3.0, 2.0)]
    others = [obstacle(20.0, 0.0), obstacle(0.0, -12.0, (1.0, 1.0))]
    alone = np.array([separated_velocity(HERE, wish, others) for wish in wishes])
    still = np.zeros(3)
    together = separated_velocity(
        (still, still),
        (np.array([wish[0] for wish in wishes]), np.array([wish[1] for wish in wishes])),
        [
            Obstacle(
                north=still + one.north,
                east=still + one.east,
                velocity_north=still + one.velocity_north,
                velocity_east=still + one.velocity_east,
                keep=still + one.keep,
            )
            for one in others
        ],
    )
    assert pytest.approx(alone) == np.array(together).T
