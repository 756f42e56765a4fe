"""Slots: where they are, how they move, and the errors of those who hold them."""

import math
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.kit.states import circling, leader_at, vehicle_at
from vfguide.elementwise import wrap_angle
from vfguide.guidance.airframe import ground_speed_on_course, polar, resolve
from vfguide.guidance.formation import (
    FormationError,
    Slot,
    SlotLimits,
    SlotMotion,
    airspeed_that_gives_way,
    breakaway_course,
    extrapolate_by_rates,
    formation_error,
    slot_airspeed,
    slot_motion,
    slot_position,
    slot_velocity,
)
from vfguide.state import Airframe, LeaderState

SLOTS = [
    Slot(forward=forward, right=right)
    for forward, right in ((-20.0, -20.0), (-20.0, 20.0), (-40.0, 0.0), (15.0, 5.0))
]


@pytest.mark.parametrize("slot", SLOTS)
def test_a_slots_velocity_is_that_of_a_rigid_figure(slot):
    state = circling(3.0)
    places = [slot_position(circling(3.0 + step), slot) for step in (-1e-4, 1e-4)]
    north, east = ((after - before) / 2e-4 for before, after in zip(*places, strict=True))
    velocity = slot_velocity(20.0, state.turn_rate, slot)
    assert velocity == pytest.approx(resolve(north, east, state.course))
    motion = slot_motion(state, slot)
    assert motion.speed == pytest.approx(math.hypot(north, east))
    assert wrap_angle(motion.course - math.atan2(east, north)) == pytest.approx(0.0, abs=1e-7)
    # a rigid figure turns as one, at a steady pace
    assert motion.turn_rate == pytest.approx(20.0 / 150.0)
    assert motion.acceleration == pytest.approx(0.0, abs=1e-12)


def weaving(time: float) -> LeaderState:
    """A leader whose speed and turn rate change, at the origin at any time."""
    return leader_at(
        course=0.5 + 0.05 * time + 0.2 * math.sin(0.5 * time),
        ground_speed=20.0 + 3.0 * math.sin(0.4 * time),
        acceleration=1.2 * math.cos(0.4 * time),
        turn_rate=0.05 + 0.1 * math.cos(0.5 * time),
        turn_acceleration=-0.05 * math.sin(0.5 * time),
    )


@pytest.mark.parametrize("slot", SLOTS)
@pytest.mark.parametrize("time", [0.0, 1.7, 5.0, 9.3])
def test_turn_rate_and_acceleration_are_the_rates_of_course_and_speed(slot, time):
    before, motion, after = (slot_motion(weaving(time + step), slot) for step in (-1e-4, 0.0, 1e-4))
    turning = wrap_angle(after.course - before.course) / 2e-4
    assert motion.turn_rate == pytest.approx(turning, abs=1e-7)
    speeding = (after.speed - before.speed) / 2e-4
    assert motion.acceleration == pytest.approx(speeding, abs=1e-6)


def test_a_transient_turn_rate_does_not_reverse_a_slot():
    # 0.8 rad/s, 40 m right: 20 - 32 m/s would be backward; 40 m ahead it moves at 32 m/s to the right,
    # and forward at the least of 3 m/s
    motion = slot_motion(leader_at(turn_rate=0.8), Slot(forward=40.0, right=40.0))
    assert motion.speed == pytest.approx(math.hypot(3.0, 32.0))
    assert motion.course == pytest.approx(math.atan2(32.0, 3.0))
    assert motion.course < math.pi / 2.0


def motion_on(north: float, east: float, course: float, **fields: float) -> SlotMotion:
    usual = {"speed": 20.0, "turn_rate": 0.0, "acceleration": 0.0}
    return SlotMotion(north=north, east=east, course=course, **usual | fields)


@pytest.mark.parametrize(
    ("north", "east", "along", "right"),
    [(0.0, 10.0, 10.0, 0.0), (-10.0, 0.0, 0.0, 10.0), (0.0, -10.0, -10.0, 0.0), (4, 3, 3, -4)],
)
def test_ahead_is_positive_along_and_right_positive_across(north, east, along, right):
    # the slot flies east: ahead of the follower is east of it, right is south of it
    follower = vehicle_at(100.0, 50.0, math.pi / 2.0)
    error = formation_error(motion_on(100.0 + north, 50.0 + east, math.pi / 2.0), follower)
    assert (error.along_track, error.cross_track) == pytest.approx((along, right), abs=1e-12)
    assert error.along_track_rate == pytest.approx(0.0)
    assert error.cross_track_rate == pytest.approx(0.0)


@pytest.mark.parametrize("turn_rate", [-0.2, 0.0, 0.15])
@pytest.mark.parametrize("course", [-2.0, 0.3, 2.5])
def test_error_rates_are_the_rates_of_the_errors(turn_rate, course):
    def error_at(time: float) -> FormationError:
        north, east = polar(22.0 * time, 0.7)
        rates = {"speed": 22.0, "turn_rate": turn_rate}
        motion = motion_on(30.0 + north, -12.0 + east, 0.7 + turn_rate * time, **rates)
        north, east = polar(18.0 * time, course)
        return formation_error(motion, vehicle_at(5.0 + north, 9.0 + east, course, 18.0))

    before, here, after = (error_at(time) for time in (-1e-4, 0.0, 1e-4))
    along = (after.along_track - before.along_track) / 2e-4
    cross = (after.cross_track - before.cross_track) / 2e-4
    assert here.along_track_rate == pytest.approx(along, abs=1e-5)
    assert here.cross_track_rate == pytest.approx(cross, abs=1e-5)


def test_a_changing_turn_rate_is_carried_on():
    start = leader_at(acceleration=1.0, turn_rate=0.2, turn_acceleration=0.3)
    steps, age = 4000, 0.4
    time = (np.arange(steps) + 0.5) * age / steps
    course = 0.2 * time + 0.15 * time * time
    north = float(np.sum((20.0 + time) * np.cos(course)) * age / steps)
    east = float(np.sum((20.0 + time) * np.sin(course)) * age / steps)
    later = extrapolate_by_rates(start, age)
    # 0.2 . 0.4 + 0.3 . 0.16/2 = 0.104 rad; 0.2 + 0.12 rad/s
    assert (later.course, later.turn_rate) == pytest.approx((0.104, 0.32))
    # third order again: about 20 . 0.26² . 0.4³/24 = 3.6 mm; unchanged turning would be 64 mm off in east
    assert math.hypot(later.north - north, later.east - east) < 0.005
    unchanged = extrapolate_by_rates(leader_at(acceleration=1.0, turn_rate=0.2), age)
    assert east - unchanged.east == pytest.approx(20.0 * 0.3 * 0.4**3 / 6.0, rel=0.05)


@pytest.mark.parametrize(
    ("leader_deg", "right", "course_deg"),
    [
        *((0.0, 20.0, 60.0), (0.0, -20.0, -60.0), (45.0, 20.0, 105.0), (45.0, -20.0, -15.0)),
        *((270.0, 100.0, 330.0), (-90.0, -7.0, -150.0)),
        # On the leader's track: straight on. From 5 m on it is at the side.
        *((45.0, 0.0, 45.0), (45.0, 4.999, 45.0), (45.0, -4.999, 45.0)),
        *((45.0, 5.0, 105.0), (45.0, -5.0, -15.0)),
    ],
)
@pytest.mark.parametrize("forward", [-40.0, 0.0, 30.0])
def test_each_turns_away_to_the_side_of_its_slot(leader_deg, right, course_deg, forward):
    course = breakaway_course(math.radians(leader_deg), Slot(forward=forward, right=right))
    assert course == pytest.approx(math.radians(course_deg))


@pytest.mark.parametrize(("wind_north", "wind_east"), list(product([-8.0, 0.0, 8.0], repeat=2)))
def test_nobody_comes_nearer_to_anybody_while_flying_away(wind_north, wind_east):
    """The formation of the shipped missions, each at 20 m/s through the air from where its slot is."""
    places = []
    for slot in SLOTS[:3]:
        course = breakaway_course(0.0, slot)
        north, east = polar(ground_speed_on_course(20.0, course, wind_north, wind_east), course)
        times = (0.0, 5.0, 10.0, 25.0)
        places.append([(slot.forward + north * t, slot.right + east * t) for t in times])
    left, right, middle = places
    assert math.dist(left[-1], right[-1]) > 200.0
    for one, other in ((left, right), (left, middle), (right, middle)):
        assert all(math.dist(*pair) >= 15.0 for pair in zip(one, other, strict=True))


REPEATABLE = settings(deadline=None, derandomize=True, database=None, max_examples=300)
AIRFRAME = Airframe()
NARROW = Airframe(airspeed_min=19.5, airspeed_max=21.0)
CRUISE = 20.0


def slot(forward: float, right: float) -> SlotLimits:
    return SlotLimits(slot=Slot(forward=forward, right=right), airspeed_min=12.0, airspeed_max=32.0)


@pytest.mark.parametrize(
    ("state", "airspeed"),
    [
        # 40 m behind at 0.1 rad/s: hypot(20, 4); in a wind of 5 m/s from behind: hypot(15, 4)
        (vehicle_at(), math.hypot(20.0, 4.0)),
        (vehicle_at(wind=(5.0, 0.0)), math.hypot(15.0, 4.0)),
        # flying east the slot slips to the left of east, north: (4, 20), less the wind (4, 5): 15
        (vehicle_at(course=math.pi / 2.0, wind=(4.0, 5.0)), 15.0),
    ],
)
def test_a_slot_needs_the_airspeed_of_its_own_velocity(state, airspeed):
    assert slot_airspeed(state, 0.1, Slot(forward=-40.0, right=0.0)) == pytest.approx(airspeed)


INSIDE, OUTSIDE = slot(0.0, 90.0), slot(0.0, -120.0)
"""At 0.1 rad/s to the right and 20 m/s: 20 - 9 = 11 m/s, and 20 + 12 = 32 m/s."""


@pytest.mark.parametrize(
    ("ground_speed", "followers", "airframe", "airspeed"),
    [
        (20.0, [], AIRFRAME, 20.0),
        (20.0, [slot(0.0, 60.0)], AIRFRAME, 20.0),  # 14 m/s are enough
        (20.0, [slot(0.0, 75.0)], AIRFRAME, 20.5),  # 12.5 m/s are less than 12 and the margin of 1
        (20.0, [INSIDE], AIRFRAME, 22.0),  # 11 m/s are 2 short
        (20.0, [OUTSIDE], AIRFRAME, 19.0),  # 32 m/s are 1 more than 32 less the margin
        (20.0, [INSIDE, OUTSIDE], AIRFRAME, 21.0),  # 20 + 2 - 1
        (20.0, [INSIDE, slot(0.0, 100.0)], AIRFRAME, 23.0),  # 10 m/s: the worst one counts
        (20.0, [slot(0.0, 500.0)], AIRFRAME, 20.0),  # |20 - 50| = 30 m/s are within the range
        # at 22 m/s the slot needs 13, at cruise it would need 11 still: no hunting between the two
        (22.0, [INSIDE], AIRFRAME, 22.0),
        # no further than it can fly itself
        (20.0, [INSIDE], NARROW, 21.0),
        (20.0, [OUTSIDE], NARROW, 19.5),
    ],
)
def test_the_leader_adds_what_the_worst_slot_lacks(ground_speed, followers, airframe, airspeed):
    flying = vehicle_at(ground_speed=ground_speed)
    found = airspeed_that_gives_way(CRUISE, flying, 0.1, followers, airframe)
    assert found == pytest.approx(airspeed)


@REPEATABLE
@given(
    course=st.floats(-math.pi, math.pi),
    speed=st.floats(1.0, 80.0),
    wind=st.tuples(st.floats(-30.0, 30.0), st.floats(-30.0, 30.0)),
    turn_rate=st.floats(-2.0, 2.0),
    offsets=st.lists(st.tuples(st.floats(-1e4, 1e4), st.floats(-1e4, 1e4)), max_size=5),
)
def test_conflicting_demands_stay_finite_and_within_the_leaders_range(
    course, speed, wind, turn_rate, offsets
):
    state = vehicle_at(course=course, ground_speed=speed, wind=wind)
    followers = [slot(*offset) for offset in offsets]
    found = airspeed_that_gives_way(CRUISE, state, turn_rate, followers, AIRFRAME)
    assert AIRFRAME.airspeed_min <= found <= AIRFRAME.airspeed_max
    assert followers or found == CRUISE
