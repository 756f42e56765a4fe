"""Barriers of predicted manoeuvres: who is left alone, who turns, and which way."""

import cmath
import math

import numpy as np
import pytest
from msgspec.structs import replace

from vfguide.guidance.separation import (
    BEGINNINGS,
    FLOOR_M,
    TIMES,
    Agility,
    Clearance,
    ComplexArray,
    Manoeuvres,
    Others,
    OwnMotion,
    WantedMotion,
    arc,
    closest_approaches,
    keep_clear,
    own_tracks,
    passing,
)

AGILITY = Agility(
    turn_rate=0.5,
    acceleration=3.0,
    turn_delay=0.0,
    speed_delay=0.0,
    alpha=1.2,
    beta=0.8,
    speed_min=12.0,
    speed_max=30.0,
)
LATE = replace(AGILITY, turn_delay=1.0, speed_delay=1.0)
NORTH = 20.0 + 0.0j
"""m/s."""
HERE = OwnMotion(place=0j, air_velocity=NORTH, wind=0j, turn_rate=0.0)
STRAIGHT_ON = WantedMotion(velocity=NORTH, base_velocity=NORTH, turn_rate=0.0, settle_s=8.0)


def others(
    *tracks: ComplexArray, keep: float = 11.0, horizon_s: float = 8.0, passes: float = 0.0
) -> Others:
    count = len(tracks)
    return Others(
        tracks=np.array(tracks),
        horizon_s=np.full(count, horizon_s),
        keep=np.full(count, keep),
        floor=np.full(count, min(FLOOR_M, keep)),
        weight=np.ones(count),
        passes=np.full(count, passes),
        margin=np.zeros((count, len(BEGINNINGS))),
    )


def flying(place: complex, velocity: complex) -> ComplexArray:
    return arc(place, velocity, 0.0)


def cleared(found: Others, wanted: WantedMotion = STRAIGHT_ON) -> Clearance:
    return keep_clear(HERE, wanted, found, AGILITY)


HEAD_ON, ALONGSIDE = flying(120.0 + 0j, -NORTH), flying(14.0j, NORTH)


def test_an_arc_is_a_part_of_a_circle():
    # 20 m/s at 0.5 rad/s: a radius of 40 m, the centre to the right
    places = arc(0j, NORTH, 0.5)
    assert np.abs(places - 40.0j) == pytest.approx(np.full(len(TIMES), 40.0))


def test_alongside_and_beyond_a_horizon_nothing_is_changed():
    found = cleared(others(flying(12.0j, NORTH), flying(-30.0 + 0j, NORTH)))
    assert not found.changed
    assert found.nearest == pytest.approx([12.0, 30.0])
    assert not cleared(others(flying(100.0 + 0j, -NORTH), horizon_s=1.0)).changed


def test_a_turn_is_as_hard_as_the_bank_allows_and_begins_after_the_delay():
    right = Manoeuvres(turn=np.array([math.pi / 2.0]), airspeed=np.full(1, np.nan))
    (early,) = own_tracks(HERE, STRAIGHT_ON, right, AGILITY)
    (late,) = own_tracks(HERE, STRAIGHT_ON, right, LATE)
    # Half a circle of 40 m is not flown: it ends on the course that was asked for, and no sooner.
    assert early[2] == pytest.approx(arc(0j, NORTH, 0.5)[2], abs=0.3)
    assert late[2] == pytest.approx(20.0, abs=0.3)
    assert cmath.phase(early[-1] - early[-2]) == pytest.approx(math.pi / 2.0, abs=0.02)


def test_the_wind_carries_every_manoeuvre_along():
    drifting = replace(STRAIGHT_ON, velocity=20.0 + 5.0j, base_velocity=20.0 + 5.0j)
    straight = Manoeuvres(turn=np.zeros(1), airspeed=np.full(1, np.nan))
    (track,) = own_tracks(replace(HERE, wind=5.0j), drifting, straight, AGILITY)
    assert track[-1] == pytest.approx(160.0 + 40.0j)


def test_closest_approach_is_found_between_two_times():
    # Head on at 40 m/s, 10 m apart sideways: met at 1.25 s, between two places of the tracks.
    distance = closest_approaches(flying(0j, NORTH)[None], others(flying(50.0 + 10.0j, -NORTH)))
    assert distance.min() == pytest.approx(10.0)


def test_what_a_track_may_be_off_by_counts_as_nearer():
    # Side by side, 20 m apart, and off by 1 m/s from now on: 12.5 m in the last half second.
    alongside = others(flying(20.0j, NORTH))
    unsure = replace(alongside, margin=1.0 * BEGINNINGS[None, :])
    assert cleared(unsure).nearest == pytest.approx([20.0 - BEGINNINGS[-1]])
    assert not cleared(unsure).changed
    assert cleared(replace(alongside, margin=2.0 * BEGINNINGS[None, :])).changed


def test_one_in_the_way_is_passed_at_the_kept_distance():
    # 60 m ahead and 8 m/s slower it would be run into after 7.5 s.
    found = cleared(others(flying(60.0 + 0j, 12.0 + 0j)))
    assert found.changed
    assert found.wanted_nearest[0] == pytest.approx(0.0, abs=0.1)
    assert found.nearest[0] >= FLOOR_M


def test_two_that_meet_head_on_both_go_right():
    found = cleared(others(HEAD_ON))
    assert found.changed
    assert found.turn > 0.0
    assert found.nearest[0] >= 11.0


def test_the_least_change_that_is_clear_is_made():
    # To the left of the track, slower: a little to the right is enough.
    found = cleared(others(flying(60.0 - 6.0j, 12.0 + 0j)))
    assert 0.0 < found.turn <= math.radians(20.0)


def test_who_is_followed_on_one_side_is_not_pushed_into_the_other_nor_by_a_liar():
    # Head on somebody, somebody else 14 m to the right: the only way out is to the left.
    honest = cleared(others(HEAD_ON, ALONGSIDE))
    assert honest.turn < 0.0
    assert honest.nearest.min() >= FLOOR_M
    # Whoever claims to be here already changes no choice between the others.
    found = cleared(others(HEAD_ON, ALONGSIDE, flying(0.5 + 0j, NORTH)))
    assert found.nearest[:2].min() >= honest.nearest.min() - 3.0
    assert found.nearest[:2].min() >= 5.0


def test_a_side_that_was_chosen_is_kept():
    meeting = others(flying(120.0 + 0j, -NORTH))
    held = keep_clear(HERE, STRAIGHT_ON, meeting, AGILITY, side=-math.radians(20.0))
    assert held.turn < 0.0


def way_of(apart: complex, closing: complex) -> float:
    (way,) = passing(np.array([apart]), np.array([closing]))
    return float(way)


@pytest.mark.parametrize(
    ("apart", "closing", "way"),
    [
        # The other crosses from the right, 5 m in front: the line of sight turns left.
        pytest.param(55.0 + 50.0j, -20.0 - 20.0j, -1.0, id="from the right"),
        pytest.param(55.0 - 50.0j, -20.0 + 20.0j, 1.0, id="from the left"),
        pytest.param(120.0 + 0j, -40.0 + 0j, -1.0, id="head on"),
        # Who meets nobody may pass on either side.
        pytest.param(50.0 + 50.0j, 20.0 + 20.0j, 0.0, id="away from each other"),
        pytest.param(12.0j, -5.0j, 0.0, id="slowly, as in slots"),
    ],
)
def test_two_that_meet_find_the_same_way_for_the_line_of_sight_between_them(apart, closing, way):
    assert way_of(apart, closing) == way_of(-apart, -closing) == way


@pytest.mark.parametrize("side", [-1.0, 1.0], ids=["left", "right"])
def test_both_hold_to_one_side_where_the_other_one_needs_less(side):
    # 3 m aside: to pass on this side is the least change, by far. Who goes right sees it turn left.
    nearer = flying(120.0 + 3.0j * side, -NORTH)
    assert cleared(others(nearer)).turn * side < 0.0
    agreed = cleared(others(nearer, passes=-side))
    assert agreed.turn * side > 0.0
    assert agreed.nearest[0] >= FLOOR_M


def test_height_between_two_counts_in_the_plane_and_who_is_high_enough_flies_on():
    # 3 m aside, straight ahead all the time; height worth 4 m more: 5 m in all.
    beside, shape = others(flying(3.0j, NORTH)), (1, len(BEGINNINGS))
    level = closest_approaches(flying(0j, NORTH)[None, :], beside)
    assert level == pytest.approx(np.full((1, *shape), 3.0))
    above = replace(beside, worth=np.full(shape, 4.0))
    space = closest_approaches(flying(0j, NORTH)[None, :], above)
    assert space == pytest.approx(np.full((1, *shape), 5.0))
    meets = others(flying(100.0 + 0j, -NORTH))
    assert cleared(meets).changed
    assert not cleared(replace(meets, worth=np.full(shape, 11.0))).changed
