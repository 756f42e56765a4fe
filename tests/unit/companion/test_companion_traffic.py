"""Where a follower believes the others to be."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from vfguide.companion.lookout import Standpoint, calm_for, greatest_wish
from vfguide.companion.plan import FlightPlan
from vfguide.companion.shared_clock import SAME_CLOCK, SharedClock
from vfguide.companion.traffic import Traffic, kept_distance
from vfguide.guidance.formation import FieldGains
from vfguide.guidance.separation import Obstacle

MakePlan = Callable[..., FlightPlan]
LeaderBytes = Callable[..., bytes]

TURN = 0.1
"""rad/s of whoever is heard."""


@pytest.fixture
def traffic(plan: MakePlan) -> Traffic:
    return Traffic({"f2": 40.0}, plan().frame, SAME_CLOCK, plan().settings.field)


def beside(time_s: float, east: float = 10.0) -> Standpoint:
    """Of one in its slot, abreast of somebody who was 200 m north at 10 s and flies north at 20 m/s."""
    return Standpoint(
        time_s=time_s,
        north=200.0 + 20.0 * (time_s - 10.0),
        east=east,
        slot_north=20.0,
        slot_east=0.0,
        off_slot=0.0,
        distance=0.0,
        avoiding=False,
    )


def test_nobody_is_in_the_way_before_anybody_was_heard(traffic: Traffic) -> None:
    assert traffic.obstacles(beside(10.0), linked=True) == []


def test_another_follower_is_where_it_has_flown_since_it_was_heard(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    # 20 m/s northbound from 200 m north of the origin.
    traffic.receive("f2", leader_bytes(10.0), 10.1)
    (one,) = traffic.obstacles(beside(10.5), linked=True)
    assert (one.north, one.east) == (pytest.approx(210.0, abs=1e-3), pytest.approx(0.0, abs=1e-3))
    assert (one.velocity_north, one.velocity_east) == (pytest.approx(20.0), pytest.approx(0.0))
    assert one.keep == 8.0


def test_one_too_far_away_to_matter_is_not_looked_at_before_it_may(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=1000.0), linked=True) == []
    # nobody is left unlooked at for longer than two seconds
    assert traffic.obstacles(beside(11.9), linked=True) == []
    assert len(traffic.obstacles(beside(12.1), linked=True)) == 2


def test_strangers_and_rubbish_are_in_nobodys_way(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f9", leader_bytes(10.0), 10.0)
    traffic.receive("f2", b"rubbish", 10.0)
    traffic.receive("f2", leader_bytes(20.0), 10.0)
    assert traffic.obstacles(beside(10.0), linked=True) == []
    assert dict(traffic.counters) == {"malformed": 1, "from the future": 1}


def test_the_time_of_a_state_is_the_formations(plan: MakePlan, leader_bytes: LeaderBytes) -> None:
    skewed = SharedClock(
        to_own=lambda time_s: time_s - 100.0, from_own=lambda time_s: time_s + 100.0
    )
    traffic = Traffic({"f2": 40.0}, plan().frame, skewed, plan().settings.field)
    traffic.receive("f2", leader_bytes(10.0, time_s=110.0), 10.0)
    (one,) = traffic.obstacles(beside(10.5), linked=True)
    assert one.north == pytest.approx(210.0, abs=1e-3)


def test_one_that_fell_silent_may_fly_on_along_its_arc_or_straight(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0, turn_rate=TURN), 10.0)
    arc, straight = traffic.obstacles(beside(13.0), linked=True)
    # On the arc it has turned by 0.3 rad; its autopilot, left alone, ends the turn one second ahead.
    assert math.atan2(arc.velocity_east, arc.velocity_north) == pytest.approx(3.0 * TURN)
    assert math.atan2(straight.velocity_east, straight.velocity_north) == pytest.approx(TURN)
    assert (arc.keep, straight.keep) == (8.0, pytest.approx(8.0 + 0.5 * 2.0))


def test_ones_own_deafness_says_nothing_about_the_others(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0, turn_rate=TURN), 10.0)
    (arc,) = traffic.obstacles(beside(13.0), linked=False)
    assert math.atan2(arc.velocity_east, arc.velocity_north) == pytest.approx(3.0 * TURN)
    assert arc.keep == 8.0


def test_damaged_states_end_no_silence(traffic: Traffic, leader_bytes: LeaderBytes) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=1000.0), linked=True) == []
    for now in (10.5, 11.0, 11.5):
        traffic.receive("f2", leader_bytes(now)[:-1] + b"?", now)
    # A kilometre away it would not be looked at again before 12 s; after a silence of 1.5 s it is at once.
    traffic.receive("f2", leader_bytes(11.5), 11.5)
    assert len(traffic.obstacles(beside(11.5), linked=True)) == 1


def test_one_that_is_silent_for_long_is_nowhere(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert len(traffic.obstacles(beside(24.9), linked=True)) == 2
    assert traffic.obstacles(beside(25.1), linked=True) == []


@pytest.mark.parametrize(
    ("spacing", "distance", "kept"),
    [(40.0, 0.0, 8.0), (40.0, 2.5, 9.5), (40.0, 5.0, 11.0), (40.0, 300.0, 11.0), (8.0, 0.0, 5.2)],
)
def test_whoever_is_astray_keeps_more_and_close_slots_less(
    spacing: float, distance: float, kept: float
) -> None:
    assert kept_distance(spacing, distance) == pytest.approx(kept)


GAINS = FieldGains(k_x=0.2, k_y=0.2, chi_inf=math.pi / 4.0, v_inf=8.0)


def abreast(east: float, velocity_north: float = 20.0) -> Obstacle[float]:
    """Somebody so far east of the origin, 200 m north."""
    return Obstacle(
        north=200.0, east=east, velocity_north=velocity_north, velocity_east=0.0, keep=7.0
    )


def test_in_its_slot_a_follower_wishes_for_nothing_and_far_out_for_a_sharp_turn() -> None:
    assert greatest_wish(0.0, 20.0, GAINS) == 0.0
    # Far out 8 m/s more than the slot, 45 degrees off its course: 8 + 2 * 28 * sin(22.5 degrees).
    assert greatest_wish(math.inf, 20.0, GAINS) == pytest.approx(29.43, abs=0.01)


def test_only_who_is_near_enough_for_what_may_be_asked_for_is_in_the_way() -> None:
    here = beside(10.0, east=0.0)
    # Nothing wished for: 7 m; then 21 / 0.4 = 52.5 m/s and half of 21 m/s², 5.25 m and 0.105 m in 0.1 s.
    assert calm_for(here, abreast(7.0), 0.0) == 0.0
    assert calm_for(here, abreast(12.355), 0.0) == pytest.approx(0.1)
    # 10 m/s wished for, the other 8 m/s faster: 7 + 18 / 0.4 = 52 m; then 30.25 m and 2.625 m in 0.5 s.
    assert calm_for(here, abreast(52.0, 28.0), 10.0) == 0.0
    assert calm_for(here, abreast(84.875, 28.0), 10.0) == pytest.approx(0.5)
    assert calm_for(here, abreast(5000.0), 0.0) == 2.0


def test_of_who_is_far_away_the_newest_is_known_when_it_may_have_come_near(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=100.0), linked=True) == []
    traffic.receive("f2", leader_bytes(11.0)[:-1] + b"?", 11.0)
    traffic.receive("f2", leader_bytes(10.9, turn_rate=TURN), 11.0)
    assert dict(traffic.counters) == {"malformed": 1}
    (one,) = traffic.obstacles(beside(11.9), linked=True)
    # 0.1 rad/s for a second.
    assert math.atan2(one.velocity_east, one.velocity_north) == pytest.approx(TURN)


def test_each_of_the_others_is_looked_at_when_its_own_time_has_come(
    plan: MakePlan, leader_bytes: LeaderBytes
) -> None:
    traffic = Traffic({"f2": 40.0, "f3": 40.0}, plan().frame, SAME_CLOCK, plan().settings.field)
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=1000.0), linked=True) == []
    # heard for the first time: looked at at once, and two seconds after that
    traffic.receive("f3", leader_bytes(11.0), 11.0)
    assert traffic.obstacles(beside(11.0, east=1000.0), linked=True) == []
    assert traffic.obstacles(beside(11.9), linked=False) == []
    near = traffic.obstacles(beside(12.1), linked=False)
    assert len(near) == 1
    assert len(traffic.obstacles(replace(beside(13.1), avoiding=True), linked=False)) == 2


def test_whoever_leaves_its_slot_looks_round_at_once(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=60.0), linked=True) == []
    astray = replace(beside(10.05, east=60.0), distance=20.0)
    assert len(traffic.obstacles(astray, linked=True)) == 1


def test_whoever_keeps_clear_of_somebody_looks_at_all_who_may_be_next(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=60.0), linked=True) == []
    avoiding = replace(beside(10.05, east=60.0), avoiding=True)
    assert len(traffic.obstacles(avoiding, linked=True)) == 1


def test_somebody_else_matters_only_where_a_barrier_may_turn_the_wish_toward_it(
    plan: MakePlan, leader_bytes: LeaderBytes
) -> None:
    traffic = Traffic({"f2": 40.0, "f3": 40.0}, plan().frame, SAME_CLOCK, plan().settings.field)
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    traffic.receive("f3", leader_bytes(10.0), 10.0)
    # With 0.5 m foreseen 1.9 m/s may be wished for: a reach of 12 m, of 19 m once somebody is within that.
    assert traffic.obstacles(beside(10.0, east=15.0), linked=True) == []
    leader_beside = replace(abreast(15.0 + 11.0), north=200.0)
    found = traffic.obstacles(beside(10.0, east=15.0), linked=True, leading=[leader_beside])
    assert [one.east for one in found] == pytest.approx([26.0, 0.0, 0.0], abs=1e-3)


def test_whoever_answers_late_looks_at_those_who_may_be_in_the_way_by_then(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    # 25 m away; within 12 m of a reach it may be after some 0.2 s.
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=25.0), linked=True) == []
    assert len(traffic.obstacles(beside(10.05, east=25.0), linked=True, lead_s=0.5)) == 1


def test_whoever_aims_beside_its_slot_wishes_for_more(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    aiming = replace(beside(10.0, east=25.0), aims_off=3.0)
    assert len(traffic.obstacles(aiming, linked=True)) == 1
    assert traffic.obstacles(beside(14.0, east=25.0), linked=False) == []


def test_what_is_older_than_the_last_is_counted_and_takes_nobodys_place(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.obstacles(beside(10.0, east=100.0), linked=True) == []
    traffic.receive("f2", leader_bytes(10.4), 10.4)
    traffic.receive("f2", leader_bytes(10.2), 10.5)
    traffic.receive("f2", b"rubbish", 10.5)
    assert dict(traffic.counters) == {"not newer": 1, "malformed": 1}
    (one,) = traffic.obstacles(beside(11.4), linked=True)
    assert one.north == pytest.approx(228.0, abs=1e-3)


def test_a_turn_that_is_rolled_into_does_not_go_on_tightening(
    traffic: Traffic, leader_bytes: LeaderBytes
) -> None:
    # 0.05 rad/s and 0.04 rad/s² for one second: 0.09 rad/s and 0.07 rad, then a circle.
    rolling = leader_bytes(10.0, turn_rate=0.05, turn_acceleration=0.04)
    traffic.receive("f2", rolling, 10.0)
    (arc,) = traffic.obstacles(beside(15.0), linked=False)
    course = math.atan2(arc.velocity_east, arc.velocity_north)
    assert course == pytest.approx(0.07 + 4.0 * 0.09)
