"""A hold is stacked above the height that the leader has then, and stays within the fence or is refused."""

import math
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import pytest

from tests.kit.missions import content_of, replaced
from vfguide.formation.orders import Order
from vfguide.formation.transition import RefusedOrderError
from vfguide.guidance.height import HeightMotion, changed_height
from vfguide.lab.studies.order import rehearsed
from vfguide.mission import check_mission, order_plan
from vfguide.mission.model import Mission
from vfguide.mission.order_plan import (
    LeaderPlace,
    formation_of_mission,
    planned_place,
    resolve,
    timetable,
)

SLOPE = math.tan(math.radians(8.5))


def climbing(*orders: dict[str, Any], **sections: Any) -> Mission:
    """Four aircraft on a helix of 200 m that climbs by 335 m, from a flying height of 100 m."""
    content = content_of("climb-and-turn")
    path = {**content["path"], "end_height_m": 335.0}
    return replaced("climb-and-turn", path=path, orders=list(orders), **sections)


def test_the_planned_leader_is_as_high_as_its_path_and_climbs_with_it():
    place = planned_place(climbing(), 60.0)
    # 1200 m along, of which the first 100 m bend into the slope: as if it had begun after 50 m.
    assert place.height == pytest.approx(100.0 + 1150.0 * SLOPE)
    assert place.climb_rate == pytest.approx(20.0 * SLOPE)


@pytest.mark.parametrize(("max_height_m", "refused"), [(481, False), (479, True), (450, True)])
def test_check_refuses_a_hold_whose_highest_would_leave_the_fence(max_height_m, refused):
    # At 125 s the leader is at its end, 435 m; f1, f2 and f3 would hold at 450, 465 and 480 m.
    mission = climbing({"at_s": 125, "action": "hold"}, fence={"max_height_m": max_height_m})
    errors = [one.message for one in check_mission(mission) if one.severity == "error"]
    assert bool(errors) is refused
    if refused:
        (message,) = errors
        assert message.startswith("orders[0], at 125 s: ")
        assert f"the fence ends at {max_height_m} m" in message


def test_a_second_hold_is_where_the_first_was_left():
    orders = [
        {"at_s": 40, "action": "hold"},
        {"at_s": 100, "action": "resume"},
        {"at_s": 140, "action": "hold"},
    ]
    # Of 140 s it has flown along its path for 80: 331.6 m, 11.5 m on which its climb comes to rest, and 45 m
    # above that are within the fence. Without
    # the first hold it would be at its end, 435 m, and f3 at 480 m.
    assert len(timetable(climbing(*orders, fence={"max_height_m": 450}))) == 3


def test_the_time_that_an_order_is_to_be_given_later_is_rounded_up():
    first = {"at_s": 10, "shape": "vee"}
    ((order, _),) = timetable(replaced("shapes", orders=[first]))
    early = {"at_s": 10.0 + order.duration_s - 0.4, "shape": "trail"}
    with pytest.raises(RefusedOrderError, match="give it 1 s more"):
        timetable(replaced("shapes", orders=[first, early]))


def refused_as(sentence: str | None) -> AbstractContextManager[object]:
    """Expect that an order is refused in a sentence, or is not."""
    return nullcontext() if sentence is None else pytest.raises(RefusedOrderError, match=sentence)


@pytest.mark.parametrize(("max_height_m", "sentence"), [(218, None), (216, "'f3' flies 217 m")])
def test_a_hold_in_the_middle_of_a_change_of_height_counts_from_where_that_comes_to_rest(
    max_height_m, sentence
):
    # From 200 m to a path at 100 m, at 1.5 m/s, half of 3, which takes 3 s to reach: after 18 s 24.75 m down.
    # That comes to rest 3.1 m lower, at 172.1 m, and f3 holds 45 m above that. The new path is at 100 m.
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 9000, "east_m": 9000}]
    high = [{**corner, "up_m": 100} for corner in corners]
    mission = replaced(
        "shapes",
        path={"type": "waypoints", "waypoints": high},
        paths={"low": {"type": "waypoints", "waypoints": corners}},
        orders=[{"at_s": 10, "path": "low"}, {"at_s": 28, "action": "hold"}],
        fence={"max_height_m": max_height_m},
    )
    with refused_as(sentence):
        assert len(timetable(mission)) == 2


def test_a_hold_a_day_after_a_change_of_height_is_worked_out_from_the_end_of_that(monkeypatch):
    """From 200 m to 100 m at 1.5 m/s is done in 70 s, and closed within 4 s more; each second is a step."""
    steps = []

    def counted(*values: Any) -> HeightMotion:
        steps.append(1)
        return changed_height(*values)

    monkeypatch.setattr(order_plan, "changed_height", counted)
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 9000, "east_m": 9000}]
    mission = replaced(
        "shapes",
        path={"type": "waypoints", "waypoints": [{**corner, "up_m": 100} for corner in corners]},
        paths={"low": {"type": "waypoints", "waypoints": corners}},
        orders=[{"at_s": 10, "path": "low"}, {"at_s": 86_400, "action": "hold"}],
        fence={"max_height_m": 246},
    )
    assert len(timetable(mission)) == 2
    assert 60 < len(steps) < 90


@pytest.mark.parametrize(
    ("height", "sentence"),
    [
        (400.0, None),
        (420.0, "'f3' flies 465 m above the origin"),
        # Of one whose height is not known the first turn of its helix counts.
        (math.nan, None),
    ],
)
def test_an_order_to_hold_counts_from_the_height_at_which_the_leader_is(height, sentence):
    mission = climbing(fence={"max_height_m": 450})
    leader, formation = LeaderPlace(0.0, 0.0, 0.0, height=height), formation_of_mission(mission)
    with refused_as(sentence):
        resolve(mission, Order(action="hold"), formation, number=1, time_s=5.0, leader=leader)


@pytest.mark.parametrize(
    ("max_height_m", "sentence"), [(361, None), (349, "the fence ends at 349 m")]
)
def test_an_order_is_rehearsed_from_the_height_and_the_turn_of_the_helix_at_which_the_leader_is(
    max_height_m, sentence
):
    # The leader is at 272 m after a minute, on its third turn. The hold begins 8 s later, at 296 m, and
    # its climb of 3 m/s comes to rest within 11.5 m; f3 holds at 352.5 m.
    # Companions that have heard their leader for 2 s only expect some more.
    fenced = climbing(fence={"max_height_m": max_height_m})
    formation, leader = formation_of_mission(fenced), planned_place(fenced, 60.0)
    # As a program resolves it that knows no fence.
    order, _ = resolve(
        climbing(), Order(action="hold"), formation, number=1, time_s=68.0, leader=leader
    )
    with refused_as(sentence):
        assert rehearsed(fenced, formation, order, leader=leader).least_m > 15.0
