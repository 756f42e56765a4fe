"""Orders of other paths, heights and leaders: who knows and bears them, and where they end."""

import math
from typing import Any

import pytest
from msgspec.structs import replace

from tests.kit.missions import content_of, plan_of
from tests.kit.orders import NAMES, SLOTS, Formation, begun, further, moves, order_of, ordered
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.order_limits import (
    age_objection,
    ceiling_objection,
    climb_objection,
    slot_objection,
    time_objection,
)
from vfguide.companion.ordered_flight import RouteEnd
from vfguide.companion.plan import FlightPlan, FollowerTask, KnownPath, LeadPlan
from vfguide.companion.steering import SetpointGuard
from vfguide.companion.timing import SAME_CLOCK
from vfguide.formation.arrangement import Arrangement, HoldCircle, Manoeuvre, Point, SlotMove
from vfguide.guidance.path import PathPoint
from vfguide.guidance.sliding_laws import PathGains
from vfguide.lab.rehearsal.aircraft import Aircraft, step_all
from vfguide.link.memory import Mail
from vfguide.link.order_codec import Verdict
from vfguide.mission import Mission
from vfguide.mission.feasibility import hand_back_at_the_end
from vfguide.paths.circle import Circle as CirclePath
from vfguide.paths.waypoints import Waypoints, WaypointsShape


def route(end: str = "hand-back") -> Waypoints:
    """1000 m north, and round a circle of 100 m without easements."""
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 1000, "east_m": 0}]
    shape = {"type": "waypoints", "waypoints": corners, "end": end, "radius_m": 100.0}
    return Waypoints.of(WaypointsShape.model_validate(shape | {"easement_m": 0}))


Flown = tuple[float, float, bool]
"""Of a leader: how far round the circle and off it, m, and whether it is steered."""


def along(first: int, last: int, *, off: float = 0.0, steered: bool = True) -> list[Flown]:
    return [(float(run), off, steered) for run in range(first, last)]


@pytest.mark.parametrize(("off_s", "told"), [(700.0, "700 s ahead"), (-700.0, "700 s ago")])
def test_an_order_of_another_time_is_said_to_be_ahead_or_past(off_s, told):
    order = order_of(time_s=1000.0 + off_s, flown=Manoeuvre.ABORT)
    assert f"its time is {told}" in str(age_objection(order, 1000.0))
    assert f"its time is {told}, not 1 to" in str(time_objection(order, 1000.0))


@pytest.mark.parametrize(
    ("before", "end"),
    [
        # A quarter of the circle is 157 m.
        (along(-500, 157), (157.1, 0.0, True)),
        # Who begins midway: 550 m, 628 m round to 0, and a quarter from there.
        ([(run, 0.0, True) for run in (550.0, 627.0, 1.0, 157.0)], (159.0, 0.0, True)),
        # Who sees the leader handed back first goes on to the end.
        (along(0, 150), (158.0, 0.0, False)),
        # A leg that touches the circle is no end, nor a leader far beside it, or one that loiters there
        # before the start, nor a place that is not known.
        ([*along(0, 100), *along(-300, -299)] * 3, None),
        (along(0, 300, off=31.0), None),
        (along(0, 300, steered=False), None),
        ([(math.nan, 0.0, True), (10.0, math.nan, True)], None),
    ],
)
def test_a_route_ends_after_a_quarter_of_the_circle(before, end):
    path, ends = route(), RouteEnd()

    def passed(run: float, off: float, steered: bool) -> bool:
        point = PathPoint(0.0, off, 0.01, path.last_circle + run)
        return ends.passed(path, point, steered=steered)

    assert not any(passed(*one) for one in before)
    assert end is None or passed(*end)


def test_a_path_that_does_not_hand_back_has_no_end():
    assert route("loiter").last_circle is None
    point = PathPoint(0.0, 0.0, 0.01, 1500.0)
    assert not RouteEnd().passed(route("loiter"), point, steered=True)


@pytest.mark.parametrize("duration_s", [300, 40])
def test_check_says_when_a_rehearsal_outlasts_its_route(duration_s):
    corners = [{"north_m": 0, "east_m": 0}, {"north_m": 1000, "east_m": 0}]
    path = {"type": "waypoints", "waypoints": corners, "end": "hand-back"}
    path |= {"radius_m": 200, "easement_m": 0}
    content = content_of("line-calm") | {"path": path}
    content["rehearsal"]["duration_s"] = duration_s
    # To where the last leg touches the circle and a quarter round it, 20 m/s.
    found = [*hand_back_at_the_end(Mission.model_validate(content))]
    assert [one.severity for one in found] == ["warning"] * (duration_s == 300)
    assert all("hands all vehicles back after about" in one.message for one in found)


CIRCLE = HoldCircle(latitude_deg=47.3988, longitude_deg=8.545594, radius_m=200.0)


def fenced(vehicle: str = "f1") -> FlightPlan:
    """Plan of a mission with a fence 150 m above the origin."""
    return replace(plan_of(vehicle=vehicle), ceiling=150.0, paths={})


def held() -> Arrangement:
    """A hold in which f1, f2 and f3 are stacked by 15 m each."""
    stack = enumerate(SLOTS.items(), 1)
    places = moves({name: replace(slot, up=15.0 * rank) for rank, (name, slot) in stack})
    return order_of(*places, across_s=40.0, flown=Manoeuvre.HOLD, circle=CIRCLE)


@pytest.mark.parametrize(("leader_height", "flown"), [(100.0, True), (130.0, False)])
def test_a_hold_whose_stacked_heights_would_leave_the_fence_is_flown_by_nobody(
    leader_height, flown
):
    formation = Formation(fenced)
    for member in formation.members.values():
        # It climbs at 0.5 m/s, and has 5 s for it until the hold, in which that comes to rest 0.6 m higher.
        member.leader_height = lambda ahead_s: leader_height - 2.5 + 0.5 * ahead_s
    formation.run(5.0)
    formation.give(held(), until_s=40.0)
    assert formation.flown == dict.fromkeys(NAMES, int(flown))
    said = formation.said
    refused = {name: reply.text for name, reply in said if reply.verdict is Verdict.REFUSED}
    # The leader itself stays where it is; 130 m and 15 m are below the fence, 30 and 45 m more are not.
    assert set(refused) == (set() if flown else {"f2", "f3"})
    if not flown:
        assert refused["f2"] == "f2 would fly 161 m above the origin, and the fence ends at 150 m"


def test_a_layer_above_the_fence_is_refused_and_a_lower_slot_is_not():
    one, here = fenced(), Point(-20.0, -20.0, 5.0)
    crosses = SlotMove(vehicle="f1", begin=here, end=here, layer=24.0)
    order = order_of(crosses, climb_s=20.0)
    text = ceiling_objection(order, crosses, one, 140.0, 150.0)
    assert text == "f1 would fly 164 m above the origin, and the fence ends at 150 m"
    # One that is above it already is not kept from going down.
    lower = SlotMove(vehicle="f1", begin=here, end=replace(here, up=-5.0))
    assert ceiling_objection(order, lower, one, 160.0, 150.0) is None


@pytest.mark.parametrize(
    ("end_m", "refusal"),
    [(12.0, None), (2.0, "f1 would fly 17 m above the origin, less than 20 m")],
)
def test_a_slot_above_a_low_leader_is_as_high_as_it_is(end_m, refusal):
    # The leader at 15 m, the slot 10 m above it: 25 m, and the least height is 20 m.
    one, begin = replace(plan_of(vehicle="f1"), up=10.0), Point(-20.0, -20.0, 10.0)
    move = SlotMove(vehicle="f1", begin=begin, end=replace(begin, up=end_m))
    assert slot_objection(order_of(move), move, one, begin, 15.0) == refusal


def test_a_path_whose_fence_the_leader_is_above_is_refused():
    one = plan_of(vehicle="leader")
    survey = replace(one.paths["main"], ceiling=120.0)
    leader, order = replace(one, paths={**one.paths, "survey": survey}), order_of(path="survey")
    text = ceiling_objection(order, None, leader, 200.0, one.ceiling)
    assert text == "leader would fly 200 m above the origin, and the fence ends at 120 m"
    assert ceiling_objection(order, None, leader, 110.0, one.ceiling) is None


@pytest.mark.parametrize(
    ("leader_height", "limits", "said"),
    [
        # Half of the 4 m/s that all of the mission climb by, and of the 3 m/s that they descend by.
        (100.0, {"climb_max": 1.9}, ("climb at 2.0 m/s", "1.9 m/s")),
        (100.0, {"climb_max": 2.0, "sink_max": 1.0}, None),
        (220.0, {"sink_max": 1.0}, ("sink at 1.5 m/s", "1 m/s")),
        (160.0, {"climb_max": 1.0, "sink_max": 1.0}, None),
    ],
)
def test_a_path_at_another_height_is_refused_by_who_cannot_climb_there_with_the_others(
    leader_height, limits, said
):
    one = plan_of(vehicle="f1")
    # The mission flies at 100 m: this path at 160 m.
    high = replace(one.paths["main"], heights=(60.0, 60.0))
    paths = {**one.paths, "high": high}
    f1 = replace(one, paths=paths, airframe=replace(one.airframe, **limits))
    order = order_of(path="high")
    text = climb_objection(order, f1, leader_height, "main")
    assert text == (
        said and "f1 would have to {} to the height of 'high', and its limit is {}".format(*said)
    )
    assert climb_objection(order, f1, leader_height, "high") is None


def test_the_guard_asks_for_no_height_above_the_fence():
    guard = SetpointGuard(plan_of(vehicle="f1"))
    assert guard.height(180.0, 150.0) == (150.0, None)
    assert guard.counters["height above the fence"] == 1
    assert guard.height(140.0, 150.0) == (140.0, None)
    # Ground counts more than a fence that leaves no room above it.
    assert guard.height(180.0, 10.0) == (20.0, None)


def climbing(**fields: object) -> Mission:
    """A helix on which four aircraft climb from 100 m to 435 m."""
    content: dict[str, Any] = content_of("climb-and-turn")
    content["path"] = {**content["path"], "end_height_m": 335.0}
    return Mission.model_validate({**content, **fields})


def test_plans_know_the_fence_of_each_path():
    wait = {"type": "circle", "centre": {}, "radius_m": 200.0, "direction": "clockwise"}
    mission = climbing(fence={"max_height_m": 450}, paths={"wait": wait})
    one = flight_plan(mission, "f1")
    assert (one.ceiling, one.ceiling_along("wait")) == (450.0, 450.0)
    assert flight_plan(climbing(), "f1").ceiling == float("inf")


def test_a_vehicle_whose_slot_is_above_the_fence_stays_below_it():
    # The slot of f1 is 5 m above a leader at 100 m and climbing; the fence ends at 110 m.
    start = {"leader": {"north_m": 0, "east_m": 0}}
    mission = climbing(fence={"max_height_m": 110}, rehearsal={"rate_hz": 10.0, "start": start})
    aircraft = [Aircraft(mission, name) for name in ("leader", "f1")]
    mail = list[Mail]()
    for step in range(250):
        mail = step_all(aircraft, step / 10.0, mail)
    heights = [one.recorder.record().altitude_amsl_m - 488.0 for one in aircraft]
    # Climbing at 3 m/s until then, the height loop goes beyond by less than half a metre.
    assert max(height.max() for height in heights) < 110.5
    assert heights[1][-1] == pytest.approx(110.0, abs=0.3)


def with_paths(**options: str) -> FlightPlan:
    """Plan of a mission that has another path, and two who may lead."""
    circle = CirclePath(north=0.0, east=0.0, radius=300.0, direction=1)
    other = KnownPath(circle, PathGains(gain=0.03, approach_angle=math.pi / 2.0))
    task = plan_of(vehicle="f3").task
    assert isinstance(task, FollowerTask)
    lead = LeadPlan(order=("leader", "f1"), task=task, altitude_amsl=588.0)
    one = plan_of(**options)
    return replace(one, paths={**one.paths, "survey": other}, lead=lead)


def with_another(path: str, vehicle: str) -> FlightPlan:
    """Plan of a mission in which this path is another curve."""
    one = with_paths(vehicle=vehicle)
    return replace(one, paths={**one.paths, path: replace(one.paths[path], check=7)})


SURVEY = replace(further(SLOTS), path="survey", turn_radius_m=125.0)
F1_LEADS = replace(further(SLOTS), lead="f1")
ANOTHER = "its mission file means another curve by"


def test_another_path_is_known_from_the_agreed_time_on_and_its_field_is_as_gentle_as_the_turns():
    formation = ordered(SURVEY, until_s=9.9, plan=with_paths)
    assert [one.flight.route for one in formation.members.values()] == [None] * len(NAMES)
    formation.run(10.05)
    routes = [one.flight.route for one in formation.members.values()]
    assert all(one is not None and one.least_radius == pytest.approx(125.0) for one in routes)
    # 1 / 125 m is less than the path's own 0.03 1/m.
    assert {one.gains.gain for one in routes if one is not None} == {0.008}


@pytest.mark.parametrize(
    ("name", "plan", "order", "refusal"),
    [
        ("f2", plan_of(vehicle="f2"), SURVEY, "no path is called 'survey' in its mission"),
        ("f2", with_another("survey", "f2"), SURVEY, f"{ANOTHER} 'survey'"),
        ("f1", with_another("main", "f1"), replace(F1_LEADS, path_check=8), f"{ANOTHER} 'main'"),
    ],
)
def test_nobody_flies_or_leads_along_a_path_that_one_does_not_know_or_knows_as_another_curve(
    name, plan, order, refusal
):
    formation = Formation(with_paths)
    formation.members[name] = Arrangements(plan, SAME_CLOCK, formation.alerts)
    formation.run(5.0)
    formation.give(order, until_s=60.0)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    refused = {reply.text for said_by, reply in formation.said if said_by == name}
    assert f"{refusal}: give all the same mission" in refused


def test_a_companion_that_missed_the_order_and_means_another_curve_by_its_path_does_not_steer():
    formation = ordered(SURVEY, until_s=11.0, plan=with_paths)
    other = with_another("survey", "f2")
    formation.members["f2"] = Arrangements(other, SAME_CLOCK, formation.alerts)
    formation.run(30.0)
    assert formation.flown["f2"] == 0
    assert formation.members["f2"].obstacle(formation.now) is not None
    assert len([text for text in formation.words if "another curve" in text]) == 1


def test_who_is_to_lead_leads_for_a_moment_after_the_agreed_time_only():
    formation = ordered(F1_LEADS, until_s=10.1, plan=with_paths)
    assert [name for name, one in formation.members.items() if one.leads_by_order(10.1)] == ["f1"]
    assert not formation.members["f1"].leads_by_order(12.0)


def test_another_copy_of_the_order_at_its_very_time_does_not_keep_anybody_from_leading_by_it():
    formation = ordered(F1_LEADS, until_s=9.95, plan=with_paths)
    # The operator repeats it until all fly it; f1 gets that before its own next step.
    formation.now = 10.0
    formation.give(F1_LEADS)
    assert formation.flown["f1"] == 1
    assert formation.members["f1"].leads_by_order(10.0)


def test_a_companion_that_hears_of_the_order_later_does_not_lead_by_it():
    formation = ordered(F1_LEADS, until_s=11.0, plan=with_paths)
    formation.start("f1")
    while formation.flown["f1"] == 0:
        formation.run(formation.now + 0.1)
        assert formation.now < 30.0
        assert not formation.members["f1"].leads_by_order(formation.now)


@pytest.mark.parametrize(
    ("name", "silent", "refusal"),
    [
        ("f1", {"f1"}, "f1 is to lead, and is not heard"),
        ("f2", set(), "f2 is neither leader nor deputy of its mission"),
    ],
)
def test_nobody_is_ordered_to_lead_who_is_not_heard_or_no_deputy(name, silent, refusal):
    formation = begun(plan=with_paths)
    formation.silent |= silent
    formation.run(12.0)
    formation.give(replace(further(SLOTS), time_s=20.0, lead=name), until_s=60.0)
    assert {formation.flown[one] for one in NAMES if one not in silent} == {0}
    assert refusal in {reply.text for _, reply in formation.said}
