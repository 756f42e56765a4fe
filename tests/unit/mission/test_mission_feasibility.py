"""What is known about a mission before take-off, against numbers worked out by hand."""

import math

import numpy as np
import pytest

from tests.kit.missions import line_of, loaded, replaced, text_of
from vfguide.guidance.formation import Slot
from vfguide.laws.field import error_for_correction
from vfguide.mission import Finding, Mission, check_mission
from vfguide.mission.feasibility import (
    effective_layer,
    least_guarantee,
    mean_leader_age,
)
from vfguide.mission.flight_limits import bank_for, conditions_of, giving_way, wind_samples
from vfguide.mission.rehearsal import ArticleWind

GAINS = "type: slot, k_x: 0.25, k_y: 0.25, integral_s: 1.2, epsilon: 0.01"


def mission(name: str, *changes: tuple[str, str]) -> Mission:
    return loaded(text_of(name, *changes, controller=GAINS)).mission


def found(name: str, *changes: tuple[str, str]) -> list[str]:
    """Severity and field of everything but notes."""
    findings = check_mission(mission(name, *changes))
    return [f"{one.severity} {one.field}" for one in findings if one.severity != "note"]


def test_the_wind_of_the_article_blows_between_two_and_eight_metres_a_second():
    speed = np.hypot(*wind_samples(ArticleWind(type="article")))
    assert speed.max() == pytest.approx(8.0)
    assert speed.min() == pytest.approx(2.0, abs=0.01)


def test_an_inner_slot_flies_slower_and_an_outer_one_faster():
    circle = mission("circle-calm")
    conditions = conditions_of(circle.path, circle.wind)
    # 20 m/s on 150 m: 0.1333 rad/s; 30 m right (inside): 20 - 4, 30 m left: 20 + 4
    assert conditions.slot_airspeed(20.0, Slot(forward=0.0, right=30.0)) == pytest.approx(16.0)
    assert conditions.slot_airspeed(20.0, Slot(forward=0.0, right=-30.0)) == pytest.approx(24.0)


def test_ground_speed_on_the_path_follows_the_wind():
    line = mission("line-calm", ("type: calm", "type: steady, speed_m_s: 5, toward_deg: 45"))
    assert conditions_of(line.path, line.wind).ground_speed(20.0) == pytest.approx(25.0)


def test_a_slot_too_far_inside_makes_the_leader_give_way():
    # 75 m inside and 20 m behind on 150 m: hypot(1/2, 2/15) of the leader's speed, 12 m/s from 23.2 on
    findings = check_mission(mission("circle-calm", ("right_m: 20,", "right_m: 75,")))
    (warning,) = [one for one in findings if one.severity == "warning"]
    assert warning.field == "followers[1].slot"
    assert "the leader gives way by up to 3.5 m/s faster" in warning.message


@pytest.mark.parametrize(
    ("name", "old", "new", "findings"),
    [
        # 120 m inside: a fifth of the leader's speed, 6.4 m/s at most; 150 m is the centre.
        ("circle-calm", "right_m: 20,", "right_m: 120,", ["error followers[1].slot"]),
        ("circle-calm", "right_m: 20,", "right_m: 150,", ["error followers[1].slot.right_m"]),
        # Of a wind as fast as the leader nothing else is said about its track.
        ("circle-calm", "type: calm", "type: steady, speed_m_s: 20, toward_deg: 0", ["error wind"]),
        (
            "line-calm",
            "right_m: 0, up_m: 0",
            "right_m: 0, up_m: -100",
            ["error followers[2].slot.up_m"],
        ),
        # A slow loop makes the formation soft.
        (
            "line-calm",
            "rate_hz: 20",
            "rate_hz: 4",
            [f"warning controller.{gain}" for gain in ("kappa", "k_y", "k_x")],
        ),
        ("line-calm", "-80, right_m: 10", "43, right_m: 0", ["warning rehearsal.start.f3"]),
        ("line-calm", "north_m: -21.2", "north_m: -2121", ["warning rehearsal.start.leader"]),
        ("line-calm", "settle_1m_s: 60", "settle_1m_s: 300", ["warning acceptance.settle_1m_s"]),
    ],
)
def test_what_a_mission_asks_too_much_of_is_found_at_its_field(name, old, new, findings):
    assert found(name, (old, new)) == findings


@pytest.mark.parametrize(
    ("fields", "findings"),
    [
        ("boundary_layer_factor: 0.4", ["error controller.boundary_layer_factor"]),
        ("boundary_layer_factor: 1.0", ["warning controller.boundary_layer_factor"]),
        ("boundary_layer_factor: 3.0", []),
        ("boundary_layer_factor: 6.0", ["warning controller.kappa"]),
        # An observer can be too fast for its loop, or adrift.
        ("observer: {gamma: 100, sigma: 1}", ["error controller.observer.sigma"]),
        ("observer: {sigma: 0}", ["warning controller.observer.sigma"]),
    ],
)
def test_boundary_layer_and_observer_must_suit_the_loop(fields, findings):
    source = "leader_speed_source: observer, " if "observer" in fields else ""
    change = ("epsilon: 0.01", f"epsilon: 0.01, {source}{fields}")
    assert found("line-calm", change) == findings


def test_slots_that_exclude_each_other_are_an_error():
    # 75 m inside needs a leader of 24 m/s and more, 75 m outside one of 21.3 m/s and less
    findings = found(
        "circle-calm", ("right_m: 20,", "right_m: 75,"), ("right_m: -20,", "right_m: -75,")
    )
    assert "error followers" in findings


def test_a_circle_tighter_than_the_bank_allows_is_an_error():
    # 20 m/s on 40 m: 10 m/s², a bank of 45.6 degrees; the outer slot needs more
    findings = found(
        "circle-calm", ("radius_m: 150", "radius_m: 40"), ("right_m: 20,", "right_m: 15,")
    )
    assert "error path" in findings
    assert "error followers[0].slot" in findings
    assert math.degrees(bank_for(20.0, 0.5)) == pytest.approx(45.56, abs=0.01)


def test_a_field_that_outturns_the_leader_is_a_warning_with_a_gain_that_does_not():
    findings = check_mission(mission("line-calm", ("gain: 0.03", "gain: 0.1")))
    (warning,) = [one for one in findings if one.severity == "warning"]
    assert warning.field == "path.gain"
    # g / 20 m/s = 0.490 rad/s; 0.385 * 20 * k stays below for k <= 0.06369
    assert warning.remedy == "lower gain to 0.0636 1/m or less"
    assert found("line-calm", ("gain: 0.03", "gain: 0.0636")) == []


def test_the_default_gains_fit_a_loop_of_twenty_hertz():
    controller = mission("line-calm").controller
    # 3 1/s * 0.05 s / 0.525 = 1 / 3.5 boundary layers in a step.
    assert effective_layer(controller, 0.05) == pytest.approx(0.525)


def test_a_turn_on_which_the_articles_field_falls_short_of_the_slots_motion_is_a_warning():
    # 8 m/s at most, where a slot 75 m outside on 150 m is 10 m/s faster than the leader
    article = ("type: slot", "type: article")
    outside = ("right_m: -20,", "right_m: -75,")
    assert "warning controller" in found("circle-calm", article, outside)
    assert "warning controller" not in found("circle-calm", outside)
    assert found("circle-calm", article) == found("line-calm", article) == []


def test_a_correction_beyond_the_reach_of_the_field_has_no_error_that_gives_it():
    errors = error_for_correction(np.array([0.0, 4.0, -4.0, 8.0, 9.0]), 8.0, 0.2)
    assert errors.tolist() == pytest.approx([0.0, 5.0, 5.0, math.inf, math.inf])


def test_an_old_leader_state_without_prediction_is_a_warning():
    change = ("epsilon: 0.01", "epsilon: 0.01, predict_leader: false")
    assert "warning controller.predict_leader" in found("line-calm", change)
    # 0.1 s and, with half of the states lost, one more period of 0.05 s
    lossy = mission("line-calm", ("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.5"))
    assert mean_leader_age(lossy) == pytest.approx(0.15)


def test_giving_way_takes_the_nearest_airspeed_that_suits_everyone():
    flyable = np.array([[True, False], [False, False], [False, True]])
    airspeeds = np.array([[18.0], [20.0], [23.0]])
    assert giving_way(flyable, airspeeds, 20.0) == (2.0, 3.0)


def test_a_finding_names_file_line_severity_field_and_remedy_in_one_line():
    text = text_of("line-calm", ("gain: 0.03", "gain: 0.1"))
    line, one = line_of("gain: 0.1", text), loaded(text)
    warning, *notes = check_mission(one.mission, one.source)
    assert str(warning).startswith(f"m.yaml:{line}: warning: path.gain: joining the path")
    assert warning.as_json()["line"] == line
    assert [one.severity for one in notes] == ["note", "note"]


def test_errors_come_first_in_a_report():
    change = ("right_m: 0, up_m: 0", "right_m: 0, up_m: -100")
    findings = check_mission(mission("line-calm", change, ("gain: 0.03", "gain: 0.1")))
    assert isinstance(findings[0], Finding)
    assert [one.severity for one in findings] == ["error", "warning", "note", "note"]


def test_how_near_a_vehicle_that_leaves_its_slot_could_come_is_said():
    change = ("{forward_m: 0, right_m: 40, up_m: 0}", "{forward_m: 0, right_m: 20, up_m: 0}")
    findings = check_mission(mission("transit-abreast", change))
    (one,) = [finding for finding in findings if "leave its place" in finding.message]
    assert (one.severity, one.field) == ("note", "followers")


@pytest.mark.parametrize(("up_m", "least_m"), [(10.0, 10.0), (-40.0, 24.0)])
def test_slots_above_each_other_are_as_far_apart_as_their_heights(up_m, least_m):
    """24 m are what those keep from each other that fly at one height."""
    flown = mission("circle-calm")
    first, second, *others = flown.model_dump(exclude_unset=True)["followers"]
    assert first["vehicle"] != second["vehicle"]
    second["slot"] = {**first["slot"], "up_m": first["slot"].get("up_m", 0.0) + up_m}
    least = least_guarantee(replaced(flown, followers=[first, second, *others]))
    assert least is not None
    assert least[0] == pytest.approx(least_m, abs=0.6)


def test_a_loss_after_the_end_of_the_rehearsal_is_a_warning():
    late = ("duration_s: 240", "duration_s: 60")
    assert "warning rehearsal.losses[0]" in found("leader-lost", late)
    assert "warning rehearsal.losses[0]" not in found("leader-lost")
