"""How strong a field of a law may be, how fast a loop may run, how old a leader's state may be."""

import math

import pytest

from tests.kit.missions import line_of, loaded
from tests.kit.missions import text_of as changed_text
from vfguide.guidance.formation import field_slope
from vfguide.laws.field import course_field_turn_rate
from vfguide.mission import Finding, Mission, MissionError, check_mission
from vfguide.mission.feasibility import effective_layer, mean_leader_age
from vfguide.mission.finding import no_more_than

GAINS = "type: slot, k_x: 0.25, k_y: 0.25, integral_s: 1.2"


def text_of(name: str, *changes: tuple[str, str]) -> str:
    return changed_text(name, *changes, controller=GAINS)


def findings_of(name: str, field: str, *changes: tuple[str, str]) -> list[Finding]:
    found = check_mission(loaded(text_of(name, *changes)).mission)
    return [one for one in found if one.field == field]


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
    text = text_of("circle-wind", (f"{name}: 0.25", f"{name}: 5"))
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
    slow = ("rate_hz: 20", "rate_hz: 4")
    fields = ("controller.k_y", "controller.k_x")
    remedies = [
        one.remedy
        for field in fields
        for one in findings_of("line-calm", field, slow)
        if one.severity == "warning"
    ]
    assert remedies == ["lower k_y to 0.114 1/m or less", "lower k_x to 0.224 1/m or less"]


def test_a_fast_loop_is_judged_by_the_layer_that_it_keeps():
    # at 50 Hz still 5.7 1/s, less than 0.5 . 20 . 0.6: not the 14.3 1/s of a layer that were thinner
    change = (("rate_hz: 20", "rate_hz: 50"), ("k_y: 0.25", "k_y: 0.6"))
    (warning, _) = findings_of("line-calm", "controller.k_y", *change)
    assert "faster than the 5.7 1/s" in warning.message


def test_the_slope_of_a_field_on_its_slot():
    # (2/pi) . 8 . 0.2
    assert field_slope(0.2, 8.0) == pytest.approx(1.0185916)


def test_for_a_quarter_turn_a_course_field_turns_as_fast_as_a_lines():
    # 2/(3 sqrt 3) = 0.3849 k V
    expected = 0.3849001795 * 0.03 * 20.0
    found = course_field_turn_rate(0.03, 20.0, math.pi / 2.0)
    assert found == pytest.approx(expected, rel=1e-4)


def test_for_an_eighth_of_a_turn_a_course_field_turns_at_half_of_that():
    # c (2/pi) = 1/2: sin(t/2) cos² t with s = sin(t/2) is s (1 - 2 s²)², greatest where 10 s² = 1,
    # sqrt(0.1) . 0.64 = 0.202386; 0.5 . 0.2 . 20 . 0.202386
    found = course_field_turn_rate(0.2, 20.0, math.pi / 4.0)
    assert found == pytest.approx(0.4047715, rel=1e-4)


@pytest.mark.parametrize(
    ("k_y", "notes"),
    [
        # g/20 = 0.4903 rad/s on the line, k_y . 2.02386 of the field: up to k_y = 0.2423
        (0.242, 0),
        (0.243, 1),
    ],
)
def test_a_followers_field_that_outturns_its_bank_is_noted(k_y, notes):
    found = findings_of("line-calm", "controller.k_y", ("k_y: 0.25", f"k_y: {k_y}"))
    assert [one.severity for one in found] == ["note"] * notes


@pytest.mark.parametrize(("k_y", "notes"), [(0.12, 0), (0.15, 1)])
def test_on_a_circle_a_followers_field_has_the_turn_to_fly_as_well(k_y, notes):
    # The outer slot: hypot(20 + 0.1333 . 20, 0.1333 . 20) = 22.82 m/s, where the bank gives 0.4297 rad/s.
    # 0.5 . 0.15 . 22.82 . 0.202386 = 0.3464 is less, with the circle's own 0.1333 it is 0.4797.
    found = findings_of("circle-calm", "controller.k_y", ("k_y: 0.25", f"k_y: {k_y}"))
    assert [one.severity for one in found] == ["note"] * notes
    for note in found:
        assert note.message == (
            "joining its slot, 'f1' is asked to turn at up to 0.48 rad/s at 22.8 m/s over ground; "
            "its bank gives 0.43, so it joins less sharply"
        )


def test_a_leader_whose_bank_is_small_says_nothing_about_the_followers_field():
    # 25 degrees: 0.229 rad/s, enough for its own field but not for one of k_y 0.2
    leader = "leader: {system_id: 1, alpha_1_s: 1.2, beta_1_s: 0.8, airspeed_range_m_s: [12, 32], "
    change = (f"{leader}max_bank_deg: 45", f"{leader}max_bank_deg: 25")
    assert findings_of("line-calm", "controller.k_y", change, ("k_y: 0.25", "k_y: 0.2")) == []


def test_on_a_circle_the_leaders_field_has_the_turn_to_fly_as_well():
    # 0.3849 . 0.05 . 20 = 0.3849 rad/s is less than g/20 = 0.4903, with 20/150 = 0.1333 it is 0.5182;
    # (0.4903 - 0.1333)/(0.3849 . 20) = 0.04637
    (warning,) = findings_of("circle-calm", "path.gain", ("gain: 0.015", "gain: 0.05"))
    assert warning.severity == "warning"
    assert "turns at up to 0.52 rad/s at 20.0 m/s over ground" in warning.message
    assert warning.remedy == "lower gain to 0.0463 1/m or less"
    assert findings_of("circle-calm", "path.gain", ("gain: 0.015", "gain: 0.0463")) == []


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


def mission(*changes: tuple[str, str]) -> Mission:
    return loaded(changed_text("line-calm", *changes)).mission


def about_the_link(*changes: tuple[str, str]) -> list[Finding]:
    found = check_mission(mission(*changes))
    return [one for one in found if one.field == "rehearsal.link_delay_s"]


@pytest.mark.parametrize("rate_hz", [2.0, 20.0, 100.0])
def test_a_loop_runs_at_two_to_a_hundred_hertz(rate_hz):
    assert mission(("rate_hz: 20", f"rate_hz: {rate_hz}")).rehearsal.rate_hz == rate_hz


@pytest.mark.parametrize(
    ("rate_hz", "fault"),
    [
        ("1.99", "1.99 is too small; choose 2 or more"),
        ("0", "0 is too small; choose 2 or more"),
        ("100.1", "100.1 is too large; choose 100 or less"),
    ],
)
def test_a_loop_runs_neither_slower_nor_faster(rate_hz, fault):
    with pytest.raises(MissionError, match=f"rehearsal.rate_hz: {fault}"):
        mission(("rate_hz: 20", f"rate_hz: {rate_hz}"))


@pytest.mark.parametrize("jitter_s", [0.0, 0.05, 0.1])
def test_jitter_goes_either_way_and_makes_no_state_older_on_average(jitter_s):
    jittery = mission(("rate_hz: 20", f"rate_hz: 20\n  link_jitter_s: {jitter_s}"))
    assert mean_leader_age(jittery) == pytest.approx(0.1)


def test_a_link_older_than_the_patience_with_it_is_an_error():
    (error,) = about_the_link(("link_delay_s: 0.1", "link_delay_s: 0.7"))
    assert error.severity == "error"
    assert "leader states are 0.7 s old on average" in error.message
    assert "patience.leader_s, 0.6 s, and none joins" in error.message
    assert error.remedy == "a link below 0.6 s, or a longer patience.leader_s"


def test_losses_age_a_link_beyond_patience_as_well():
    # 0.1 s and 0.05 . 0.92/0.08 = 0.575 s
    (error,) = about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.92"))
    assert error.severity == "error"
    # 0.1 s and 0.05 . 0.9/0.1 = 0.45 s
    assert about_the_link(("rate_hz: 20", "rate_hz: 20\n  link_loss: 0.9")) == []


@pytest.mark.parametrize(("delay_s", "severities"), [(0.59, []), (1.5, ["warning"])])
def test_a_link_within_patience_is_no_error(delay_s, severities):
    patience = ("wind: {", "patience: {leader_s: 2}\nwind: {") if delay_s > 1.0 else ("", "")
    found = about_the_link(("link_delay_s: 0.1", f"link_delay_s: {delay_s}"), patience)
    assert [one.severity for one in found] == severities


@pytest.mark.parametrize(("period", "layer"), [(0.01, 0.525), (0.05, 0.525), (0.1, 1.05)])
def test_the_layer_before_take_off_is_the_one_in_flight(period, layer):
    usual = mission(("boundary_layer_factor: 4.8", "boundary_layer_factor: 3.5")).controller
    assert effective_layer(usual, period) == pytest.approx(layer)
