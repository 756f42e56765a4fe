"""Gains of a mission that an aircraft does not bear: what is flown in their place, and who hears it."""

import math

import pytest
from msgspec.structs import replace

from tests.kit.flight import fly
from tests.kit.missions import shipped
from vfguide.commands.check import lowered_in
from vfguide.commands.overrides import Overrides, apply_overrides, parse_settings
from vfguide.companion.lowered_gains import lowered_gains
from vfguide.companion.mission_plan import flight_plan
from vfguide.companion.plan import bandwidth_for, follower_law
from vfguide.guidance.bandwidth import AS_DECLARED, UNKNOWN
from vfguide.mission import Mission

SETTINGS = [
    "controller.k_y=0.2",
    "controller.k_x=0.01",
    "vehicles.defaults.course_dead_time_s=0.5",
    "vehicles.defaults.alpha_1_s=0.5",
    "vehicles.defaults.beta_1_s=0.5",
]


def mission_with(*settings: str, controller: str | None = None) -> Mission:
    given = Overrides(controller=controller, settings=parse_settings([*SETTINGS, *settings]))
    return apply_overrides(shipped("line-calm"), given)


def test_what_is_flown_in_the_place_of_a_gain_is_said_with_both_numbers():
    plan = flight_plan(mission_with("controller.integral_s=0"), "f1")
    (k_y,) = lowered_gains(plan)
    # Half of what the course loop bears, over (2/pi) chi_inf V.
    slope = 2.0 / math.pi * math.radians(plan.gains.chi_inf_deg) * plan.airframe.cruise
    assert k_y.flown == pytest.approx(bandwidth_for(plan).course_field / slope)
    assert k_y.sentence() == (
        f"k_y 0.2 is more than this aircraft bears ({k_y.flown:.2g}): {k_y.flown:.2g} is flown"
    )


def test_the_gain_of_the_path_is_one_too():
    plan = flight_plan(mission_with("path.gain=0.5"), "leader")
    assert [one.name for one in lowered_gains(plan)] == ["path.gain"]


def test_defaults_are_nobody_s_choice_and_an_unknown_response_is_waited_for():
    plan = flight_plan(mission_with(), "f1")
    assert lowered_gains(plan)
    unwritten = replace(plan, gains=type(plan.gains)())
    assert lowered_gains(unwritten) == []
    unknown = replace(plan, certainty=replace(AS_DECLARED, course=UNKNOWN))
    assert lowered_gains(unknown) == []


def test_check_says_which_vehicles_do_not_bear_it():
    (found,) = lowered_in(mission_with("controller.integral_s=0"))
    assert (found.severity, found.field) == ("note", "controller.k_y")
    assert found.message.startswith("k_y 0.2 is more than f1, f2, f3 bear (")


def test_the_pilot_hears_it_once():
    flight = fly(mission_with("rehearsal.duration_s=12"))
    texts = [event.text for event in flight.events["f1"]]
    assert len([text for text in texts if text.startswith("k_y 0.2 is more than")]) == 1


def test_the_article_s_law_is_flown_as_printed_where_it_is_to_be_exact():
    bounded = flight_plan(mission_with(controller="article"), "f1")
    exact = flight_plan(mission_with(controller="article exact"), "f1")
    assert follower_law(bounded).gains.k_y < 0.2
    law = follower_law(exact)
    assert (law.gains.k_y, law.for_speed().gains.k_x) == (0.2, 0.01)
    assert law.settings == exact.settings
    assert lowered_gains(exact) == []
