"""Where a companion that learns of an order late takes the leader's height from."""

import math

import pytest

from tests.kit.states import leader_at
from vfguide.companion.planned_height import PlannedHeight
from vfguide.guidance.height import BesidePath, HeightTarget
from vfguide.guidance.height_change import ClimbLimits
from vfguide.guidance.path import Path
from vfguide.paths.line import Line
from vfguide.state import LeaderState

LIMITS = ClimbLimits(climb=4.0, sink=3.0)
MAIN, OTHER = (Line(north=0.0, east=east, course=0.0) for east in (0.0, 10.0))
FLYING = 100.0


def leader(time_s: float, height: float, climb_rate: float) -> LeaderState[float]:
    """A leader that flies north at 20 m/s."""
    return leader_at(time_s=time_s, north=20.0 * time_s, height=height, climb_rate=climb_rate)


def along(
    planned: PlannedHeight, path: Path, motion: LeaderState[float], *, late: bool
) -> HeightTarget:
    """The height beside a path, with a setpoint that takes effect at once."""
    point = path.nearest_in_space(motion.north, motion.east, motion.course, 0.0)
    beside = BesidePath(path=path, point=point, motion=motion, flying=FLYING, ahead_s=0.0)
    return planned.along(beside, steered=True, late=late)


def test_who_saw_the_beginning_of_a_change_plans_on_and_who_did_not_goes_by_the_leader():
    # The leader is 3 m below the path at which it goes over to the other one.
    seen, late = PlannedHeight(LIMITS), PlannedHeight(LIMITS)
    for one in (seen, late):
        along(one, MAIN, leader(0.0, 97.0, 1.0), late=False)
    assert along(seen, OTHER, leader(0.0, 97.0, 1.0), late=False).height == 100.0
    assert not seen.began_anew
    found = along(late, OTHER, leader(0.0, 97.0, 1.0), late=True)
    assert (found.height, found.climb_rate) == (97.0, 1.0)
    assert late.began_anew
    along(late, OTHER, leader(0.1, 97.1, 1.0), late=True)
    assert not late.began_anew


def test_who_hears_of_a_hold_first_levels_off_with_the_leader():
    planned = PlannedHeight(LIMITS)
    # 2² / 0.8 + 0.3 m above where the leader climbs at 2 m/s.
    begin = planned.hold(leader(0.0, 120.0, 2.0), ahead_s=0.0, late=True)
    assert (begin.height, begin.climb_rate) == (120.0, 2.0)
    for step in range(1, 200):
        # What the leader does later does not count.
        found = planned.hold(leader(0.1 * step, 90.0, 0.0), ahead_s=0.0, late=True)
    assert found.height == pytest.approx(125.3125, abs=0.02)
    assert not planned.changes


def test_who_learns_of_a_hold_late_does_not_go_by_the_path_before():
    planned = PlannedHeight(LIMITS)
    along(planned, MAIN, leader(0.0, 130.0, 0.0), late=False)
    assert planned.hold(leader(0.1, 130.0, 0.0), ahead_s=0.0, late=True).height == 130.0


def test_a_leader_whose_height_is_not_known_is_planned_by_its_path():
    planned = PlannedHeight(LIMITS)
    assert along(planned, OTHER, leader(0.0, math.nan, 0.0), late=True).height == 100.0
    assert planned.hold(leader(0.1, math.nan, 0.0), ahead_s=0.0, late=True).height == 100.0
