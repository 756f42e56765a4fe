"""Where a vehicle believes the others to be, what they may do, and what height beside them is worth."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from tests.kit.companion import leader_bytes
from tests.kit.states import FRAME, leader_at, view
from vfguide.companion.height_beside import (
    HEIGHT_OFF_M,
    LEAST_UP_M,
    Obstacle,
    goes_over,
    height_sense,
    neighbour_of,
    worth_in_plane,
)
from vfguide.companion.plan import OtherVehicle
from vfguide.companion.possibilities import BERTH_M, DRIFT_M_S, SILENT_S, SPACING_SHARE, Viewpoint
from vfguide.companion.state_receiver import StateReceiver
from vfguide.companion.timing import SAME_CLOCK, SharedClock
from vfguide.companion.traffic import FORGET_S, LATE_INTERVALS, LATE_STATE_S, Traffic, kept_berth
from vfguide.guidance.formation import Slot
from vfguide.guidance.separation import BEGINNINGS, FLOOR_M, STEP_S, TIMES, Others, arc
from vfguide.state import LeaderState

TURN = 0.1
"""rad/s of the vehicle that is heard."""

F2 = OtherVehicle(
    name="f2",
    rank=2,
    leads=False,
    slot=Slot(forward=0.0, right=0.0),
    spacing=40.0,
    lateral_acceleration=10.0,
)

LEADING = replace(F2, name="leader", rank=0, leads=True)


@pytest.fixture
def traffic() -> Traffic:
    return Traffic([F2], FRAME, SAME_CLOCK)


def beside(time_s: float, east: float = 10.0, **changes: Any) -> Viewpoint:
    """Abreast of a vehicle that was 200 m north at 10 s and flies north at 20 m/s."""
    return view(time_s, 200.0 + 20.0 * (time_s - 10.0), east, reaction_s=1.5, **changes)


def windy(wind: Callable[[float], complex], time_s: float, *, east: float = 7.0) -> Viewpoint:
    return beside(time_s, east, wind=wind(time_s))


def led(time_s: float) -> LeaderState:
    """A leader that flies where that vehicle does."""
    return leader_at(time_s=time_s, north=20.0 * time_s)


def both() -> Traffic:
    """Traffic of f2 and of the leader."""
    return Traffic([F2, LEADING], FRAME, SAME_CLOCK)


def followers() -> Traffic:
    """Traffic of f2 and f3, as the leader sees it."""
    return Traffic([F2, replace(F2, name="f3")], FRAME, SAME_CLOCK)


def far_away(now: float) -> bytes:
    """A state of a vehicle that is in nobody's way: the link works."""
    return leader_bytes(now, latitude_deg=48.0, ground_speed=0.0)


def watched(
    traffic: Traffic,
    seconds: float,
    here: Callable[[float], Viewpoint],
    said: Callable[[float], bytes | None] = lambda _: None,
    *,
    leads: bool = False,
) -> Others:
    """Look 20 times a second from 10 s on: f2 says something at times, another is heard far away."""
    for step in range(round(seconds * 20) + 1):
        now = 10.0 + 0.05 * step
        data = said(now)
        if data is not None:
            traffic.receive("f2", data, now)
        if step % 10 == 0 and leads:
            traffic.receive("f3", far_away(now), now)
        elif step % 10 == 0:
            traffic.note("leader", heard_leader(far_away(now), now))
        seen = traffic.possibilities(here(now), None if leads else led(now))
    return seen[0]


def once(**values: float) -> Callable[[float], bytes | None]:
    """What f2 says at 10 s, and nothing later."""
    return lambda now: leader_bytes(now, **values) if now == 10.0 else None


def fallen_silent(**said: float) -> Traffic:
    """f2 is heard at 10 s for the last time; the link works: another is heard all the time, far away."""
    traffic = both()
    traffic.receive("f2", leader_bytes(10.0, **said), 10.0)
    for time_s in (9.0, 11.0, 12.9):
        traffic.note("leader", heard_leader(far_away(time_s), time_s))
    return traffic


def found(traffic: Traffic, here: Viewpoint, rows: frozenset[int] = frozenset({0})) -> Others:
    seen = traffic.possibilities(here, led(here.time_s))
    assert set(seen[1]) == rows
    return seen[0]


def is_in_the_way(traffic: Traffic, here: Viewpoint) -> bool:
    return traffic.possibilities(here, led(here.time_s)) is not None


def courses(others: Others) -> list[float]:
    """Courses (rad) in the first half second."""
    return [float(angle) for angle in np.angle(others.tracks[:, 1] - others.tracks[:, 0])]


def test_nobody_is_in_the_way_before_anybody_was_heard_nor_where_there_is_nobody(traffic):
    assert not is_in_the_way(traffic, beside(10.0))
    assert Traffic([], FRAME, SAME_CLOCK).possibilities(beside(10.0), None) is None


def test_a_steered_vehicle_flies_on_with_the_formation_and_is_not_in_the_way_far_from_it(traffic):
    traffic.receive("f2", leader_bytes(10.0), 10.1)
    others = found(traffic, beside(10.5, east=7.0))
    assert others.tracks[0, 0] == pytest.approx(210.0, abs=1e-2)
    assert others.tracks[0, 2] == pytest.approx(210.0 + 20.0 * 2 * STEP_S, abs=1e-2)
    assert list(others.keep) == [8.0]
    assert not is_in_the_way(traffic, beside(10.5, east=40.0))


def test_a_vehicle_that_is_not_steered_may_fly_on_level_out_or_turn_at_its_bank_limit(traffic):
    traffic.receive("f2", leader_bytes(10.0, turn_rate=TURN, steered=False), 10.0)
    others = found(traffic, beside(10.0, east=40.0))
    # 10 m/s² at 20 m/s are 0.5 rad/s; the chord of half a second lies half as far round.
    assert courses(others) == pytest.approx([0.25 * TURN, 0.0, 0.125, -0.125], abs=1e-3)
    assert list(others.keep) == [BERTH_M, BERTH_M, FLOOR_M, FLOOR_M]
    assert others.horizon_s[2] == 1.5


def test_the_leader_looks_at_those_alone_that_are_not_steered(traffic):
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert traffic.possibilities(beside(10.5), None) is None
    traffic.receive("f2", leader_bytes(10.5, steered=False), 10.5)
    assert traffic.possibilities(beside(10.5), None) is not None


@pytest.mark.parametrize(
    ("steered", "altitude_amsl", "climb_rate", "in_the_way"),
    [
        *((False, 550.0, 0.0, False), (False, 570.0, 0.0, True)),
        # 15 m let a steered one pass; what closes by 2 m/s is 12 m away in three seconds.
        *((True, 606.0, 0.0, False), (True, 606.0, -2.0, True), (True, 606.0, 2.0, False)),
    ],
)
def test_a_vehicle_far_above_or_below_is_in_the_way_of_one_that_comes_to_its_height(
    traffic, steered, altitude_amsl, climb_rate, in_the_way
):
    traffic.receive("f2", leader_bytes(10.0, steered=steered), 10.0)
    height = {"altitude_amsl": altitude_amsl, "climb_rate": climb_rate}
    assert is_in_the_way(traffic, beside(10.0, wanted=20.0 - 2.0j, **height)) is in_the_way


def test_strangers_and_rubbish_are_in_nobodys_way(traffic):
    traffic.receive("f9", leader_bytes(10.0), 10.0)
    traffic.receive("f2", b"rubbish", 10.0)
    traffic.receive("f2", leader_bytes(20.0), 10.0)
    assert not is_in_the_way(traffic, beside(10.0))
    assert dict(traffic.counters) == {"malformed": 1, "from the future": 1}


def test_the_time_of_a_state_is_the_formations():
    skewed = SharedClock(
        to_own=lambda time_s: time_s - 100.0, from_own=lambda time_s: time_s + 100.0
    )
    traffic = Traffic([F2], FRAME, skewed)
    traffic.receive("f2", leader_bytes(10.0, time_s=110.0), 10.0)
    assert found(traffic, beside(10.5, east=7.0)).tracks[0, 0] == pytest.approx(210.0, abs=1e-2)


def heard_leader(data: bytes, now: float) -> StateReceiver:
    receiver = StateReceiver(FRAME, SAME_CLOCK)
    assert receiver.take(data, now)
    return receiver


def test_one_that_fell_silent_may_fly_on_with_the_formation_or_straight():
    others = found(fallen_silent(turn_rate=TURN), beside(13.0))
    assert len(others.tracks) == 3
    # Its autopilot, left alone, ends the turn one second ahead; course or heading is the same in still air.
    for straight in others.tracks[-2:]:
        assert np.angle(straight[1] - straight[0]) == pytest.approx(TURN)
        assert np.angle(straight[-1] - straight[-2]) == pytest.approx(TURN)
    assert list(others.keep) == pytest.approx([8.0 + DRIFT_M_S * (3.0 - SILENT_S)] * 3)
    # What predictions are off is added to what has to be kept, too.
    assert list(others.floor) == pytest.approx([FLOOR_M + DRIFT_M_S * (3.0 - SILENT_S)] * 3)


def test_one_that_is_heard_at_this_very_moment_is_beside_one_that_fell_silent():
    traffic = followers()
    traffic.receive("f2", leader_bytes(10.0, turn_rate=TURN), 10.0)
    for time_s in (9.0, 11.0, 12.9, 13.0):
        traffic.receive("f3", leader_bytes(time_s), time_s)
    others = found(traffic, beside(13.0, east=7.0), frozenset({0, 1}))
    assert np.isfinite(others.tracks).all()


def test_one_that_fell_silent_may_fly_straight_on_along_the_course_that_it_was_told_to_hold():
    # A gust turns it to the right; what its autopilot holds is 0.2 rad to the left.
    traffic = fallen_silent(turn_rate=TURN, course_setpoint=-0.2)
    _, straight = found(traffic, beside(13.0)).tracks
    assert np.angle(straight[1] - straight[0]) == pytest.approx(-0.2, abs=1e-4)
    # 60 m along that course from 200 m north, and 20 m/s times 0.95 s of the way it had turned to.
    turned = 1.0 - np.exp(-3.0)
    place = 200.0 + 60.0 * np.exp(-0.2j) + 20.0 * turned * (1.0 - np.exp(-0.2j))
    assert straight[0] == pytest.approx(place, abs=0.02)


def test_one_that_holds_its_course_holds_its_airspeed_too():
    # 20 m/s until 11 s; in 12 m/s from the side 16 m/s are left along the course, 32 m by 13 s.
    silent = once(course_setpoint=0.0)
    here = partial(windy, lambda now: 0j if now <= 11.0 else 12.0j, east=10.0)
    held = watched(both(), 3.0, here, silent).tracks[1]
    assert held[0] == pytest.approx(252.0, abs=1.0)
    assert held[1] - held[0] == pytest.approx(16.0 * STEP_S, abs=0.01)


def test_one_that_falls_silent_while_it_speeds_up_goes_on_for_a_second():
    held = watched(both(), 3.0, beside, once(course_setpoint=0.0, acceleration=2.0)).tracks[1]
    # 21 m in the first second and 22 m in each of the others, from 200 m north on.
    assert held[0] == pytest.approx(200.0 + 21.0 + 44.0, abs=1.5)
    assert held[1] - held[0] == pytest.approx(22.0 * STEP_S, abs=0.01)


def test_one_whose_autopilot_hangs_in_a_turn_keeps_its_bank_while_it_speeds_up():
    def here(now: float) -> Viewpoint:
        return replace(beside(now), wind=2j)

    # North over ground is 2 m/s of wind from the left, and 20 m/s of air ahead and against it.
    air, turn = complex(20.0, -2.0), 0.3
    # In that wind the turn alone gains 0.6 m/s² over ground; the airspeed gains 2 m/s², in all 3 m/s.
    says = once(turn_rate=turn, acceleration=2.0 + turn * 2.0)
    sight = [replace(F2, speed_answer_s=1.5), LEADING]
    traffic = Traffic(sight, FRAME, SAME_CLOCK)
    banked, hardest = watched(traffic, 3.0, here, says).tracks[1:3]
    since = np.linspace(0.0, 5.0, 5001)
    speed = abs(air) + 3.0 * (1.0 - np.exp(-since / 1.5))
    for track, lateral in ((banked, turn * abs(air)), (hardest, F2.lateral_acceleration)):
        heading = np.cumsum(lateral / speed) * 0.001
        velocity = speed * np.exp(1j * heading) * air / abs(air) + 2j
        places = 200.0 + np.cumsum(velocity) * 0.001
        assert track[[0, 4]] == pytest.approx(places[[3000, 5000]], abs=0.6)


@pytest.mark.parametrize("gusts", [0.0, 1.0])
def test_over_a_slow_link_too_the_airspeed_is_the_one_that_is_flown(gusts):
    def said(now: float) -> bytes | None:
        """States take 0.7 s; the first is of a vehicle that stands, and the last comes before 32 s."""
        due = round(now * 20) % 5 == 0 and now < 32.0
        speed = 0.0 if now == 10.0 else 20.0
        return leader_bytes(now - 0.7, course_setpoint=0.0, ground_speed=speed) if due else None

    seen = watched(both(), 24.95, lambda now: replace(beside(now), gusts=gusts), said)
    held = seen.tracks[1]
    assert held[1] - held[0] == pytest.approx(20.0 * STEP_S, abs=0.01)


def test_in_gusts_one_that_nobody_corrects_may_be_farther_off_the_later_it_is_looked_for():
    traffic = fallen_silent(course_setpoint=0.0)
    with_formation, held = found(traffic, replace(beside(13.0), gusts=1.0)).margin
    assert list(with_formation) == [0.0] * len(BEGINNINGS)
    # 3 m for the 3 s since it was heard, and 1 m for each that it is looked ahead; 5 m at most.
    assert list(held) == pytest.approx([min(3.0 + time_s, 5.0) for time_s in BEGINNINGS])


def test_ones_own_deafness_says_nothing_about_the_others_and_a_leader_flies_on(traffic):
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert len(found(traffic, beside(13.0)).tracks) == 1
    assert traffic.possibilities(beside(13.0), None) is None


def test_who_comes_back_later_than_another_after_the_link_was_lost_is_not_astray():
    traffic = both()
    traffic.receive("f2", leader_bytes(10.0, turn_rate=TURN), 10.0)
    # The broker restarts at 10.1 s; the leader, far away, is connected again before f2 is.
    for time_s in (10.0, 12.2, 12.9):
        if time_s == 12.2:
            traffic.lose_link(12.0)
        traffic.note("leader", heard_leader(far_away(time_s), time_s))
    # With the formation, as before; not also straight on.
    assert len(found(traffic, beside(13.0)).tracks) == 1


def test_one_that_is_silent_for_long_is_nowhere(traffic):
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    assert FORGET_S >= 10.0
    assert is_in_the_way(traffic, beside(9.9 + FORGET_S))
    assert not is_in_the_way(traffic, beside(10.1 + FORGET_S))


@pytest.mark.parametrize(
    ("spacing", "distance", "kept"),
    [(40.0, 0.0, 8.0), (40.0, 2.5, 9.5), (40.0, 5.0, 11.0), (40.0, 300.0, 11.0), (8.0, 0.0, 5.2)],
)
def test_whoever_is_astray_keeps_more_and_close_slots_less(spacing, distance, kept):
    assert min(kept_berth(distance), SPACING_SHARE * spacing) == pytest.approx(kept)


@pytest.mark.parametrize(
    ("may_stop", "age_s", "stands"),
    # After a state that was a little late, and after one that never came.
    [(True, 0.6, False), (True, 0.8, True), (False, 0.8, False)],
)
def test_the_place_where_a_leader_that_may_stop_fell_silent_is_not_flown_through(
    may_stop, age_s, stands
):
    traffic = Traffic([F2, replace(LEADING, may_stop=may_stop)], FRAME, SAME_CLOCK)
    for time_s in (9.5, 10.5):
        traffic.receive("f2", far_away(time_s), time_s)
    traffic.note("leader", heard_leader(leader_bytes(10.0), 10.0))
    # 40 m behind it.
    now = 10.0 + age_s
    here = replace(beside(now, east=0.0), place=complex(20.0 * now - 40.0, 0.0))
    seen = traffic.possibilities(here, led(now))
    assert (seen is not None and any(np.ptp(track) == 0.0 for track in seen[0].tracks)) is stands


def test_one_whose_place_is_doubted_may_be_at_either_place(traffic):
    for number in range(20):
        now = 9.0 + 0.05 * number
        traffic.receive("f2", leader_bytes(now), now)
    # From 10 s on it says that it is 30 m farther east.
    traffic.receive("f2", leader_bytes(10.0, east=30.0), 10.0)
    first, *others = found(traffic, beside(10.0, east=7.0), frozenset({0, 1})).tracks[:, 0].imag
    # Where its velocity leads it flies with the formation, where it says it is it may do anything.
    assert first == pytest.approx(0.0, abs=0.01)
    assert others == pytest.approx([30.0] * len(others), abs=5e-3)
    # Believed there after five seconds, it is nowhere else any more.
    for number in range(1, 121):
        now = 10.0 + 0.05 * number
        traffic.receive("f2", leader_bytes(now, east=30.0), now)
    places = found(traffic, beside(16.0, east=25.0)).tracks[:, 0].imag
    assert places == pytest.approx(30.0, abs=5e-3)


def test_a_silent_vehicle_is_not_carried_off_by_a_wind_that_has_not_changed():
    # As the leader sees it: 8 m/s of tail wind all along, and a state of 10 s that no other followed.
    here, heard = partial(windy, lambda _now: 8.0 + 0j), followers()
    heard.receive("f2", leader_bytes(10.0), 10.0)
    heard.receive("f3", far_away(10.0), 10.0)
    assert heard.possibilities(here(10.0), None) is None
    for time_s in (11.5, 13.0):
        heard.receive("f3", far_away(time_s), time_s)
    others, _ = heard.possibilities(here(13.0), None)
    # 200 m north at 10 s and 20 m/s: 260 m at 13 s.
    assert others.tracks[:, 0].real == pytest.approx(260.0, abs=0.5)


@pytest.mark.parametrize("told", [{"course_setpoint": 0.0}, {}])
def test_a_silent_vehicle_is_carried_by_the_wind_as_it_has_been_and_not_as_it_is(told):
    # 6 m/s of head wind from 11 to 15 s, and as much from behind since then.
    here = partial(windy, lambda now: 0j if now <= 11.0 else -6.0 + 0j if now <= 15.0 else 6.0 + 0j)
    tracks = watched(followers(), 6.0, here, once(**told), leads=True).tracks
    # 200 m north at 10 s and 20 m/s, 24 m back and 6 m on: 302 m at 16 s.
    assert tracks[:, 0].real == pytest.approx(302.0, abs=1.0)
    # Over the ground it flies as fast as the wind of now makes it.
    speeds = (tracks[:, 1] - tracks[:, 0]).real
    assert speeds == pytest.approx(26.0 * STEP_S, abs=0.1)


def test_a_state_that_comes_late_after_a_silence_says_where_its_vehicle_is(traffic):
    # 6 m/s from behind since 11 s, as the own vehicle measures; a state of 15 s is heard at 16 s.
    here = partial(windy, lambda now: 0j if now <= 11.0 else 6.0 + 0j)
    traffic.receive("f2", leader_bytes(10.0), 10.0)
    for step in range(121):
        now = 10.0 + 0.05 * step
        traffic.possibilities(here(now), led(now))
    traffic.receive("f2", leader_bytes(15.0), 16.0)
    # 300 m north at 15 s, and 20 m/s over the ground.
    assert found(traffic, here(16.0)).tracks[0, 0].real == pytest.approx(320.0, abs=0.1)


class Thorough(Traffic):
    """Always takes the closer look."""

    def is_clear(self, here: Viewpoint, leader: LeaderState | None) -> bool:
        del here, leader
        return False


@given(
    age_s=st.floats(0.0, SILENT_S),
    away=st.complex_numbers(max_magnitude=250.0),
    course=st.floats(-0.5, 0.5),
    turn_rate=st.floats(-TURN, TURN),
    acceleration=st.floats(-3.0, 3.0),
)
def test_what_is_clear_at_a_glance_is_clear_at_a_closer_look(
    age_s, away, course, turn_rate, acceleration
):
    place = {"north": 200.0 + away.real, "east": 10.0 + away.imag}
    motion = {"course": course, "acceleration": acceleration, "turn_rate": turn_rate}
    traffic = Thorough([F2], FRAME, SAME_CLOCK)
    traffic.receive("f2", leader_bytes(10.0, **place, **motion), 10.0)
    here = beside(10.0 + age_s)
    if Traffic.is_clear(traffic, here, led(here.time_s)):
        assert not is_in_the_way(traffic, here)


@pytest.mark.parametrize(
    ("interval_s", "late_s"), [(0.05, LATE_STATE_S), (0.5, LATE_INTERVALS * 0.5)]
)
def test_a_vehicle_whose_next_state_should_have_been_there_is_late_until_it_comes(
    interval_s, late_s
):
    traffic = both()
    assert traffic.late(0.0) is None
    for number in range(5):
        now = 10.0 + interval_s * number
        traffic.note("leader", heard_leader(leader_bytes(now), now))
        traffic.receive("f2", leader_bytes(now), now)
        assert traffic.late(now) is None
    assert traffic.late(now + late_s - 0.01) is None
    assert list(traffic.late(now + late_s + 0.01))[:2] == [True, True]
    assert list(traffic.late(now + late_s + 0.01, leader=False))[:2] == [True, False]
    later = now + late_s + 0.05
    traffic.note("leader", heard_leader(leader_bytes(later), later))
    assert list(traffic.late(later + 0.01))[:2] == [True, False]


def test_a_leader_that_is_late_is_looked_for_on_its_last_course_before_it_counts_as_silent():
    traffic = both()
    for time_s in (9.5, 10.2):
        traffic.receive("f2", far_away(time_s), time_s)
    traffic.note("leader", heard_leader(leader_bytes(10.0), 10.0))
    here = beside(10.5, east=10.0)
    assert np.isnan(traffic.lost_for(10.5)).all()
    leader = np.array([False, True, False, False])
    assert traffic.lost_for(10.5, late=leader)[1] == pytest.approx(0.5)
    usual, late = (traffic.possibilities(here, led(10.5), late=one) for one in (None, leader))
    # With the formation, and straight on: a vehicle that is steered does the first alone.
    assert usual is None or len(usual[1]) < len(late[1])


LOST = Obstacle(
    name="leader",
    least_m=7.0,
    least_up_m=7.0,
    altitude_amsl=588.0,
    climb_rate=0.0,
    under=True,
    makes_room=False,
    over_m=15.0,
    height_off_m=HEIGHT_OFF_M,
)
"""A vehicle that has just fallen silent."""


def worth(one: Obstacle, heights: list[float]) -> list[float]:
    """What these heights beside it are worth, where 8 m are kept in the plane."""
    tracks = arc(0j, 20.0 + 0j, 0.0)[None, :]
    bounds = {"horizon_s": 8.0, "keep": 8.0, "floor": 7.0, "weight": 1.0, "passes": 0.0}
    arrays = {name: np.array([value]) for name, value in bounds.items()}
    others = Others(tracks=tracks, margin=np.zeros((1, len(BEGINNINGS))), **arrays)
    return list(worth_in_plane(np.array(heights), others, [one])[0])


@pytest.mark.parametrize(
    ("change", "up_m", "worth_m"),
    [
        # Of the height 1 m may be wrong; 6 m of the rest are worth all of the 8 m.
        *(({}, up_m, 0.0) for up_m in (0.0, 1.0)),
        *(({}, up_m, 4.0) for up_m in (4.0, -4.0)),
        *(({}, up_m, 8.0) for up_m in (7.0, 20.0)),
        # Beside one that is steered, or whose height is not known, it is worth nothing.
        ({"over_m": 0.0}, 20.0, 0.0),
        ({"altitude_amsl": np.nan}, 20.0, 0.0),
    ],
)
def test_height_over_a_silent_vehicle_is_worth_what_is_kept_in_the_plane(change, up_m, worth_m):
    assert (HEIGHT_OFF_M, LEAST_UP_M) == (1.0, 6.0)
    found = worth(replace(LOST, **change), [588.0 + up_m] * len(TIMES))
    assert found == pytest.approx([worth_m] * len(BEGINNINGS))


def test_height_over_one_that_climbs_counts_from_where_it_will_be():
    # 2 m/s for 3 s: 10 m above it are 4 m soon, and 3 m for certain.
    climbing = replace(LOST, climb_rate=2.0)
    assert worth(climbing, [598.0] * len(TIMES))[0] == pytest.approx(4.0)


def test_what_a_pilot_may_do_to_the_height_counts_for_less_the_sooner_it_is():
    found = worth(replace(LOST, height_off_m_s=2.0), [598.0] * len(TIMES))
    # After half a second 10 - 1 - 1 = 8 m are left, after 4 s 10 - 1 - 8 = 1 m.
    assert (found[0], found[7], found[8]) == (8.0, pytest.approx(8.0 / 6.0), 0.0)


def goes_over_when(one: Obstacle, **seen: float) -> bool | None:
    """Which side of another it passes that it meets as high, both level, if nothing else is seen."""
    met = {"distance": 5.0, "in_s": 2.0, "height": 0.0, "climb_rate": 0.0}
    own = {"own_height": 0.0, "own_climb_rate": 0.0, "own_sense": 0}
    return neighbour_of(one, **(met | own | seen)).over


@pytest.mark.parametrize(("step_m", "over"), [(20.0, True), (-20.0, False), (0.0, None)])
def test_a_step_beside_a_silent_vehicle_is_not_turned_round_through_its_height(step_m, over):
    assert goes_over_when(LOST, own_sense=height_sense(step_m)) is over


SENSES = st.sampled_from([-1, 0, 1])


@given(st.floats(-10.0, 10.0), SENSES, SENSES, st.booleans())
def test_two_that_see_each_other_alike_never_go_to_the_same_side(above, sense, other, under):
    here = replace(LOST, over_m=0.0, makes_room=True, under=under, sense=other)
    there = replace(here, name="f1", under=not under, sense=sense)
    assert goes_over(here, above, sense) is not goes_over(there, -above, other)


@pytest.mark.parametrize(
    ("above", "own", "other", "later", "over"),
    [
        # 6 m below one that announces a climb, while the own vehicle rises: it stays below.
        (-6.0, 0, 1, True, False),
        # As high: the other way than the announced one, whatever the ranks say.
        (1.0, 0, 1, False, False),
        (1.0, 0, -1, True, True),
        # Both climb: who is earlier in the mission goes on, the later one turns round.
        (1.0, 1, 1, False, True),
        (1.0, 1, 1, True, False),
        # Nothing announced: the later one goes over.
        (1.0, 0, 0, True, True),
        (-1.0, 0, 0, False, False),
    ],
)
def test_of_two_each_takes_the_way_that_the_other_has_not_announced(above, own, other, later, over):
    one = replace(LOST, over_m=0.0, makes_room=True, under=later, sense=other)
    assert goes_over(one, above, own) is over


@pytest.mark.parametrize(
    ("in_s", "other_climbs", "sense", "over"),
    [
        (2.5, 0.0, 0, True),
        (1.0, 0.0, 0, False),
        # One that still sinks and announces a climb is not taken to sink on.
        (2.0, -2.0, 0, True),
        (1.5, -2.0, 1, False),
    ],
)
def test_who_rises_through_the_height_of_the_other_before_they_meet_goes_over(
    in_s, other_climbs, sense, over
):
    # 3 m below, rising by 3 m/s: 3 m above in 2 s, 6 m above in 3 s. Later than 3 s is not looked at.
    one = replace(LOST, over_m=0.0, makes_room=True, under=False, sense=sense)
    meets = {"in_s": in_s, "height": 3.0, "climb_rate": other_climbs, "own_climb_rate": 3.0}
    assert goes_over_when(one, **meets) is over


@pytest.mark.parametrize(
    ("shown", "satellites", "level"),
    [(600.0, -12.0, 588.0), (588.0, 0.0, 588.0), (600.0, 0.0, 600.0), (588.0, 9.0, 597.0)],
    ids=["altimeters apart", "as shown", "higher", "higher than it shows"],
)
def test_altitudes_of_others_are_seen_on_the_own_altimeter(traffic, shown, satellites, level):
    """Two that are level, whose barometers are 12 m apart, are not kept clear of by heights of 12 m."""
    traffic.satellite_m = 0.0
    for tenths in range(1200):
        now = 10.0 + 0.1 * tenths
        data = leader_bytes(now, altitude_amsl=shown, satellite_m=satellites)
        traffic.receive("f2", data, now)
    altitude, _ = traffic.height_of(0, now)
    # A difference of more than 10 m is not believed.
    assert altitude == pytest.approx(max(level, shown - 10.0), abs=0.01)
    assert traffic.shown_more("f2") == pytest.approx(altitude - shown)
