"""An order to join is rehearsed from where the vehicle is."""

import math

import pytest

from vfguide.formation.arrangement import Arrangement, Point, SlotMove
from vfguide.formation.orders import Formation
from vfguide.formation.transition import RefusedOrderError
from vfguide.lab.studies.order import BEHIND_M, starts_of_joining
from vfguide.mission.order_plan import LeaderPlace

SLOT = Point(-20.0, 20.0, 5.0)
FORMATION = Formation(leader="leader", home={"f1": SLOT, "f3": SLOT}, slots={"f1": SLOT})
PLACES = tuple(SlotMove(vehicle=name, begin=SLOT, end=SLOT) for name in ("f1", "f3"))
ORDER = Arrangement(number=1, time_s=8.0, across_s=0.0, places=PLACES)
EAST = LeaderPlace(north=100.0, east=50.0, course=math.pi / 2.0)


def test_one_that_joins_begins_where_it_is():
    here = {"f3": LeaderPlace(north=70.0, east=0.0, course=-math.pi / 2.0)}
    (start,) = starts_of_joining(FORMATION, ORDER, EAST, here).values()
    # 50 m behind the leader and 30 m right of it, as it flies east.
    assert (start.forward_m, start.right_m) == pytest.approx((-30.0, 10.0))
    assert start.course_deg == pytest.approx(270.0)


def test_one_whose_place_is_not_known_begins_behind_its_slot():
    (start,) = starts_of_joining(FORMATION, ORDER, EAST, {}).values()
    assert (start.forward_m, start.right_m, start.course_deg) == (-BEHIND_M, 0.0, None)


def test_one_that_is_too_far_away_is_refused():
    far = {"f3": LeaderPlace(north=100.0, east=30e3, course=0.0)}
    with pytest.raises(RefusedOrderError, match="f3 is 30 km from the leader: bring it nearer"):
        starts_of_joining(FORMATION, ORDER, EAST, far)


@pytest.mark.parametrize(("height", "up_m"), [(345.0, 40.0), (math.nan, 0.0)])
def test_one_that_joins_begins_at_its_own_height_where_that_is_known(height, up_m):
    leader = LeaderPlace(0.0, 0.0, 0.0, height=300.0, climb_rate=0.0)
    here = {"f3": LeaderPlace(-100.0, 0.0, 0.0, height=height)}
    (start,) = starts_of_joining(FORMATION, ORDER, leader, here).values()
    assert start.up_m == pytest.approx(up_m)
    assert math.isfinite(start.forward_m)
