"""What is known about a mission before take-off, against numbers worked out by hand.

How strong a field of a law may be, how fast a loop may run, how old a leader's state may be.
"""

import math

import numpy as np
import pytest

from tests.kit.missions import line_of, loaded, replaced, text_of
from vfguide.guidance.formation import Slot, field_slope
from vfguide.laws.field import course_field_turn_rate, error_for_correction
from vfguide.mission import Finding, Mission, MissionError, check_mission
from vfguide.mission.feasibility import effective_layer, least_guarantee, mean_leader_age
from vfguide.mission.finding import no_more_than
from vfguide.mission.flight_limits import bank_for, conditions_of, giving_way, wind_samples
from vfguide.mission.rehearsal import ArticleWind

GAINS = "type: slot, k_x: 0.25, k_y: 0.25, integral_s: 1.2, epsilon: 0.01"


def mission(name: str, *changes: tuple[str, str]) -> Mission:
    return loaded(text_of(name, *changes, controller=GAINS)).mission


def findings_of(name: str, field: str, *changes: tuple[str, str]) -> list[Finding]:
    return [one for one in check_mission(mission(name, *changes)) if one.field == field]


def found(name: str, *changes: tuple[str, str]) -> list[str]:
    """Severity and field of everything but notes."""
    findings = check_mission(mission(name, *changes))
    return [f"{one.severity} {one.field}" for one in findings if one.severity != "note"]


def warning_of(name: str, *changes: tuple[str, str]) -> Finding:
    """The only warning."""
    findings = check_mission(mission(name, *changes))
    (warning,) = (one for one in findings if one.severity == "warning")
    return warning


def test_the_wind_of_the_article_blows_between_two_and_eight_metres_a_second():
    speed = np.hypot(*wind_samples(ArticleWind(type="article")))
    assert speed.max() == pytest.approx(8.0)
    assert speed.min() == pytest.approx(2.0, abs=0.01)


def test_an_inner_slot_flies_slower_an_outer_one_faster_and_ground_speed_follows_the_wind():
    circle = mission("circle-calm")
    conditions = conditions_of(circle.path, circle.wind)
    # 20 m/s on 150 m: 0.1333 rad/s; 30 m right (inside): 20 - 4, 30 m left: 20 + 4
    assert conditions.slot_airspeed(20.0, Slot(forward=0.0, right=30.0)) == pytest.approx(16.0)
    assert conditions.slot_airspeed(20.0, Slot(forward=0.0, right=-30.0)) == pytest.approx(24.0)
    line = mission("line-calm", ("type: calm", "type: steady, speed_m_s: 5, toward_deg: 45"))
    assert conditions_of(line.path, line.wind).ground_speed(20.0) == pytest.approx(25.0)


def test_a_slot_too_far_inside_makes_the_leader_give_way():
    # 75 m inside and 20 m behind on 150 m: hypot(1/2, 2/15) of the leader's speed, 12 m/s from 23.2 on
    warning = warning_of("circle-calm", ("right_m: 20,", "right_m: 75,"))
    assert warning.field == "followers[1].slot"
    assert "the leader gives way by up to 3.5 m/s faster" in warning.message


ABREAST = "right_m: 0, up_m: 0"
SOFT = [f"warning controller.{gain}" for gain in ("kappa", "k_y", "k_x")]


@pytest.mark.parametrize(
    ("name", "old", "new", "findings"),
    [
        # 120 m inside: a fifth of the leader's speed, 6.4 m/s at most; 150 m is the centre.
        ("circle-calm", "right_m: 20,", "right_m: 120,", ["error followers[1].slot"]),
        ("circle-calm", "right_m: 20,", "right_m: 150,", ["error followers[1].slot.right_m"]),
        # Of a wind as fast as the leader nothing else is said about its track.
        ("circle-calm", "type: calm", "type: steady, speed_m_s: 20, toward_deg: 0", ["error wind"]),
        ("line-calm", ABREAST, "right_m: 0, up_m: -100", ["error followers[2].slot.up_m"]),
        # A slow loop makes the formation soft.
        ("line-calm", "rate_hz: 20", "rate_hz: 4", SOFT),
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
    changes = [(f"right_m: {side}20,", f"right_m: {side}75,") for side in ("", "-")]
    assert "error followers" in found("circle-calm", *changes)


def test_a_circle_tighter_than_the_bank_allows_is_an_error():
    # 20 m/s on 40 m: 10 m/s², a bank of 45.6 degrees; the outer slot needs more
    tight = ("radius_m: 150", "radius_m: 40")
    findings = found("circle-calm", tight, ("right_m: 20,", "right_m: 15,"))
    assert {"error path", "error followers[0].slot"} <= set(findings)
    assert math.degrees(bank_for(20.0, 0.5)) == pytest.approx(45.56, abs=0.01)


@pytest.mark.parametrize(
    ("name", "gain", "strong", "turns", "most"),
    [
        # g / 20 m/s = 0.490 rad/s; 0.385 * 20 * k stays below for k <= 0.06369
        ("line-calm", "0.03", "0.1", "0.77", "0.0636"),
        # 0.3849 . 0.05 . 20 = 0.3849 rad/s is less than g/20 = 0.4903, with 20/150 = 0.1333 it is 0.5182;
        # (0.4903 - 0.1333)/(0.3849 . 20) = 0.04637
        ("circle-calm", "0.015", "0.05", "0.52", "0.0463"),
    ],
)
def test_a_field_that_outturns_the_leader_is_a_warning_with_a_gain_that_does_not(
    name, gain, strong, turns, most
):
    (warning,) = findings_of(name, "path.gain", (f"gain: {gain}", f"gain: {strong}"))
    assert warning.severity == "warning"
    assert f"turns at up to {turns} rad/s at 20.0 m/s over ground" in warning.message
    assert warning.remedy == f"lower gain to {most} 1/m or less"
    assert findings_of(name, "path.gain", (f"gain: {gain}", f"gain: {most}")) == []


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


def test_a_finding_names_file_line_severity_field_and_remedy_in_one_line_and_errors_come_first():
    text = text_of("line-calm", ("gain: 0.03", "gain: 0.1"))
    line, one = line_of("gain: 0.1", text), loaded(text)
    warning, *notes = check_mission(one.mission, one.source)
    assert str(warning).startswith(f"m.yaml:{line}: warning: path.gain: joining the path")
    assert warning.as_json()["line"] == line
    assert [one.severity for one in notes] == ["note", "note"]
    change = (ABREAST, "right_m: 0, up_m: -100")
    findings = check_mission(mission("line-calm", change, ("gain: 0.03", "gain: 0.1")))
    assert [one.severity for one in findings] == ["error", "warning", "note", "note"]


def test_how_near_a_vehicle_that_leaves_its_slot_could_come_is_said():
    narrower = ("{forward_m: 0, right_m: 40, up_m: 0}", "{forward_m: 0, right_m: 20, up_m: 0}")
    notes = findings_of("transit-abreast", "followers", narrower)
    assert [one.severity for one in notes if "leave its place" in one.message] == ["note"]


@pytest.mark.parametrize(("up_m", "least_m"), [(10.0, 10.0), (-40.0, 24.0)])
def test_slots_above_each_other_are_as_far_apart_as_their_heights(up_m, least_m):
    """24 m are what those keep from each other that fly at one height."""
    flown = mission("circle-calm")
    first, second, *others = flown.model_dump(exclude_unset=True)["followers"]
    assert first["vehicle"] != second["vehicle"]
    second["slot"] = {**first["slot"], "up_m": first["slot"].get("up_m", 0.0) + up_m}
    least = least_guarantee(replaced(flown, followers=[first, second, *others]))
    assert least[0] == pytest.approx(least_m, abs=0.6)


def test_a_loss_after_the_end_of_the_rehearsal_is_a_warning():
    late = ("duration_s: 240", "duration_s: 60")
    assert "warning rehearsal.losses[0]" in found("leader-lost", late)
    assert "warning rehearsal.losses[0]" not in found("leader-lost")


@pytest.mark.parametrize(
    ("name", "pull", "most"),
    [
        # (pi/4) (2/pi) 5 = 2.5 rad/m at 20 m/s and 8 m/s of wind; 5.7143 = 3/0.525 of it: 5 . 5.7143/70
        ("k_y", "70.0", "0.408"),
        # 8 (2/pi) 5 = 25.46479 1/s; 5 . 5.71429/25.46479 = 1.121997
        ("k_x", "25.5", "1.12"),
    ],
)
def test_a_field_that_pulls_faster_than_the_law_follows_is_a_warning_with_a_gain_that_does_not(
    name, pull, most
):
    text = text_of("circle-wind", (f"{name}: 0.25", f"{name}: 5"), controller=GAINS)
    read = loaded(text)
    found = check_mission(read.mission, read.source)
    (warning,) = [one for one in found if one.severity == "warning"]
    assert warning.field == f"controller.{name}"
    assert warning.line == line_of(f"{name}: 5", text)
    assert f"pulls at {pull} 1/s, faster than the 5.7 1/s" in warning.message
    assert warning.remedy == f"lower {name} to {most} 1/m or less"


@pytest.mark.parametrize(
    ("name", "gain", "warns"),
    [("k_y", 0.408, False), ("k_y", 0.409, True), ("k_x", 1.12, False), ("k_x", 1.13, True)],
)
def test_the_gain_that_the_remedy_names_is_the_greatest_that_will_do(name, gain, warns):
    found = findings_of("circle-wind", f"controller.{name}", (f"{name}: 0.25", f"{name}: {gain}"))
    assert ("warning" in [one.severity for one in found]) is warns


def test_a_gain_that_a_remedy_names_is_never_zero():
    # 9.80665/20 . tan 15.3 degrees - 20/150 = 0.00080646 rad/s; 0.00080646/(0.3849 . 20) = 0.00010476
    flat = ("max_bank_deg: 45", "max_bank_deg: 15.3")
    (warning,) = findings_of("circle-calm", "path.gain", flat)
    assert warning.remedy == "lower gain to 0.000104 1/m or less"
    assert not findings_of("circle-calm", "path.gain", flat, ("gain: 0.015", "gain: 0.000104"))


@pytest.mark.parametrize(
    ("value", "text"), [(0.9996, "0.999"), (1234.9, "1230"), (0.25, "0.25"), (3.2e-5, "3.2e-05")]
)
def test_a_limit_is_rounded_down_to_three_digits(value, text):
    assert no_more_than(value) == text


def test_a_slow_loop_follows_only_gentle_fields():
    # at 4 Hz the layer is 2.625 and the law follows at 1.1429 1/s: 0.11429 . 20 . 0.5 and 0.2244 . 8 . 2/pi
    findings = check_mission(mission("line-calm", ("rate_hz: 20", "rate_hz: 4")))
    remedies = {one.field: one.remedy for one in findings if one.severity == "warning"}
    assert remedies["controller.k_y"] == "lower k_y to 0.114 1/m or less"
    assert remedies["controller.k_x"] == "lower k_x to 0.224 1/m or less"


def test_a_fast_loop_is_judged_by_the_layer_that_it_keeps():
    # at 50 Hz still 5.7 1/s, less than 0.5 . 20 . 0.6: not the 14.3 1/s of a layer that were thinner
    change = (("rate_hz: 20", "rate_hz: 50"), ("k_y: 0.25", "k_y: 0.6"))
    (warning, _) = findings_of("line-calm", "controller.k_y", *change)
    assert "faster than the 5.7 1/s" in warning.message


def test_a_course_field_turns_as_fast_as_a_lines_or_at_half_of_that():
    # a quarter turn: 2/(3 sqrt 3) = 0.3849 k V
    found = course_field_turn_rate(0.03, 20.0, math.pi / 2.0)
    assert found == pytest.approx(0.3849001795 * 0.03 * 20.0, rel=1e-4)
    # an eighth: c (2/pi) = 1/2: sin(t/2) cos² t with s = sin(t/2) is s (1 - 2 s²)², greatest where
    # 10 s² = 1, sqrt(0.1) . 0.64 = 0.202386; 0.5 . 0.2 . 20 . 0.202386
    found = course_field_turn_rate(0.2, 20.0, math.pi / 4.0)
    assert found == pytest.approx(0.4047715, rel=1e-4)
    # on its slot its slope is (2/pi) . 8 . 0.2
    assert field_slope(0.2, 8.0) == pytest.approx(1.0185916)


@pytest.mark.parametrize(
    ("name", "k_y", "words"),
    [
        # g/20 = 0.4903 rad/s on the line, k_y . 2.02386 of the field: up to k_y = 0.2423
        ("line-calm", 0.242, None),
        ("line-calm", 0.243, "at up to 0.492 rad/s at 20.0 m/s over ground; its bank gives 0.490,"),
        # The outer slot: hypot(20 + 0.1333 . 20, 0.1333 . 20) = 22.82 m/s, where the bank gives 0.4297 rad/s.
        # 0.5 . 0.15 . 22.82 . 0.202386 = 0.3464 is less, with the circle's own 0.1333 it is 0.4797.
        ("circle-calm", 0.12, None),
        (
            "circle-calm",
            0.15,
            "at up to 0.48 rad/s at 22.8 m/s over ground; its bank gives 0.43, so",
        ),
    ],
)
def test_a_followers_field_that_outturns_its_bank_is_noted(name, k_y, words):
    found = findings_of(name, "controller.k_y", ("k_y: 0.25", f"k_y: {k_y}"))
    assert [one.severity for one in found] == ["note"] * bool(words)
    for note in found:
        assert note.message.startswith(f"joining its slot, 'f1' is asked to turn {words}")


def test_a_leader_whose_bank_is_small_says_nothing_about_the_followers_field():
    # 25 degrees: 0.229 rad/s, enough for its own field but not for one of k_y 0.2
    leader = "leader: {system_id: 1, alpha_1_s: 1.2, beta_1_s: 0.8, airspeed_range_m_s: [12, 32], "
    change = (f"{leader}max_bank_deg: 45", f"{leader}max_bank_deg: 25")
    assert findings_of("line-calm", "controller.k_y", change, ("k_y: 0.25", "k_y: 0.2")) == []


@pytest.mark.parametrize(
    ("learns_s", "severity", "words"),
    [
        # the law answers in 0.525/3 = 0.175 s
        ("0.17", "error", "swing ever wider"),
        # the wind takes the leader to 0.187 rad/s: 0.175 (1 + 2 . 0.956 . 0.187 . 0.18) = 0.186 s
        ("0.18", "error", "swing ever wider"),
        # 8 (2/pi) 0.25 = 1.27324 1/s; sqrt(1.27324 . 0.7)/2 = 0.47
        ("0.7", "warning", "a damping of 0.47"),
    ],
)
def test_an_integral_that_learns_faster_than_the_field_moves_is_found(learns_s, severity, words):
    change = ("integral_s: 1.2", f"integral_s: {learns_s}")
    (found,) = findings_of("circle-wind", "controller.integral_s", change)
    assert found.severity == severity
    assert words in found.message
    # 1/1.27324 = 0.7854 s has a damping of one half
    assert found.remedy == "set it to 0.8 s or more, or to 0"


@pytest.mark.parametrize(
    "changes",
    [
        [("integral_s: 1.2", "integral_s: 0.8")],
        [("integral_s: 1.2", "integral_s: 0")],
        # One that the law does not use.
        [("integral_s: 1.2", "integral_s: 0.1"), ("type: slot", "type: pid")],
    ],
)
def test_the_integral_of_the_remedy_and_none_at_all_are_no_findings(changes):
    assert not findings_of("circle-wind", "controller.integral_s", *changes)


def about_the_link(*changes: tuple[str, str]) -> list[Finding]:
    return findings_of("line-calm", "rehearsal.link_delay_s", *changes)


@pytest.mark.parametrize(
    ("rate_hz", "fault"),
    [
        *(("2.0", None), ("20.0", None), ("100.0", None)),
        ("1.99", "1.99 is too small; choose 2 or more"),
        ("0", "0 is too small; choose 2 or more"),
        ("100.1", "100.1 is too large; choose 100 or less"),
    ],
)
def test_a_loop_runs_at_two_to_a_hundred_hertz(rate_hz, fault):
    change = ("rate_hz: 20", f"rate_hz: {rate_hz}")
    if fault is None:
        assert mission("line-calm", change).rehearsal.rate_hz == float(rate_hz)
    else:
        with pytest.raises(MissionError, match=f"rehearsal.rate_hz: {fault}"):
            mission("line-calm", change)


@pytest.mark.parametrize("jitter_s", [0.0, 0.05, 0.1])
def test_jitter_goes_either_way_and_makes_no_state_older_on_average(jitter_s):
    jittery = mission("line-calm", ("rate_hz: 20", f"rate_hz: 20\n  link_jitter_s: {jitter_s}"))
    assert mean_leader_age(jittery) == pytest.approx(0.1)


def test_a_link_older_than_the_patience_with_it_is_an_error():
    (error,) = about_the_link(("link_delay_s: 0.1", "link_delay_s: 0.7"))
    assert error.severity == "error"
    assert "leader states are 0.7 s old on average" in error.message
    assert "patience.leader_s, 0.6 s, and none joins" in error.message
    assert error.remedy == "a link below 0.6 s, or a longer patience.leader_s"
    # Losses age it as well: 0.1 s and 0.05 . 0.92/0.08 = 0.575 s, or 0.05 . 0.9/0.1 = 0.45 s
    (error,) = about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.92"))
    assert error.severity == "error"
    assert about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.9")) == []


@pytest.mark.parametrize(("delay_s", "severities"), [(0.59, []), (1.5, ["warning"])])
def test_a_link_within_patience_is_no_error(delay_s, severities):
    patience = ("wind: {", "patience: {leader_s: 2}\nwind: {") if delay_s > 1.0 else ("", "")
    found = about_the_link(("link_delay_s: 0.1", f"link_delay_s: {delay_s}"), patience)
    assert [one.severity for one in found] == severities


@pytest.mark.parametrize(("period", "layer"), [(0.01, 0.525), (0.05, 0.525), (0.1, 1.05)])
def test_the_layer_before_take_off_is_the_one_in_flight(period, layer):
    # 3 1/s * 0.05 s / 0.525 = 1 / 3.5 boundary layers in a step.
    assert effective_layer(mission("line-calm").controller, period) == pytest.approx(layer)
