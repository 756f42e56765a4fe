"""Orders to follow another path, and to lead: all know the same curve, and whom they follow."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.missions import plan_of
from tests.kit.orders import NAMES, SLOTS, Formation, begun, further, ordered
from vfguide.companion.arrangements import Arrangements
from vfguide.companion.plan import FlightPlan, FollowerTask, KnownPath, LeadPlan
from vfguide.companion.timing import SAME_CLOCK
from vfguide.guidance.settings import PathGains
from vfguide.paths.circle import Circle as CirclePath


def with_paths(**options: str) -> FlightPlan:
    """Plan of a mission that has another path, and two who may lead."""
    other = KnownPath(
        CirclePath(north=0.0, east=0.0, radius=300.0, direction=1),
        PathGains(gain=0.03, approach_angle=math.pi / 2.0),
    )
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
        (
            "f2",
            with_another("survey", "f2"),
            SURVEY,
            "its mission file means another curve by 'survey'",
        ),
        (
            "f1",
            with_another("main", "f1"),
            replace(further(SLOTS), lead="f1", path_check=8),
            "its mission file means another curve by 'main'",
        ),
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
    formation = ordered(replace(further(SLOTS), lead="f1"), until_s=10.1, plan=with_paths)
    assert [name for name, one in formation.members.items() if one.leads_by_order(10.1)] == ["f1"]
    assert not formation.members["f1"].leads_by_order(12.0)


def test_another_copy_of_the_order_at_its_very_time_does_not_keep_anybody_from_leading_by_it():
    formation = begun(plan=with_paths)
    order = replace(further(SLOTS), lead="f1")
    formation.give(order, until_s=9.95)
    # The operator repeats it until all fly it; f1 gets that before its own next step.
    formation.now = 10.0
    formation.give(order)
    assert formation.flown["f1"] == 1
    assert formation.members["f1"].leads_by_order(10.0)


def test_a_companion_that_hears_of_the_order_later_does_not_lead_by_it():
    formation = ordered(replace(further(SLOTS), lead="f1"), until_s=11.0, plan=with_paths)
    formation.start("f1")
    while formation.flown["f1"] == 0:
        formation.run(formation.now + 0.1)
        assert formation.now < 30.0
        assert not formation.members["f1"].leads_by_order(formation.now)


def test_nobody_is_ordered_to_lead_who_is_not_heard():
    formation = begun(plan=with_paths)
    formation.silent.add("f1")
    formation.run(12.0)
    formation.give(replace(further(SLOTS), time_s=20.0, lead="f1"), until_s=60.0)
    assert {formation.flown[name] for name in NAMES if name != "f1"} == {0}
    assert "f1 is to lead, and is not heard" in {reply.text for _, reply in formation.said}


def test_nobody_leads_by_an_order_who_is_no_deputy():
    formation = ordered(replace(further(SLOTS), lead="f2"), until_s=60.0, plan=with_paths)
    assert formation.flown == dict.fromkeys(NAMES, 0)
    assert "f2 is neither leader nor deputy of its mission" in {
        reply.text for _, reply in formation.said
    }
